"""What is proven of each controller that flies: the gain of its loop with the baseline, servos and
delay, sampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import synthesis
from studies.controllers.designs import LFT, Designs
from studies.controllers.plant import RATE, closed
from studies.transition.effort import Effort
from studies.transition.guarantees import CONSTANT, PLAIN, Bound, Proof
from studies.transition.proofs import Questions
from symheli import LPVStateSpace
from synthesis import Solver, Spline

CHANNEL = "controllers"

FORM, SOLVER = Spline(degree=1, segments=1, accept=10.0), Solver("LYAPUNOV", tolerance=1e-3)
"""P(p) straight in airspeed, and when the solver stops. These loops have 25 to 35 states; four
segments, or two more digits, move a proven gain by a thousandth of it for several times the work.
"""


@dataclass(frozen=True, kw_only=True)
class CertifiedControllers:
    """The proofs, `model` of each the name of the controller; none where none was asked for."""

    bounds: tuple[Bound, ...]

    def of(self, name: str) -> Bound | None:
        """The least bound of a controller for the permitted acceleration, of any for an airspeed
        that jumps too; one that failed where none is proven, None where none was asked.
        """
        own = [b for b in self.bounds if b.model == name]
        return min(own, key=lambda b: b.certificate.gamma, default=None)

    def gain(self, name: str) -> float:
        """Proven, inf where nothing is."""
        bound = self.of(name)
        return (
            bound.certificate.gamma
            if bound is not None and bound.certificate.verified
            else math.inf
        )


def controller_questions(designs: Designs, effort: Effort) -> Questions:
    """One proof a controller at the permitted acceleration, and for the LFT one more at an airspeed
    that jumps; none without effort.
    """
    asked: list[Proof] = []
    for design in designs.designs if effort.certified_controllers else ():
        if design.controller is None:
            continue
        loop = closed(designs.plant, design.controller)
        asked.append(partial(proof, design.name, loop, RATE))
        if design.name == LFT:
            asked.append(partial(proof, design.name, loop, math.inf))
    return Questions(asked, lambda bounds: CertifiedControllers(bounds=bounds))


def proof(name: str, loop: LPVStateSpace, rate: float) -> list[Bound]:
    """The gain of one loop; no lower bound but the frozen gain is looked for."""
    form = CONSTANT if math.isinf(rate) else PLAIN
    certificate = synthesis.l2_gain(
        loop, rate, form=None if math.isinf(rate) else FORM, solver=SOLVER, search=None
    )
    return [Bound(name, CHANNEL, rate, form, certificate)]
