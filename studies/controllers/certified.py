"""Proven gains of the simulated controllers: the loop with the baseline, servos and delay,
sampled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import synthesis
from studies.controllers.design_choices import RATE
from studies.controllers.designs import BASELINE, LFT, NAMES, Designs
from studies.controllers.plant import closed
from studies.setup.bounds import CONSTANT, PLAIN, Bound
from studies.setup.questions import Questions
from symheli import LPVStateSpace
from synthesis import Solver
from synthesis.forms import Spline

CHANNEL = "controllers"

FORM, SOLVER = Spline(degree=1, segments=1, accept=10.0), Solver("LYAPUNOV", tolerance=1e-3)
"""P(p) straight in airspeed, and when the solver stops. These loops have 25 to 35 states; four
segments, or two more digits, move a proven gain by a thousandth of it for several times the work.
"""


@dataclass(frozen=True, kw_only=True)
class CertifiedControllers:
    """Certificates by controller, `model` of each the name of the controller; empty where none was
    requested.
    """

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


def controller_questions(
    controllers: Designs, certified_controllers: bool, first_certificate: bool
) -> Questions:
    """One proof a controller at the permitted acceleration, of the LFT at an airspeed that jumps;
    or of the LPV controller from the baseline alone, or none.
    """
    names = NAMES if certified_controllers else (BASELINE,) * first_certificate
    calls = [
        partial(proofs, design.name, closed(controllers.plant, design.controller))
        for design in controllers.designs
        if design.name in names and design.controller is not None
    ]
    return Questions(calls, lambda bounds: CertifiedControllers(bounds=bounds))


def proofs(name: str, loop: LPVStateSpace) -> list[Bound]:
    """Return the proofs requested for a controller of that name."""
    return (jumping if name == LFT else bounded)(name, loop)


def bounded(name: str, loop: LPVStateSpace) -> list[Bound]:
    """Certify the gain of a loop at the permitted acceleration; the only lower bound is the frozen
    gain.
    """
    found = synthesis.l2_gain(loop, RATE, form=FORM, solver=SOLVER, search=None)
    return [Bound(name, CHANNEL, RATE, PLAIN, found)]


def jumping(name: str, loop: LPVStateSpace) -> list[Bound]:
    """Certify the gain of a loop when airspeed may jump, and where none is proven that of
    `bounded`.
    """
    found = synthesis.l2_gain(loop, math.inf, solver=SOLVER, search=None)
    own = [Bound(name, CHANNEL, math.inf, CONSTANT, found)]
    return own if found.verified else [*own, *bounded(name, loop)]
