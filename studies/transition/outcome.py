"""Results of a run of the study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from studies.controllers.certified import CertifiedControllers
from studies.controllers.designs import Designs
from studies.controllers.flown import FlownControllers
from studies.known_kinematics.rivals import KnownKinematics
from studies.setup.bounds import Bound
from studies.setup.flights import StudyRecords
from studies.transition.baseline import Baseline
from studies.transition.comparison import Comparisons
from studies.transition.effort import Effort
from studies.transition.identified import Identification
from studies.transition.paper_experiment import PaperExperiments
from studies.transition.proofs import GustProofs, LongitudinalProofs, RobustProofs, ServoProofs
from studies.transition.real_conditions import RealConditions
from studies.transition.recovery import Recoveries
from symheli import Helicopter


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """Everything a run found, one field a stage; a stage that is not reached is None.

    `seconds` says how long each stage took when it was computed, by its field.
    """

    vehicle: str
    quick: bool
    seed: int
    effort: Effort = field(default_factory=Effort)
    heli: Helicopter | None = None
    baseline: Baseline | None = None
    paper_experiment: PaperExperiments | None = None
    exact_recovery: Recoveries | None = None
    flights: StudyRecords | None = None
    identification: Identification | None = None
    comparison: Comparisons | None = None
    known_kinematics: KnownKinematics | None = None
    real_conditions: RealConditions | None = None
    gust: GustProofs | None = None
    longitudinal: LongitudinalProofs | None = None
    servo: ServoProofs | None = None
    robust: RobustProofs | None = None
    controllers: Designs | None = None
    certified_controllers: CertifiedControllers | None = None
    flown_controllers: FlownControllers | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    complete: bool = False

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """Every certificate, loop by loop."""
        loops = (self.gust, self.longitudinal, self.servo, self.robust)
        return tuple(b for loop in loops if loop is not None for b in loop.bounds)

    @property
    def exact_frozen(self) -> dict[str, float]:
        """Frozen gain of the exact linearizations by channel."""
        loops = {"gust": self.gust, "servo": self.servo}
        return {name: loop.exact_frozen for name, loop in loops.items() if loop is not None}
