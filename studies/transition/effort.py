"""How much the main job does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from studies.marks.flights import LONGEST as AGGRESSIVE
from studies.marks.guarantee import FORM
from synthesis import Search, Spline

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
    aggressive: float = AGGRESSIVE
    """Longest aggressive flight of the models that know their kinematics, s."""
    gentle_flight: bool = True
    """Whether they are identified from a gentle flight too."""
    robust_rates: tuple[float, ...] = (0.0, 3.0)
    robust_form: Spline = field(default_factory=lambda: Spline(segments=(8,)))
    """Of the loop with a margin."""
    every_model: bool = True
    """Whether its gain is proven for every model that the flights allow."""
    servo_rates: tuple[float, ...] = (0.0, 3.0, 8.0, math.inf)
    servo_segments: tuple[int, ...] = (8,)
    design_points: int = 14
    """Airspeeds of a schedule of point designs."""
    certified_controllers: bool = True
    """Whether gains of the loops that fly are proven, and the verdict on the identified model is
    asked for.
    """
    controller_seeds: int = 20
    """Flights of each controller in turbulence of each size."""
    search: Search = field(default_factory=Search)
    """For the lateral gust, whose gain grows with the rate; elsewhere a glance finds the growth
    there is, and nothing above frozen.
    """

    @classmethod
    def look(cls) -> Effort:
        """Shorter flights, fewer certificates of a simpler form."""
        return cls(
            ramps=6,
            gentle_ramps=4,
            gust_rates=(0.0, 3.0, math.inf),
            gust_segments=(8,),
            exact_rates=(),
            longitudinal_rates=(),
            thorough=False,
            aggressive=100.0,
            gentle_flight=False,
            robust_rates=(3.0,),
            robust_form=FORM,
            every_model=False,
            servo_rates=(0.0, math.inf),
            servo_segments=(4,),
            design_points=5,
            certified_controllers=False,
            controller_seeds=4,
            search=GLANCE,
        )
