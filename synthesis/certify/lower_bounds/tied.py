"""Worst trajectories where the rate of one parameter is another: cycles within rate and jerk
limits.

A trapezoid p(t) within |dp/dt| <= rate, averaged over a window of 2 rate/jerk, keeps its range and
its rate and has |d2p/dt2| <= jerk: the difference of two rates over the window. The trapezoids are
those that grow fastest where the second parameter rests, and the best of them are then moved about.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.lower_bound import LowerBound, LowerBoundSearch, along_cycle
from synthesis.certify.lower_bounds.paths import Budget, Wave, WaveFamily
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.numerics.polynomial.motion import Motion

CANDIDATES = 24
"""Number of trapezoidal trajectories that are averaged and simulated."""
MAX_EVALUATIONS = 40
"""Number of evaluations with which the best trajectory is refined."""


class Smooth(NamedTuple):
    """A trapezoid `wave` of p, averaged over `window` s (0: not averaged)."""

    wave: Wave
    window: float

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return p and dp/dt at times t."""
        if self.window == 0:
            return self._wave(t), self._slope(t)
        before = t - self.window
        value = (self._integral(t) - self._integral(before)) / self.window
        return value, (self._wave(t) - self._wave(before)) / self.window

    def _wave(self, t: Array) -> Array:
        time, p = self.wave.vertices()
        return np.interp(np.mod(t, self.wave.period), time, p)

    def _slope(self, t: Array) -> Array:
        time, p = self.wave.vertices()
        k = np.clip(np.searchsorted(time, np.mod(t, self.wave.period), side="right") - 1, 0, 3)
        width = np.diff(time)
        return np.where(width > 0, np.diff(p) / np.where(width > 0, width, 1.0), 0.0)[k]

    def _integral(self, t: Array) -> Array:
        """Return the integral of the wave from 0, over as many cycles as needed."""
        time, p = self.wave.vertices()
        area = np.append(0.0, np.cumsum(0.5 * (p[1:] + p[:-1]) * np.diff(time)))
        cycles, rest = np.divmod(t, self.wave.period)
        k = np.clip(np.searchsorted(time, rest, side="right") - 1, 0, 3)
        part = rest - time[k]
        inside = area[k] + 0.5 * (p[k] + np.interp(rest, time, p)) * part
        return cycles * area[-1] + inside


class AlongPath:
    """A model of several parameters along a path of them, with time as its single parameter."""

    def __init__(self, lpv: LPVStateSpace, tie: tuple[int, int], path: Smooth):
        self.lpv, self.tie, self.path = lpv, tie, path
        self.states, self.dt = lpv.states, lpv.dt
        self.scheduling = Scheduling("time", "s", 0.0, path.wave.period, 1.0)

    def points(self, t: Array) -> Array:
        """Return the parameters at times t, (..., 2)."""
        p, rate = self.path.at(np.asarray(t, dtype=float))
        out = np.empty((*np.shape(t), 2))
        for i, values in zip(self.tie, (p, rate), strict=True):
            s = self.lpv.parameters[i]
            out[..., i] = np.clip(values, s.low, s.high)
        return out

    def matrices(self, t: object, /) -> Matrices:
        """Return A, B, C, D at times t."""
        return self.lpv.matrices(self.points(np.asarray(t, dtype=float)))


def tied_lower_bound(
    lpv: LPVStateSpace, motion: Motion, search: LowerBoundSearch
) -> LowerBound | None:
    """Return the largest gain found along such cycles, inf where the state grows; None where none
    was found. Its trajectory has p (n, 2).
    """
    if len(lpv.parameters) != 2:
        raise InputError(
            "the search for bad trajectories with a rate that is a parameter supports two"
            f" parameters, this model has {len(lpv.parameters)}: leave it out with search=None"
        )
    ((i, j),) = motion.tied
    low, high = motion.box[j]
    # a trapezoid ramps as fast down as up
    jerk, top = motion.rates[j], min(-low, high)
    if jerk == 0 or top <= 0:
        return None
    window = 0.0 if math.isinf(jerk) else 2 * top / jerk
    budget = Budget(search.seconds)
    best, wave = LowerBound(0.0, None), None
    for candidate in _candidates(lpv, (i, j), top, search):
        if budget.over:
            break
        found = _flown(lpv, (i, j), Smooth(candidate, window), search)
        if found.gain > best.gain:
            best, wave = found, candidate
        if math.isinf(best.gain):
            return best
    if wave is None:
        return None
    return max((best, _moved(lpv, (i, j), wave, top, window, search, budget)), key=lambda b: b.gain)


