"""How much the main job does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from synthesis import Search

GLANCE = Search(levels=6, dwells=5, starts=1, nodes=60, evaluations=8, samples=20_000)
"""A short look for bad airspeeds."""


@dataclass(frozen=True)
class Effort:
    """How much is done: the whole study, or a look (`quick`)."""

    ramps: int = 12
    gentle_ramps: int = 10
    gust_rates: tuple[float, ...] = (0.0, 0.1, 1.0, 3.0, 4.5, 7.6, math.inf)
    gust_segments: tuple[int, ...] = (16,)
    exact_rates: tuple[float, ...] = (0.0, 1.0, 3.0)
    longitudinal_rates: tuple[float, ...] = (0.0, 3.0, math.inf)
    thorough: bool = True
    """Whether a P with a memory, the exact models and the LFT tests of the servo loops are part of
    it.
    """
    servo_rates: tuple[float, ...] = (0.0, 3.0, 8.0, math.inf)
    servo_segments: tuple[int, ...] = (8,)
    search: Search = field(default_factory=Search)
    """For the lateral gust, whose gain grows with the rate; elsewhere a glance finds the growth
    there is, and nothing above frozen.
    """

    @classmethod
    def look(cls) -> Effort:
        """Shorter flights, fewer certificates of a simpler form."""
        return cls(6, 4, (0.0, 3.0, math.inf), (8,), (), (), False, (0.0, math.inf), (4,), GLANCE)
