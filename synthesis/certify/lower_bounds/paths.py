"""Paths of one parameter over time: waves with their transition matrices, budget of a search."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from symheli import Scheduling
from symheli.lpv.exponential import expm
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.statement.trajectory import SchedulingTrajectory

if TYPE_CHECKING:
    from synthesis.certify.lower_bounds.lower_bound import LowerBoundSearch


class Scheduled(Protocol):
    """A linear model whose matrices depend on one parameter: an LPVStateSpace, or an LFT of one
    parameter.
    """

    @property
    def scheduling(self) -> Scheduling:
        """The parameter: its range, rate and unit."""
        ...

    @property
    def states(self) -> Sequence[object]:
        """Names of the states."""
        ...

    @property
    def dt(self) -> float | None:
        """Sample time in s, None in continuous time."""
        ...

    def matrices(self, p: object, /) -> Matrices:
        """A, B, C, D at p, whose axes come first."""
        ...


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


MAX_STEP_RATIO = 2.0
"""Largest ratio of a time step along the slowest cycles to the step that resolves the fastest
mode.
"""

MAX_LEVEL_RATIO = 8
"""Largest factor by which levels may be closer than requested for a slow p."""


PERIODS = 7
"""Number of periods of the waves that `spread` tries, from half that of the fastest mode to the
longest.
"""


class WaveFamily:
    """The waves of a model within `rate`, on the grid that `search` sets.

    `slow`: time scale of the slowest mode, s, at most twenty times that of the fastest;
    `longest`: the longest time step that resolves the fastest mode, s.
    """

    def __init__(self, lpv: Scheduled, rate: float, search: LowerBoundSearch):
        self.lpv, self.rate, self.search = lpv, rate, search
        s = lpv.scheduling
        poles = np.linalg.eigvals(lpv.matrices(np.linspace(s.low, s.high, search.levels + 1)).A)
        if lpv.dt is not None:
            poles = np.log(np.where(poles == 0, 1e-12, poles.astype(complex))) / lpv.dt
        pace = np.abs(poles)
        fastest = float(pace.max()) or 1.0
        self.fast = 2 * math.pi / fastest
        self.slow = min(2 * math.pi / max(float(pace.min()), 1e-6), 20 * self.fast)
        self.longest = 0.5 / fastest
        # a slow p covers little of the range in the longest cycle: levels close enough for some
        # steps up and down
        spacing = min((s.high - s.low) / search.levels, self.rate * self.longest_period / 6)
        levels = min(math.ceil((s.high - s.low) / spacing), MAX_LEVEL_RATIO * search.levels)
        self.grid = np.linspace(s.low, s.high, levels + 1)

    @property
    def longest_period(self) -> float:
        """Longest period of a cycle in the search for growth, s."""
        return self.search.cycles * self.slow

    @property
    def slowest_period(self) -> float:
        """Longest period of a cycle in the search for a large gain, s: a slow p may cross its range
        and come back, as far as the time steps permit.
        """
        if self.lpv.dt is not None:
            # every sample of a cycle counts, so that long cycles are dear
            return min(self.longest_period, self.search.steps * self.lpv.dt)
        s, reach = self.lpv.scheduling, MAX_STEP_RATIO * self.search.steps * self.longest
        return max(self.longest_period, min(2 * (s.high - s.low) / self.rate, reach))

    def wave(
        self,
        bottom: float,
        top: float,
        dwell_bottom: float,
        dwell_top: float,
        ramp: float = 0.0,
        longest: float | None = None,
    ) -> Wave | None:
        """Return the wave with ramps as steep as allowed, but of `ramp` s at least; None where it
        lasts over `longest` s (`longest_period`).
        """
        longest = self.longest_period if longest is None else longest
        ramp = max(ramp, 0.0 if math.isinf(self.rate) else (top - bottom) / self.rate)
        wave = Wave(bottom, top, dwell_bottom, dwell_top, ramp).in_samples(self.lpv.dt)
        return wave if 0 < wave.period <= longest else None

    def coarse(self) -> list[Wave]:
        """Return the waves on the grid of levels and dwell times, that of the fastest growth first,
        one a pair of levels.
        """
        dwell = np.linspace(0.0, 0.75 * self.slow, self.search.dwells)
        if self.lpv.dt is not None:
            dwell = np.unique(np.maximum(np.round(dwell / self.lpv.dt), 1.0)) * self.lpv.dt
        waits = [[self._transition(p, p, d) for d in dwell] for p in self.grid]
        rise = [self._ramp(a, b) for a, b in zip(self.grid[:-1], self.grid[1:], strict=True)]
        fall = [self._ramp(b, a) for a, b in zip(self.grid[:-1], self.grid[1:], strict=True)]
        found = []
        for i in range(len(self.grid)):
            up = down = np.eye(len(self.lpv.states))
            for j in range(i + 1, len(self.grid)):
                up, down = rise[j - 1] @ up, down @ fall[j - 1]
                shortest = self.wave(
                    self.grid[i], self.grid[j], 0.0, dwell[1] if len(dwell) > 1 else self.fast
                )
                if shortest is None:
                    break
                cycle = (np.array(waits[i]) @ down)[:, None] @ (np.array(waits[j]) @ up)[None]
                radius = np.abs(np.linalg.eigvals(cycle)).max(axis=-1)
                period = 2 * shortest.ramp + dwell[:, None] + dwell
                # a cycle of no length does not decay, and would be the best
                pace = np.where(
                    period > 0,
                    np.log(np.maximum(radius, 1e-300)) / np.maximum(period, self.fast / 100),
                    -math.inf,
                )
                a, b = np.unravel_index(int(pace.argmax()), pace.shape)
                wave = self.wave(self.grid[i], self.grid[j], dwell[a], dwell[b])
                if wave is not None:
                    found.append((float(pace.max()), wave))
        return [wave for _, wave in sorted(found, key=lambda pair: -pair[0])]

    def spread(self, around: float | None = None) -> list[Wave]:
        """Return waves of many periods, whatever their growth: as much of the range as the rate
        allows, with rests and as triangles.

        Where A does not depend on p all waves grow alike, and what p does to the gain depends on
        its period alone. A p too slow for its range moves at its ends, in its middle, and `around`
        a value, such as that of the worst frozen model.
        """
        s, wave = self.lpv.scheduling, partial(self.wave, longest=self.slowest_period)
        centre = s.middle if around is None else around
        found = []
        for period in np.geomspace(
            0.5 * self.fast, 0.999 * max(self.slowest_period, self.fast), PERIODS
        ):
            swing = min(s.high - s.low, 0.5 * period * self.rate)
            rest = period - (0.0 if math.isinf(self.rate) else 2 * swing / self.rate)
            if swing < s.high - s.low:
                near = float(np.clip(centre - 0.5 * swing, s.low, s.high - swing))
                found += [
                    wave(a, a + swing, 0.0, 0.0)
                    for a in dict.fromkeys((s.low, s.middle - 0.5 * swing, s.high - swing, near))
                ]
            else:
                found += [
                    wave(s.low, s.high, share * rest, (1 - share) * rest)
                    for share in (0.5, 0.2, 0.8)
                ]
                found.append(wave(s.low, s.high, 0.0, 0.0, 0.5 * period))
        return [one for one in found if one is not None]

    def _ramp(self, a: float, b: float) -> Array:
        return self._transition(a, b, 0.0 if math.isinf(self.rate) else abs(b - a) / self.rate)

    def _transition(self, a: float, b: float, duration: float) -> Array:
        if self.lpv.dt is not None:
            duration = math.ceil(duration / self.lpv.dt - 1e-9) * self.lpv.dt
        if duration <= 0 or duration > self.longest_period:
            return np.eye(len(self.lpv.states))
        return steps(
            self.lpv,
            np.array([0.0, duration]),
            np.array([a, b]),
            duration if a == b else duration / 6,
        ).transition


@dataclass(frozen=True)
class Budget:
    """A limit of `seconds` of wall time, from when it was made."""

    seconds: float = math.inf
    start: float = field(default_factory=time.perf_counter)

    @property
    def left(self) -> float:
        """Remaining time, at least 0, s."""
        return max(self.seconds - (time.perf_counter() - self.start), 0.0)

    @property
    def over(self) -> bool:
        """Whether no time is left."""
        return self.left <= 0.0


UNLIMITED = Budget()


def search_hypothesis(seconds: float | None, spent: float) -> tuple[str, ...]:
    """Return the limit of a search, s, as a hypothesis of its bound; None: nothing was searched."""
    if seconds is None:
        return ("no trajectory was searched: the lower bound is that of the worst frozen model",)
    limit = "" if math.isinf(seconds) else f" for at most {seconds:g} s"
    ended = ", which ended the search" if spent >= seconds else ""
    return (
        (
            f"worst trajectories were searched{limit}{ended}: a longer search can only increase"
            " their lower bound"
        ),
    )
