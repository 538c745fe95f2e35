"""Derivatives of implicit flights: CasADi's own, through the implicit function theorem at each
step's solution.
"""

from __future__ import annotations

import casadi
import numpy as np

from symheli.codegen.numeric import Numeric
from symheli.integrate.equations import Equations
from symheli.integrate.radau import sample_function
from symheli.integrate.trajectory import Trajectory
from symheli.values.arrays import Array


def _held(flown: Trajectory, k: int) -> tuple[Array, Array, Array, Array]:
    return flown.states[k], flown.inputs[k], flown.wind[k], flown.parameters.array


def _sample(equations: Equations, flown: Trajectory) -> casadi.Function:
    return sample_function(equations, float(flown.times[1] - flown.times[0]), flown.method)


def tangent(
    equations: Equations,
    flown: Trajectory,
    dx0: Array,
    du: Array,
    dwind: Array,
    dp: Array | None = None,
) -> Array:
    """Change of the states (n+1, nx, m) for dx0 (nx, m), du (n, 4, m), dwind (n, 3, m), and dp
    (parameters, m) where parameters move.
    """
    names = ["x", "u", "wind", "p"]
    step = _sample(equations, flown).factory(
        "radau_tangent", [*names, *(f"fwd:{name}" for name in names)], ["fwd:x_next"]
    )
    forward, m = Numeric(step), dx0.shape[-1]
    moved = np.zeros((len(flown.parameters.array), m)) if dp is None else dp
    out = np.empty((*flown.states.shape, m))
    out[0] = dx0
    for k in range(len(flown.inputs)):
        for i in range(m):
            changes = out[k, :, i], du[k, :, i], dwind[k, :, i], moved[:, i]
            out[k + 1, :, i] = forward(*_held(flown, k), *changes)[0]
    return out


def adjoint(equations: Equations, flown: Trajectory, weights: Array) -> tuple[Array, Array, Array]:
    """Gradients (nx, m), (n, 4, m), (n, 3, m) for weights (n+1, nx, m)."""
    names = ["x", "u", "wind", "p"]
    step = _sample(equations, flown).factory(
        "radau_adjoint", [*names, "adj:x_next"], ["adj:x", "adj:u", "adj:wind"]
    )
    reverse, m = Numeric(step), weights.shape[-1]
    x_bar, u_bar, wind_bar = (
        weights[-1].copy(),
        np.empty((*flown.inputs.shape, m)),
        np.empty((*flown.wind.shape, m)),
    )
    for k in reversed(range(len(flown.inputs))):
        for i in range(m):
            bars = reverse(*_held(flown, k), x_bar[:, i])
            x_bar[:, i], u_bar[k, :, i], wind_bar[k, :, i] = (
                bars[0] + weights[k, :, i],
                bars[1],
                bars[2],
            )
    return x_bar, u_bar, wind_bar
