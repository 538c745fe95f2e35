"""Controllers of the study, sampled and of low order, by name; or the reason why there is none."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import symheli
from identification import fit_for_control
from identification.judge import structure_bias
from identification.judge.fit_for_control import FitForControl
from identification.model import KinematicModel
from studies.controllers.design_choices import (
    BACK_OFF,
    BACK_OFFS,
    PERIOD,
    RATE,
    SIZES,
    TOP,
)
from studies.controllers.identified_plant import identified_model
from studies.controllers.in_airspeed import of_degree
from studies.controllers.plant import baseline, closed, design_plant, flown_plant
from studies.known_kinematics import flights
from studies.known_kinematics.models import simulator_of
from studies.known_kinematics.rivals import KnownKinematics
from studies.setup.flights import autopilot_for
from studies.setup.questions import Questions
from symheli import FlightRecord, Helicopter, LPVStateSpace, linearize
from symheli.errors import (
    AccuracyError,
    CertificateError,
    SolverError,
    SymheliError,
)
from symheli.flight import XCELL_SERVOS, SimulatedFlight, gain_scheduled_lqr
from synthesis import Plant
from synthesis.design.loops.controller import Controller
from synthesis.design.loops.reduction import fewest
from synthesis.design.lpv.linear_quadratic import lqg, lqr
from synthesis.design.lpv.output_feedback import lft_feedback, output_feedback
from synthesis.design.lpv.point_schedule import hinf_at, hinf_schedule
from synthesis.numerics.linear.norm import norm

LQR, HINF, LFT = "LQR schedule", "H-infinity schedule", "LFT"
BASELINE, IDENTIFIED = "LPV from the baseline", "LPV from the identified model"
NAMES = (LQR, HINF, LFT, BASELINE, IDENTIFIED)
REGULATOR, LQG, ONE_POINT = "regulator behind servos", "LQG", "H-infinity of one airspeed"
FURTHER = (REGULATOR, LQG, ONE_POINT)
"""Classical designs beside those of the study, on the same plant; made where they are asked for."""

FASTEST = np.pi / PERIOD
"""Largest modulus of a pole of the controller, rad/s: half the sample frequency."""

SLOW: dict[str, Any] = {"back_off": BACK_OFFS, "fastest": FASTEST}

AIRSPEEDS = 14
"""Number of airspeeds of the schedules, evenly over the range."""

ORDERS = (8, 9, 10, 12, 14, 16)
DEGREES = (2, 3, 4, 6)
NEAR = 1.03
"""Orders and degrees in airspeed that are tried in turn, and how much larger the frozen gain of the
loop may become by the reduction.
"""


JUDGED_AT, DRAWS = (0.0, 6.5, 13.0), 50
"""Airspeeds (m/s) at which an identified model is checked, and the number of draws from its
uncertainty.
"""

LOOKED_AT = np.linspace(0.0, TOP, 9)
"""Airspeeds, m/s, at which that is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Design:
    """A controller under its name.

    `controller` is what flies: sampled, from measured deviations to commanded ones; None where
    there is none, for `reason` (`failed`: a solver broke off). `promised`: the gain of the
    synthesis, on the plant of the design (of point designs the largest; NaN without one); `frozen`:
    that of the loop which flies, largest over `LOOKED_AT`, inf where one is unstable; `seconds` of
    the design; `remark`: what the data say of the model that it was designed on, where they were
    asked.
    """

    name: str
    controller: LPVStateSpace | None
    promised: float = math.nan
    frozen: float = math.inf
    seconds: float = 0.0
    reason: str = ""
    failed: bool = False
    remark: str = ""

    @property
    def order(self) -> int:
        """States of the controller."""
        return 0 if self.controller is None else len(self.controller.states)


@dataclass(frozen=True, kw_only=True, eq=False)
class Designs:
    """All designs, and the sampled baseline for simulation and certification."""

    designs: tuple[Design, ...]
    plant: Plant


def design_questions(
    heli: Helicopter,
    vehicle: str,
    known_kinematics: KnownKinematics,
    seed: int,
    certified_controllers: bool,
    design_points: int,
) -> Questions:
    """Every design of `NAMES`, in that order; `seed` is that of the flight by which the identified
    model is judged, where the controllers are certified.
    """
    identified = known_kinematics.model
    base = baseline(heli)
    flown, record = flown_plant(base), None
    if certified_controllers:
        record = symheli.fly(heli, flights.aggressive(seed, autopilot_for(heli)))
    simulator = simulator_of(vehicle, heli)[1]
    last = partial(from_flights, from_data(identified), flown, identified, record, simulator)
    ways = from_equations(heli, base, design_points)
    calls = [partial(design, name, make, flown) for name, make in ways.items()]
    long = [last, *reversed(calls)]
    return Questions([*calls, last], lambda designs: Designs(designs=designs, plant=flown), long)


