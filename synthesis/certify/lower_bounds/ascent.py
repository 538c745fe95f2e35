"""The worst p(t): ascent on a periodic trajectory, one linear program a step.

The gradient of growth or gain with respect to p at every node comes from the adjoint along the
cycle. The linear program moves all nodes (and the period) to where the linearised objective is
largest within range, rate and a trust region: its vertices are the bang-bang arcs and rests of
Pontryagin's principle. Source: conditional gradients, Frank and Wolfe, "An algorithm for quadratic
programming", Naval Research Logistics Quarterly 3 (1956); worst-case trajectories as in Tierno,
Murray, Doyle and Gregory, J. Guidance, Control, and Dynamics 20 (1997).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.optimize import linprog, minimize

from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.paths import (
    UNLIMITED,
    Budget,
    Scheduled,
    TransitionMatrices,
    steps,
)
from synthesis.certify.lower_bounds.periodic import Sensitivity, gain, growth
from synthesis.certify.statement.trajectory import SchedulingTrajectory

INITIAL_RADIUS = 0.25
"""Radius of the first trust region, as a fraction of the range of p; the period may then change by
a tenth.
"""
SHORTEST_REACH = 1e-3
"""Radius of the trust region at which the ascent ends."""


SHORTEST_PERIOD = 0.01
"""Shortest period of a cycle, as a fraction of the longest: a p faster than every mode acts by its
mean.
"""


class Objective(NamedTuple):
    """Objective along a cycle: a `measure`, divided by the period where `a_second`."""

    measure: Callable[[TransitionMatrices], Sensitivity]
    a_second: bool

    def score(self, value: float, period: float) -> float:
        """Return the number that an ascent increases."""
        return value / period if self.a_second else value


GROWTH = Objective(growth, True)
"""Growth rate of the state, 1/s."""
GAIN = Objective(gain, False)
"""Logarithm of the L2 gain of the repeated cycle."""


def on_nodes(
    trajectory: SchedulingTrajectory, nodes: int, dt: float | None
) -> SchedulingTrajectory:
    """Return the cycle on an even number of equal intervals, about `nodes`; in discrete time each a
    whole number of samples.
    """
    time, p = trajectory
    period, nodes = float(time[-1] - time[0]), 2 * math.ceil(nodes / 2)
    spacing = period / nodes
    if dt is not None:
        spacing = dt * math.ceil(period / (nodes * dt) - 1e-9)
        nodes = 2 * math.ceil(period / (2 * spacing) - 1e-9)
    # at most stretched in time, never steeper
    at = np.linspace(0.0, 1.0, nodes + 1)
    return SchedulingTrajectory(
        spacing * np.arange(nodes + 1), np.interp(at, (time - time[0]) / period, p)
    )


def ascend(
    lpv: Scheduled,
    rate: float,
    start: SchedulingTrajectory,
    objective: Objective,
    longest: float,
    evaluations: int,
    budget: Budget = UNLIMITED,
) -> tuple[SchedulingTrajectory, float]:
    """Return (cycle, its measure) of an ascent from `start` on equal intervals, with no cycle
    longer than `longest` s, this number of gradients, within the `budget`.
    """
    s = lpv.scheduling
    width = s.high - s.low
    best, reach = start, INITIAL_RADIUS
    here, gradient = _gradient(lpv, best, objective)
    for _ in range(evaluations - 1):
        if reach < SHORTEST_REACH or not math.isfinite(here.value) or budget.over:
            break
        trial = _step(
            best, gradient, rate, (s.low, s.high), reach * width, longest, fixed=lpv.dt is not None
        )
        if trial is None:
            break
        there, new_gradient = _gradient(lpv, trial, objective)
        if (
            objective.score(there.value, trial.time[-1])
            > objective.score(here.value, best.time[-1]) + 1e-9
        ):
            best, here, gradient, reach = (
                trial,
                there,
                new_gradient,
                min(1.5 * reach, 2 * INITIAL_RADIUS),
            )
        else:
            reach /= 3.0
    return best, here.value


def _gradient(
    lpv: Scheduled, cycle: SchedulingTrajectory, objective: Objective
) -> tuple[Sensitivity, Array]:
    """Return the measure, and the gradient (N + 1,) of the score: by p at each node, and by the
    logarithm of the period.

    The steps are differenced, which costs three more evaluations: every second node moves at once,
    so that each step feels one of them alone.
    """
    time, p = cycle
    s, count, period = lpv.scheduling, len(time) - 1, float(time[-1])
    system = _along(lpv, cycle)
    found = objective.measure(system)
    if not math.isfinite(found.value):
        return found, np.zeros(count + 1)
    shift = 1e-6 * (s.high - s.low) * np.where(p > s.middle, -1.0, 1.0)
    interval = np.searchsorted(time, system.time[:-1] + 1e-9 * time[1], side="right") - 1
    out = np.zeros(count + 1)
    for parity in (0, 1):
        moved = np.arange(count + 1) % 2 == parity
        change = found.along(
            _along(lpv, SchedulingTrajectory(time, p + np.where(moved, shift, 0.0))).step
            - system.step
        )
        node = interval + (interval % 2 != parity)
        np.add.at(out, node % count, change / shift[node])
    if lpv.dt is None:
        stretched = (
            found.along(
                _along(lpv, SchedulingTrajectory(time * (1 + 1e-6), p)).step - system.step
            ).sum()
            / 1e-6
        )
        out[-1] = stretched - (found.value if objective.a_second else 0.0)
    return found, out / (period if objective.a_second else 1.0)


def _along(lpv: Scheduled, cycle: SchedulingTrajectory) -> TransitionMatrices:
    return steps(lpv, cycle.time, cycle.p, float(cycle.time[-1]))


def _step(
    cycle: SchedulingTrajectory,
    gradient: Array,
    rate: float,
    limits: tuple[float, float],
    reach: float,
    longest: float,
    *,
    fixed: bool,
) -> SchedulingTrajectory | None:
    """Return the best vertex within `reach`; the period may change by reach/range of 0.4 unless
    `fixed`. None where the program fails.
    """
    time, p = cycle
    low, high = limits
    count, spacing = len(time) - 1, float(time[1])
    change = 0.0 if fixed else min(0.4 * reach / (high - low), 0.5)
    longer = max(min(change, longest / float(time[-1]) - 1.0), 0.0)
    shorter = max(min(change, 1.0 - SHORTEST_PERIOD * longest / float(time[-1])), 0.0)
    bounds = [
        *zip(np.maximum(low, p[:-1] - reach), np.minimum(high, p[:-1] + reach), strict=True),
        (-shorter, longer),
    ]
    matrix, right = None, None
    if math.isfinite(rate):
        next_minus_this = sparse.diags(
            [np.full(count, -1.0), np.ones(count - 1)],
            [0, 1],  # type: ignore[arg-type]
            shape=(count, count),
        ).tolil()
        next_minus_this[count - 1, 0] += 1.0
        stretch = np.full((count, 1), -rate * spacing)
        matrix = sparse.bmat(
            [[next_minus_this, stretch], [-next_minus_this, stretch]], format="csc"
        )
        right = np.full(2 * count, rate * spacing)
    result: Any = linprog(-gradient, A_ub=matrix, b_ub=right, bounds=bounds, method="highs")
    if result.x is None:
        return None
    nodes = np.clip(np.append(result.x[:count], result.x[0]), low, high)
    time = time * (1.0 + result.x[count])
    # the solver keeps the rate to its tolerance; what is missing is made good exactly
    excess = max(1.0, float(np.abs(np.diff(nodes)).max()) / (rate * float(time[1])))
    if fixed:
        return SchedulingTrajectory(time, nodes.mean() + (nodes - nodes.mean()) / excess)
    return SchedulingTrajectory(time * excess, nodes)


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
