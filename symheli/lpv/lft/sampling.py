"""Discretization of an LFT as an LFT."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.equilibration import is_singular
from symheli.lpv.lft.model import LFT


class HoldError(NamedTuple):
    """Largest difference of the frozen frequency responses, Tustin minus zero-order hold, channel
    by channel relative to the largest response of that channel; at `p` {parameter: value} and
    `omega` (rad/s).
    """

    relative: float
    p: dict[str, float]
    omega: float


def tustin(lft: LFT, dt: float) -> LFT:
    """The state becomes xi = x - dt/2 dx/dt, with xi(k+1) = xi + dt dx/dt and x = xi + dt/2 dx/dt:
    the trapezoidal rule.

    The loop through the parameters stays as it is, so the order does too. Raises `InputError` where
    I - dt/2 A is singular at the middle of the parameters.
    """
    if lft.dt is not None:
        raise InputError(f"the model is already discrete (dt = {lft.dt} s)")
    if not (math.isfinite(dt) and dt > 0):
        raise InputError(f"dt must be a positive number of seconds, got {dt}")
    n, nx = lft.order, len(lft.states)
    whole = np.block([[lft.M11, lft.M12], [lft.M21, lft.M22]])
    state = slice(n, n + nx)
    loop = np.eye(nx) - 0.5 * dt * whole[state, state]
    if is_singular(loop):
        raise InputError(f"Tustin's rule fails: 2/dt = {2 / dt:g} rad/s is a pole; take another dt")
    slope = np.linalg.solve(loop, whole[state])  # dx/dt from (w, xi, u)
    out = whole + 0.5 * dt * whole[:, state] @ slope
    out[state] = dt * slope
    out[state, state] += np.eye(nx)
    return LFT(
        out[:n, :n],
        out[:n, n:],
        out[n:, :n],
        out[n:, n:],
        lft.blocks,
        lft.states,
        lft.inputs,
        lft.outputs,
        dt,
    )


def hold_error(lft: LFT, dt: float, band: float, points: int = 60) -> HoldError:
    """See `LFT.hold_error`; a grid of the box and of frequencies."""
    if not 0 < band <= 1:
        raise InputError(f"band is a fraction of the Nyquist frequency in (0, 1], got {band}")
    sampled = lft.discretize(dt)
    omega = np.linspace(0.0, band * math.pi / dt, points + 1)[1:]
    worst = HoldError(0.0, {}, 0.0)
    count = {0: 1, 1: 11, 2: 5, 3: 4}.get(len(lft.blocks), 2)
    for p in product(*(np.linspace(s.low, s.high, count) for s in lft.parameters)):
        hold = lft.at(*p).discretize(dt).frequency_response(omega)
        size = np.abs(hold).max(axis=0)
        wrong = np.abs(sampled.at(*p).frequency_response(omega) - hold) / np.where(
            size > 0, size, 1.0
        )
        if wrong.max(initial=0.0) > worst.relative:
            k = int(np.unravel_index(wrong.argmax(), wrong.shape)[0])
            worst = HoldError(
                float(wrong.max()),
                {s.name: float(v) for s, v in zip(lft.parameters, p, strict=True)},
                float(omega[k]),
            )
    return worst