def from_equations(
    heli: Helicopter, base: LPVStateSpace, points: int = AIRSPEEDS
) -> dict[str, Callable[[], Controller | LPVStateSpace]]:
    """How each of `NAMES` is made that needs no flight; the H-infinity schedule at `points`."""
    plant = design_plant(base)
    return {
        LQR: partial(lqr_schedule, heli),
        HINF: partial(hinf_schedule, plant, np.linspace(0.0, TOP, points), BACK_OFF),
        LFT: partial(lft_feedback, plant, **SLOW),
        BASELINE: partial(output_feedback, plant, RATE, **SLOW),
    }


def classical(base: LPVStateSpace) -> dict[str, Callable[[], Controller]]:
    """How each of `FURTHER` is made."""
    plant = design_plant(base)

    def of_one_airspeed() -> Controller:
        return Controller.of(plant, hinf_at(plant, [TOP / 2], BACK_OFF), ONE_POINT)

    return {
        REGULATOR: partial(lqr, plant),
        LQG: partial(lqg, plant),
        ONE_POINT: of_one_airspeed,
    }


def from_data(identified: KinematicModel) -> Callable[[], Controller]:
    """Return the design from data, the last of `NAMES`."""
    return partial(output_feedback, design_plant(identified_model(identified), 0.0), RATE, **SLOW)


def from_flights(
    make: Callable[[], Controller],
    plant: Plant,
    identified: KinematicModel,
    record: FlightRecord | None,
    simulator: Helicopter,
) -> list[Design]:
    """The design from the identified model, with the verdict on that where there is a record to
    judge it by; what the structure leaves out is measured in the `simulator`.
    """
    (found,) = design(IDENTIFIED, make, plant)
    if record is None or found.controller is None:
        return [found]
    judged = judged_by_flight(identified, found.controller, record, simulator)
    return [replace(found, remark=verdict_in_words(judged))]


def design(name: str, make: Callable[[], Controller | LPVStateSpace], plant: Plant) -> list[Design]:
    """One design, in the form that flies; without a controller where none was found, or no loop of
    it is stable.
    """
    begin = time.perf_counter()
    try:
        made = make()
        controller, frozen = simplest(made, plant)
    except SymheliError as error:
        seconds = time.perf_counter() - begin
        failed = isinstance(error, SolverError | AccuracyError | CertificateError)
        reason = str(error)
        return [Design(name=name, controller=None, seconds=seconds, reason=reason, failed=failed)]
    promised = made.promised if isinstance(made, Controller) else math.nan
    return [
        Design(
            name=name,
            controller=controller,
            promised=promised,
            frozen=frozen,
            seconds=time.perf_counter() - begin,
        )
    ]


def judged_by_flight(
    identified: KinematicModel,
    controller: LPVStateSpace,
    record: FlightRecord,
    simulator: Helicopter,
) -> FitForControl:
    """Decide whether the identified model is fit for a loop with this controller, by its
    identification flight and a simulator of another helicopter.
    """
    rest = (0.0,) * (len(identified.parameters) - 1)
    exact = {
        (v, *rest) if rest else v: linearize(simulator, airspeed=v).discretize(PERIOD)
        for v in JUDGED_AT
    }
    return fit_for_control(
        identified,
        record,
        lambda p: controller.at(p[0] if rest else p),
        scales=SIZES,
        bias=structure_bias(identified, record, SimulatedFlight(simulator), exact),
        draws=DRAWS,
    )


def verdict_in_words(found: FitForControl) -> str:
    """The verdict on the model of a design, and by which criteria it falls."""
    by = ", ".join(row.name for row in found.criteria if row.decides and row.verdict != "fit")
    by_its_flight = "by the flight that it was identified from"
    if found.verdict == "fit":
        return f"The identified model is fit for this loop, {by_its_flight}."
    if found.verdict == "not fit":
        return f"The identified model is not fit for this loop, {by_its_flight}: {by}."
    return (
        "The flight that the model was identified from leaves open whether it is fit for this"
        f" loop: {by}."
    )


def lqr_schedule(heli: Helicopter) -> LPVStateSpace:
    """Design the gain-scheduled LQR of the study's flights, checked with its servos."""
    autopilot = gain_scheduled_lqr(heli, 0.0, TOP, PERIOD, AIRSPEEDS, XCELL_SERVOS)
    return autopilot.scheduled_controller.model


def simplest(made: Controller | LPVStateSpace, plant: Plant) -> tuple[LPVStateSpace, float]:
    """The sampled controller of fewest states and, of that, least degree in airspeed whose frozen
    gain on the plant is `NEAR` that of all states; with that gain.
    """

    def gain(model: LPVStateSpace) -> float:
        loop = closed(plant, model)
        return max(norm(*loop.matrices(float(v)), loop.dt)[0] for v in LOOKED_AT)

    whole = made.discretize(PERIOD).model if isinstance(made, Controller) else made
    best, limit = whole, NEAR * gain(whole)
    if isinstance(made, Controller) and math.isfinite(limit):
        fewer = fewest(made, lambda k: gain(k.discretize(PERIOD).model), limit, ORDERS)
        best = fewer.discretize(PERIOD).model
    for degree in DEGREES if math.isfinite(limit) else ():
        simpler = of_degree(best, degree)
        if gain(simpler) <= limit:
            best = simpler
            break
    return best, gain(best)
