"""Derivatives of a simulated flight, forward and adjoint: of the numbers the method returned, along
the very steps it took.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.integrate import explicit_derivatives, implicit_derivatives
from symheli.integrate.equations import equations
from symheli.integrate.radau import Radau
from symheli.integrate.trajectory import Trajectory
from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivative of a functional with respect to the initial state `x0` (nx,), every input `u` (n,
    4) and wind sample `wind` (n, 3).

    With m functionals each has a further axis of length m at the end.
    """

    x0: Array
    u: Array
    wind: Array


def tangent(
    heli: Helicopter,
    flown: Trajectory,
    dx0: object = None,
    du: object = None,
    dwind: object = None,
    dp: object = None,
) -> Array:
    """Return the first-order change of the states (n+1, nx, m) for m directions: dx0 (nx, m), du
    (n, 4, m), dwind (n, 3, m), dp (parameters, m), the last in the order of `heli.parameters`; a
    direction left out is 0.

    Without the last axis one direction, (n+1, nx). `dx0=np.eye(nx)` gives the transition matrices.
    A quaternion stays of unit length, so a change along it vanishes. Inputs made by feedback count
    as given: the derivative is that of the open loop.
    """
    nx, n = len(flown.signals), len(flown.inputs)
    changes = {
        "dx0": (dx0, (nx,)),
        "du": (du, (n, 4)),
        "dwind": (dwind, (n, 3)),
        "dp": (dp, (len(heli.parameters),)),
    }
    given = {
        name: _directions(value, name, shape)
        for name, (value, shape) in changes.items()
        if value is not None
    }
    if not given:
        raise InputError("give at least one of dx0, du, dwind, dp")
    single = all(value.ndim == len(changes[name][1]) for name, value in given.items())
    widths = {
        value.shape[-1] if value.ndim > len(changes[name][1]) else 1
        for name, value in given.items()
    }
    if len(widths) > 1:
        raise InputError(
            f"dx0, du, dwind and dp must have as many directions, got {sorted(widths)}"
        )
    m = widths.pop()
    full = [
        np.ascontiguousarray(given.get(name, np.zeros((*shape, m))).reshape(*shape, m))
        for name, (_, shape) in changes.items()
        if name != "dp" or name in given
    ]
    change = _method(flown).tangent(equations(heli), flown, *full)
    return change[..., 0] if single else change


def gradient(heli: Helicopter, flown: Trajectory, weights: object) -> Gradient:
    """Return the gradient of a functional of the trajectory, given its derivative `weights` (n+1,
    nx) with respect to the states at the samples.

    For the final state only the last row is not zero. `weights` (n+1, nx, m): m functionals at
    once. By reverse differentiation: the cost does not grow with the number of inputs.
    """
    full = _directions(weights, "weights", flown.states.shape)
    single = full.ndim == 2
    bars = _method(flown).adjoint(
        equations(heli), flown, np.ascontiguousarray(full[..., None] if single else full)
    )
    return Gradient(*(bar[..., 0] if single else bar for bar in bars))


def _method(flown: Trajectory) -> ModuleType:
    return implicit_derivatives if isinstance(flown.method, Radau) else explicit_derivatives


def _directions(value: object, name: str, shape: tuple[int, ...]) -> Array:
    array = np.asarray(value, float)
    if (
        array.shape[: len(shape)] != shape
        or array.ndim > len(shape) + 1
        or not np.isfinite(array).all()
    ):
        raise InputError(
            f"{name}: expected finite numbers of shape {shape} or {(*shape, 'm')}, got"
            f" {array.shape}"
        )
    return array
