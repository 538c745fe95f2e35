"""Prediction of a flight by an LPV model of the whole state: a number of samples ahead, or in free
run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import check_all
from symheli.lpv.simulate import steps
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.sample_period import same_period


class SteppedFlight(NamedTuple):
    """A flight as an LPV model steps through it: x(k+1) - x0(k+1) = A(k) (x(k) - x0(k)) + push(k).

    A (n, nx, nx), push (n, nx), and the measured states x and the trim x0, (n, nx).
    """

    A: Array
    push: Array
    x: Array
    x0: Array

    def ahead(self, horizon: int) -> Array:
        """States (n, nx) `horizon` samples ahead of every measured one, NaN for the first
        `horizon`.
        """
        n = len(self.x)
        if not whole(horizon, "horizon", 1) < n:
            raise InputError(f"horizon: expected 1 .. {n - 1} samples, got {horizon}")
        z = (self.x - self.x0)[: n - horizon]
        for h in range(horizon):
            window = slice(h, n - horizon + h)
            z = np.einsum("kij,kj->ki", self.A[window], z) + self.push[window]
        out = np.full(self.x.shape, np.nan)
        out[horizon:] = z + self.x0[horizon:]
        return out

    def free_run(self, start: int = 0) -> Array:
        """Return states (n, nx) in free run from the measured one at sample `start`; NaN up
        to it.
        """
        out = np.full(self.x.shape, np.nan)
        z = (self.x - self.x0)[start]
        for k in range(start, len(self.x) - 1):
            z = self.A[k] @ z + self.push[k]
            out[k + 1] = z + self.x0[k + 1]
        return out


def predict(
    lpv: LPVStateSpace,
    p: object,
    u: object,
    x: object,
    *,
    dt: float | None = None,
    rate: object | None = None,
) -> SteppedFlight:
    """The flight with scheduling p (n,) or (n, d), inputs u (n, nu) and measured states x (n, nx).

    All are total values, about the trim of the model where it has one. What its motion adds,
    `lpv.trim.drift(p, rate)`, is part of the prediction: `rate` (per second, of the shape of p) is
    by default that of p, by central differences (0: a trim that is taken to rest). `dt` (s) is the
    sample period, needed where the model is continuous. Raises `InputError` for shapes that do not
    fit, a range that is left and another sample period.
    """
    p = check_all(lpv.parameters, p)
    n, nx, nu = len(p), len(lpv.states), len(lpv.inputs)
    u, x = frozen(u, "u", (n, nu)), frozen(x, "x", (n, nx), finite=False)
    if lpv.dt is not None and dt is not None and not same_period(dt, lpv.dt):
        raise InputError(f"the model is sampled every {lpv.dt} s, the flight every {dt} s")
    A, B, E = steps(lpv, p, dt)
    if lpv.trim is None:
        return SteppedFlight(A, np.einsum("kij,kj->ki", B, u), x, np.zeros((n, nx)))
    period = lpv.dt if dt is None else dt
    x0, u0 = lpv.trim.state(p), lpv.trim.input(p)
    speed = np.gradient(p, period, axis=0) if rate is None else np.broadcast_to(rate, p.shape)  # type: ignore[arg-type]
    push = np.einsum("kij,kj->ki", B, u - u0)
    if lpv.dt is None:
        return SteppedFlight(A, push + np.einsum("kij,kj->ki", E, lpv.trim.drift(p, speed)), x, x0)
    # the trim of a sampled model moves by what it is at the next sample
    moved = lpv.dt * lpv.trim.drift(p, speed if rate is not None else np.zeros(p.shape))
    if rate is None:
        moved -= np.diff(x0, axis=0, append=x0[-1:])
    return SteppedFlight(A, push + moved, x, x0)
