"""Amount of work of a run of the study."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from studies.choices import about, check, choice
from studies.known_kinematics.flights import LONGEST as AGGRESSIVE
from studies.known_kinematics.robust_loop import FORM
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline

GLANCE = LowerBoundSearch(levels=6, dwells=5, starts=1, nodes=60, evaluations=8, samples=20_000)
"""A short look for bad airspeeds."""


@dataclass(frozen=True)
class Effort:
    """Amount of work: the whole study, or a quick look (`quick`). Raises `InputError` for a wrong
    type or a value out of range.
    """

    ramps: int = choice(12, "changes of airspeed in the flights that are identified", least=2)
    gentle_ramps: int = choice(10, "the same in the gentle flight", least=2)
    gust_rates: tuple[float, ...] = choice(
        (0.0, 0.1, 1.0, 3.0, 4.5, 7.6, math.inf),
        "permitted |dV/dt| of the lateral gust loop, m/s^2; inf: airspeed may jump",
        least=0,
    )
    gust_segments: tuple[int, ...] = choice(
        (16,), "segments of P(V) of both gust loops, tried in turn", least=1
    )
    exact_rates: tuple[float, ...] = choice(
        (0.0, 1.0, 3.0), "|dV/dt| for the exact lateral gust loop, m/s^2", least=0, empty=True
    )
    longitudinal_rates: tuple[float, ...] = choice(
        (0.0, 3.0, math.inf),
        "|dV/dt| of the longitudinal gust loop, m/s^2; []: leave the stage out",
        least=0,
        empty=True,
    )
    thorough: bool = choice(
        True, "a P with a memory, the exact models and the LFT tests of the servo loops, too"
    )
    aggressive: float = choice(
        AGGRESSIVE, "longest aggressive flight of the models with known kinematics, s", least=20
    )
    gentle_flight: bool = choice(True, "identify those from a gentle flight, too")
    robust_rates: tuple[float, ...] = choice(
        (0.0, 3.0), "|dV/dt| of the loop with a margin, m/s^2", least=0
    )
    robust_form: Spline = field(
        default_factory=lambda: Spline(segments=(8,)), metadata=about("P(V) of that loop")
    )
    every_model: bool = choice(True, "prove its gain for every model that the flights allow, too")
    servo_rates: tuple[float, ...] = choice(
        (0.0, 3.0, 8.0, math.inf), "|dV/dt| of the servo loop, m/s^2", least=0
    )
    servo_segments: tuple[int, ...] = choice((8,), "segments of its P(V)", least=1)
    design_points: int = choice(14, "airspeeds of a schedule of point designs", least=4)
    certified_controllers: bool = choice(
        True, "prove gains of the loops that fly, and ask for the verdict on the identified model"
    )
    first_certificate: bool = choice(
        True, "prove the gain of the LPV controller from the baseline, whatever the other loops"
    )
    controller_seeds: int = choice(
        20, "flights of each controller in turbulence of each size", least=1
    )
    tubes: tuple[str, ...] = choice(
        (), "files of proven tubes, by Tube.save, that these flights are compared with", empty=True
    )
    search: LowerBoundSearch = field(
        default_factory=LowerBoundSearch,
        metadata=about("for bad trajectories of the lateral gust loop"),
    )
    """Its gain grows with the rate; elsewhere a glance finds the growth there is, and nothing above
    frozen.
    """

    def __post_init__(self) -> None:
        check(self)

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
