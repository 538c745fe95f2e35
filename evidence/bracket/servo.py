"""Exact, interpolated and identified model side by side: gains of the servo channel, which all of
them have, at 50 Hz.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import symheli
from studies.output import progress
from studies.setup.axes import LATERAL
from studies.setup.axis_models import identify
from studies.setup.bounds import Bound
from studies.setup.certificates import bound_to_dict
from studies.setup.flights import TOP, TransitionPlan, autopilot_for
from studies.transition import gain_tables, guarantees
from studies.transition.effort import Effort
from symheli import Helicopter
from synthesis.certify.questions.gain_curve import GainCurve
from synthesis.forms import Spline

RATES = (0.0, 0.1, 1.0, 3.0, 4.5, 8.0, 20.0, math.inf)
"""Permitted accelerations, m/s^2."""

FORM = Spline(segments=(8,))


def measure_servo(heli: Helicopter, quick: bool = False) -> list[Bound]:
    """Bounds of every model: of a computed trajectory, P(p), constant P and, for polynomial
    models, the LFT tests; identified as in the study, seed 0.
    """
    plan, autopilot = TransitionPlan(0, ramps=Effort().ramps), autopilot_for(heli)
    gentle = identify(LATERAL, plan.gentle(heli, autopilot, Effort().gentle_ramps), "rls", order=2)
    aggressive = identify(LATERAL, plan.training(heli, autopilot), "rls")
    family = symheli.sweep(heli, np.linspace(0.0, TOP, 27), inputs=LATERAL.inputs)  # type: ignore[arg-type]
    found: list[Bound] = []
    for name, loop in guarantees.servo_loops(heli, family, gentle, aggressive).items():
        progress(name)
        rates = (0.0, 3.0, math.inf) if quick else RATES
        asked = guarantees.bounds(name, "servo", loop, rates, FORM, Effort().search)
        if guarantees.has_lft(loop):
            asked += guarantees.lft_bounds(name, "servo", loop)
        found += guarantees.answered(asked)
    return found


def text_of(found: list[Bound]) -> str:
    """One table."""
    return gain_tables.guarantee(found, "servo").text()


def found_of(found: list[Bound]) -> dict[str, Any]:
    """What a program would read."""
    return {"bounds": [bound_to_dict(b) for b in found]}


def curves_of(found: list[Bound]) -> list[GainCurve]:
    """One curve a model that is stable when frozen."""
    stable = dict.fromkeys(b.model for b in found if math.isfinite(b.certificate.frozen))
    return [
        guarantees.gain_curve(found, model, "servo", f"Servo channel, {model}") for model in stable
    ]
