"""A controller sampled."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace
from symheli.lpv.bases.polynomials import lobatto_points

Array = np.ndarray

NODES = {1: 41, 2: 13}


def tustin(model: LPVStateSpace, dt: float) -> LPVStateSpace:
    """The trapezoidal rule at every frozen p: stable controllers stay so, and frequencies are warped
    as little as any rule of one step does.

    Raises `InputError` for a model that is sampled already, a period that is not positive, and where
    a pole meets 2/dt.
    """
    if model.dt is not None:
        raise InputError(f"the controller is already sampled (dt = {model.dt} s)")
    if not (math.isfinite(dt) and dt > 0):
        raise InputError(f"dt: expected a positive number of seconds, got {dt!r}")
    return resampled(model, lambda A, B, C, D: bilinear(A, B, C, D, dt), dt)


def bilinear(A: Array, B: Array, C: Array, D: Array, dt: float) -> tuple[Array, ...]:
    """x~ = x - dt/2 (A x + B u) of the trapezoidal rule as the state, so that what B was it is:
    dt (I - A dt/2)^-1 in A and C alone; all (K, ..).
    """
    inverse = np.linalg.inv(np.eye(A.shape[-1]) - 0.5 * dt * A)
    return (
        inverse @ (np.eye(A.shape[-1]) + 0.5 * dt * A),
        dt * inverse @ B,
        C @ inverse,
        D + 0.5 * dt * C @ inverse @ B,
    )


def resampled(
    model: LPVStateSpace,
    change: Callable[[Array, Array, Array, Array], tuple[Array, ...]],
    dt: float | None,
) -> LPVStateSpace:
    """The model with its matrices changed at every p, by the same functions of p fitted to that."""
    m = len(model.parameters)
    box = [(s.low, s.high) for s in model.parameters]
    p = lobatto_points(NODES.get(m, 7), box)
    fitted = [model.basis.fit(p, M) for M in change(*model.matrices(p))]
    n = fitted[0].shape[-1]
    states = model.states if n == len(model.states) else tuple(f"k{i + 1}" for i in range(n))
    return replace(
        model, A=fitted[0], B=fitted[1], C=fitted[2], D=fitted[3], states=states, dt=dt, trim=None,
        residuals=None,
    )  # fmt: skip
