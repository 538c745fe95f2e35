"""All trapezoid waves within range and rate on a grid of levels and dwell times: the starting
points of the search for the worst p(t).
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from synthesis.certify.lower_bounds.scheduled import Scheduled
from synthesis.certify.lower_bounds.waves import Wave, steps

if TYPE_CHECKING:
    from synthesis.certify.lower_bounds.lower_bound import Search

Array = np.ndarray

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

    def __init__(self, lpv: Scheduled, rate: float, search: Search):
        self.lpv, self.rate, self.search = lpv, rate, search
        s = lpv.scheduling
        poles = np.linalg.eigvals(lpv.matrices(np.linspace(s.low, s.high, search.levels + 1)).A)
        if lpv.dt is not None:
            poles = np.log(np.where(poles == 0, 1e-12, poles.astype(complex))) / lpv.dt
        pace = np.abs(poles)
        self.fast = 2 * math.pi / float(pace.max())
        self.slow = min(2 * math.pi / max(float(pace.min()), 1e-6), 20 * self.fast)
        self.longest = 0.5 / float(pace.max())
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
