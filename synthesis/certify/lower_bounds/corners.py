"""The worst trapezoids: ascent on the levels at which p rests and the times it stays there, with
corners at fixed steps.

Between two levels p moves as fast as it may, or jumps. An ascent on equal nodes (`ascent`) finds
any shape but blurs a jump, or a steep ramp in a long cycle, over one interval; here every corner is
exact. With jumps the gradient by the length of a rest is the Hamiltonian w' A x of Pontryagin's
principle, constant along the rest. Source: Margaliot, "Stability analysis of switched systems using
variational principles: an introduction", Automatica 42 (2006).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from synthesis.certify.lower_bounds.ascent import Objective
from synthesis.certify.lower_bounds.budget import UNLIMITED, Budget
from synthesis.certify.lower_bounds.scheduled import Scheduled
from synthesis.certify.lower_bounds.trajectory import SchedulingTrajectory
from synthesis.certify.lower_bounds.waves import TransitionMatrices, steps

Array = np.ndarray

RELATIVE_STEP = 1e-6
"""Relative change of a rest or of a level in the finite differences of the steps."""


class Corners(NamedTuple):
    """A cycle in which p rests at `levels` (k,) for `rests` (k,) s each, in turn and repeatedly; k
    even.
    """

    levels: Array
    rests: Array

    @classmethod
    def of(cls, wave: SchedulingTrajectory) -> Corners:
        """Return the levels and rests of a `Wave`'s cycle; its ramps become as steep as the rate
        permits.
        """
        return cls(wave.p[:4:2], np.diff(wave.time)[::2])

    def ramps(self, rate: float) -> Array:
        """Return the time from each level to the next, s (k,)."""
        if math.isinf(rate):
            return np.zeros(len(self.levels))
        # equal levels are joined by a ramp too, of next to no time, so that the number of steps
        # never changes
        return np.maximum(
            np.abs(np.roll(self.levels, -1) - self.levels) / rate, 1e-9 * self.rests.sum()
        )

    def twice(self) -> Corners:
        """Return two cycles in one, the second unlike the first: by symmetry equal ones would stay
        equal.
        """
        uneven = np.repeat([1.2, 0.8], len(self.rests))
        return Corners(np.tile(self.levels, 2), np.tile(self.rests, 2) * uneven)

    def cycle(self, rate: float) -> SchedulingTrajectory:
        """Return one cycle; where p jumps, it has a time twice."""
        duration = np.column_stack([self.rests, self.ramps(rate)]).ravel()
        time = np.append(0.0, np.cumsum(duration))
        return SchedulingTrajectory(time, np.append(np.repeat(self.levels, 2), self.levels[0]))


class _Path(NamedTuple):
    """A model along corners, with a fixed number of steps for every rest and ramp (2 k,), some of
    zero length.
    """

    lpv: Scheduled
    rate: float
    counts: Array

    @classmethod
    def along(cls, lpv: Scheduled, corners: Corners, rate: float, longest: float) -> _Path:
        duration = np.diff(corners.cycle(rate).time)
        return cls(lpv, rate, np.maximum(np.ceil(duration / longest), 1).astype(int))

    @property
    def part(self) -> Array:
        """Return, for every step, the rest (2 j) or ramp (2 j + 1) to which it belongs."""
        every = np.repeat(np.arange(len(self.counts)), self.counts)
        return every if math.isfinite(self.rate) else every[every % 2 == 0]

    def steps(self, corners: Corners) -> TransitionMatrices:
        time, p = corners.cycle(self.rate)
        inner = [
            t0 + (t1 - t0) * np.arange(n) / n
            for t0, t1, n in zip(time[:-1], time[1:], self.counts, strict=True)
        ]
        values = [
            p0 + (p1 - p0) * np.arange(n) / n
            for p0, p1, n in zip(p[:-1], p[1:], self.counts, strict=True)
        ]
        return steps(
            self.lpv,
            np.append(np.concatenate(inner), time[-1]),
            np.append(np.concatenate(values), p[-1]),
            float(time[-1]),
        )


def gradient(
    lpv: Scheduled, corners: Corners, rate: float, objective: Objective, longest: float
) -> tuple[float, Array, Array]:
    """Return (score, its gradient by the rests (k,) and by the levels (k,)); `longest` step in s.

    All rests are stretched at once, then every second level is moved: each step feels one of them
    alone.
    """
    k, s = len(corners.levels), lpv.scheduling
    path = _Path.along(lpv, corners, rate, longest)
    system, part = path.steps(corners), path.part
    found = objective.measure(system)
    period = float(system.time[-1])
    score = objective.score(found.value, period)
    if not math.isfinite(found.value):
        return score, np.zeros(k), np.zeros(k)

    def change(other: Corners) -> Array:
        """Return the change of the measure, by part (2 k,)."""
        difference = found.along(path.steps(other).step - system.step)
        return np.bincount(part, difference, 2 * k)

    of_rests = change(corners._replace(rests=corners.rests * (1 + RELATIVE_STEP)))[::2] / (
        RELATIVE_STEP * corners.rests
    )
    of_levels, longer = np.zeros(k), np.zeros(k)
    for parity in (0, 1):
        moved = np.arange(k) % 2 == parity
        shift = RELATIVE_STEP * 2 * s.radius * np.where(corners.levels > s.middle, -1.0, 1.0)
        other = corners._replace(levels=corners.levels + np.where(moved, shift, 0.0))
        # a level is felt on its rest and on the ramps before and after it
        rest, ramp = change(other).reshape(k, 2).T
        stretch = other.ramps(rate) - corners.ramps(rate)
        of_levels[moved] = ((rest + ramp + np.roll(ramp, 1)) / shift)[moved]
        longer[moved] = ((stretch + np.roll(stretch, 1)) / shift)[moved]
    if objective.a_second:
        of_rests, of_levels = (of_rests - score) / period, (of_levels - score * longer) / period
    return score, of_rests, of_levels


def climb(
    lpv: Scheduled,
    rate: float,
    start: Corners,
    objective: Objective,
    longest: float,
    period: float,
    evaluations: int,
    budget: Budget = UNLIMITED,
) -> Corners:
    """Return the best corners of an ascent from `start`, in steps of at most `longest` s and cycles
    of about `period` s at most.

    It ends at once where the measure is infinite. Continuous time.
    """
    s, k = lpv.scheduling, len(start.levels)
    room = max(period - float(start.ramps(rate).sum()), float(start.rests.sum())) / k
    unit = room / 10
    least = 1e-4 * room
    # no rest is nothing: where all of p(t) was ramps, corners of a p that jumps would last no time
    start = start._replace(rests=np.clip(start.rests, 10 * least, 2 * room))
    best, best_score = start, -math.inf

    def cost(x: Array) -> tuple[float, Array]:
        nonlocal best, best_score
        here = Corners(s.middle + s.radius * x[:k], unit * x[k:])
        score, of_rests, of_levels = gradient(lpv, here, rate, objective, longest)
        if score > best_score:
            best, best_score = here, score
        if not math.isfinite(score) or budget.over:
            raise _Ended
        return -score, -np.concatenate([s.radius * of_levels, unit * of_rests])

    at = np.concatenate([(start.levels - s.middle) / s.radius, start.rests / unit])
    # as far from the middle of the start as a cycle has time for
    middle, swing = 0.5 * (start.levels.min() + start.levels.max()), 0.5 * rate * period / k
    bounds = [
        tuple(np.clip((middle + np.array([-swing, swing]) - s.middle) / s.radius, -1.0, 1.0))
    ] * k + [(least / unit, 2 * room / unit)] * k
    options: Any = {"maxfun": evaluations, "maxiter": evaluations}
    try:
        minimize(cost, at, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    except _Ended:
        pass
    return best


class _Ended(Exception):
    """Raised where the state grows along the last corners, or does not respond at all; or time is
    up.
    """
