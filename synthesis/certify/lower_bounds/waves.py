"""Periodic scheduling trajectories, and the linear time-varying system an LPV model becomes along
one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symheli.lpv.exponential import expm
from synthesis.certify.lower_bounds.scheduled import Scheduled
from synthesis.certify.lower_bounds.trajectory import SchedulingTrajectory

Array = np.ndarray

GAUSS = math.sqrt(3.0) / 6.0
"""Offset of the two Gauss points from the middle of a step, as a fraction of it."""


class Wave(NamedTuple):
    """A trapezoidal wave: p dwells at `bottom` and at `top` (s each) and ramps between them in
    `ramp` s (0: it jumps), repeatedly.
    """

    bottom: float
    top: float
    dwell_bottom: float
    dwell_top: float
    ramp: float

    @property
    def period(self) -> float:
        """Length of one cycle, s."""
        return self.dwell_bottom + self.dwell_top + 2.0 * self.ramp

    def in_samples(self, dt: float | None) -> Wave:
        """Return the wave in whole samples, of one at least, with ramps no steeper; unchanged in
        continuous time.
        """
        if dt is None:
            return self
        bottom, top = (max(1.0, round(d / dt)) * dt for d in (self.dwell_bottom, self.dwell_top))
        ramp = math.ceil(self.ramp / dt - 1e-9) * dt
        return self._replace(dwell_bottom=bottom, dwell_top=top, ramp=ramp)

    def cycle(self) -> SchedulingTrajectory:
        """Return one cycle; where p jumps, it has a time twice."""
        return SchedulingTrajectory(*self.vertices())

    def vertices(self, cycles: int = 1) -> tuple[Array, Array]:
        """Return corner times (s) and values of p over whole cycles."""
        time = np.cumsum([0.0, self.dwell_bottom, self.ramp, self.dwell_top, self.ramp])
        p = np.array([self.bottom, self.bottom, self.top, self.top, self.bottom])
        return np.concatenate([time + k * self.period for k in range(cycles)]), np.tile(p, cycles)


class TransitionMatrices(NamedTuple):
    """Transition matrices: z_k = [x; v] -> [x(k+1); y_k] = step[k] z_k, scaled so that |v|^2 and
    |y|^2 are energies. step (N, nx + r, nx + nu).

    In continuous time v is held over a step, and y stacks the outputs at its two Gauss points.
    `time` (N + 1,) in s.
    """

    step: Array
    time: Array
    states: int

    @property
    def transition(self) -> Array:
        """State transition over all the steps (nx, nx)."""
        out = np.eye(self.states)
        for M in self.step[:, : self.states, : self.states]:
            out = M @ out
        return out


def samples(trajectory: SchedulingTrajectory, dt: float) -> SchedulingTrajectory:
    """Return one value of p a sample, from the start to one sample before the end, so that a cycle
    can be repeated.
    """
    time, p = trajectory
    at = time[0] + dt * np.arange(max(1, round((time[-1] - time[0]) / dt)))
    return SchedulingTrajectory(at, np.interp(at, time, p))


def steps(
    lpv: Scheduled, time: Array, p: Array, longest: float, split: int = 1
) -> TransitionMatrices:
    """Return the model along straight lines between the corners (`time`, `p`), in steps of at most
    `longest` s, each cut in `split`.

    Continuous: fourth-order Magnus exponentials, exact where p rests (Hairer, Lubich and Wanner,
    IV.7). Discrete: its own samples at multiples of dt.
    """
    n = len(lpv.states)
    if lpv.dt is not None:
        sampled = samples(SchedulingTrajectory(time, p), lpv.dt)
        A, B, C, D = lpv.matrices(_clip(lpv, sampled.p))
        at = np.append(sampled.time, sampled.time[-1] + lpv.dt)
        return TransitionMatrices(
            np.concatenate([np.concatenate([A, B], 2), np.concatenate([C, D], 2)], 1), at, n
        )
    starts, widths, p0, slope = [], [], [], []
    for t0, t1, q0, q1 in zip(time[:-1], time[1:], p[:-1], p[1:], strict=True):
        if t1 - t0 <= 1e-12 * max(longest, 1e-300):
            continue
        count = split * max(1, math.ceil((t1 - t0) / longest))
        h = (t1 - t0) / count
        starts += [t0 + h * np.arange(count)]
        widths += [np.full(count, h)]
        p0 += [q0 + (q1 - q0) * np.arange(count) / count]
        slope += [np.full(count, (q1 - q0) / (t1 - t0))]
    h, begin, pace = (np.concatenate(part) for part in (widths, p0, slope))
    c1, c2 = 0.5 - GAUSS, 0.5 + GAUSS

    def augmented(fraction: float) -> tuple[Array, Array]:
        A, B, C, D = lpv.matrices(_clip(lpv, begin + pace * h * fraction))
        M = np.zeros((len(h), n + B.shape[2], n + B.shape[2]))
        M[:, :n, :n], M[:, :n, n:] = A, B
        return M * h[:, None, None], np.concatenate([C, D], 2)

    (M1, Y1), (M2, Y2) = augmented(c1), augmented(c2)
    whole = expm(0.5 * (M1 + M2) + math.sqrt(3.0) / 12.0 * (M2 @ M1 - M1 @ M2))
    outputs = [Y @ expm(c * augmented(0.5 * c)[0]) for c, Y in ((c1, Y1), (c2, Y2))]
    root = np.sqrt(h)[:, None, None]
    step = np.concatenate([whole[:, :n], *(math.sqrt(0.5) * root * y for y in outputs)], 1)
    step[:, :, n:] /= root
    return TransitionMatrices(step, np.append(np.concatenate(starts), time[-1]), n)


def _clip(lpv: Scheduled, p: Array) -> Array:
    return np.clip(p, lpv.scheduling.low, lpv.scheduling.high)