def _candidates(
    lpv: LPVStateSpace, tie: tuple[int, int], top: float, search: LowerBoundSearch
) -> Iterator[Wave]:
    """Yield the fastest growing trapezoids with the rate parameter held at zero, and slow ones."""
    i = tie[0]
    s = lpv.parameters[i]
    ends = np.zeros((2, 2))
    ends[:, i] = s.low, s.high
    still = lpv.with_rate([math.inf, math.inf]).along(ends[0].tolist(), ends[1].tolist())
    family = WaveFamily(still, top / s.radius, search)
    waves = [*family.coarse()[: CANDIDATES * 3 // 4], *family.spread()[: CANDIDATES // 4]]
    for wave in waves:
        yield wave._replace(
            bottom=s.middle + s.radius * wave.bottom, top=s.middle + s.radius * wave.top
        )


def _flown(
    lpv: LPVStateSpace, tie: tuple[int, int], path: Smooth, search: LowerBoundSearch
) -> LowerBound:
    """Return the gain along the repeated path, by an explicit input from rest."""
    along = AlongPath(lpv, tie, path)
    period = path.wave.period
    found = along_cycle(
        along, SchedulingTrajectory(np.array([0.0, period]), np.array([0.0, period])), search
    )
    if found.trajectory is None:
        return found
    time, phase = found.trajectory.time, np.mod(found.trajectory.p, period)
    if math.isinf(found.gain):  # one cycle, known by its ends alone
        time = phase = np.linspace(0.0, period, search.steps + 1)
    shown = SchedulingTrajectory(time, along.points(phase))
    return found._replace(trajectory=shown)


def _moved(
    lpv: LPVStateSpace,
    tie: tuple[int, int],
    wave: Wave,
    top: float,
    window: float,
    search: LowerBoundSearch,
    budget: Budget,
) -> LowerBound:
    """Return the best wave near this one, by Nelder and Mead's search on levels, rests and
    speed.
    """
    s, best = lpv.parameters[tie[0]], LowerBound(0.0, None)
    swing = wave.top - wave.bottom
    unit = max(wave.period, 1e-9)

    def at(x: Array) -> Wave:
        bottom, above = np.sort(np.clip(s.middle + s.radius * x[:2], s.low, s.high))
        speed = top / (1 + abs(x[4]))
        ramp = max((above - bottom) / speed, 1e-9 * unit)
        rests = 1e-4 * unit + unit * np.abs(x[2:4])
        wave = Wave(float(bottom), float(above), float(rests[0]), float(rests[1]), ramp)
        return wave.in_samples(lpv.dt)

    def cost(x: Array) -> float:
        nonlocal best
        if budget.over or math.isinf(best.gain):
            return 0.0
        found = _flown(lpv, tie, Smooth(at(x), window), search)
        best = max((best, found), key=lambda b: b.gain)
        return -min(found.gain, 1e300)

    start = np.array(
        [
            (wave.bottom - s.middle) / s.radius,
            (wave.top - s.middle) / s.radius,
            wave.dwell_bottom / unit,
            wave.dwell_top / unit,
            max(wave.ramp * top / swing - 1, 0.0) if swing > 0 else 0.0,
        ]
    )
    simplex = np.vstack([start, start + np.diag([0.1, -0.1, 0.1, 0.1, 0.2])])
    minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={"maxfev": MAX_EVALUATIONS, "initial_simplex": simplex},
    )
    return best
