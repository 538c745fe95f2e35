"""One flight under real conditions identified: servos, a delay that is to be found, and an engine
whose governor does not hold the rotor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from studies.known_kinematics.conditions import CONDITIONS, Instruments, frozen_all
from studies.known_kinematics.models import simulator_of
from symheli.errors import SymheliError
from symheli.flight import SimulatedFlight
from symheli.values.arrays import Array

CONDITION = "servos"
"""Of `CONDITIONS`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RealConditions:
    """Findings of one flight.

    `about`: the condition; `delay`: from command to servo, s, and `found` with its standard
    deviation; `gap`: nu-gap of all axes to the exact model at `SPEEDS`, from the commands; `reason`
    says why there is none.
    """

    about: str
    simulator: str
    delay: float
    found: tuple[float, float] | None = None
    gap: Array | None = None
    reason: str = ""


def identify_under_real_conditions(vehicle: str, seed: int, aggressive: float) -> RealConditions:
    """Fly at most so many seconds, identify, compare; a vehicle that has no such engine, or whose
    flight is lost, has no result.
    """
    condition = replace(CONDITIONS[CONDITION], longest=aggressive)
    out = RealConditions(about=condition.about, simulator="", delay=condition.flown.delay)
    try:
        heli = condition.helicopter(vehicle)
        chosen, simulator = simulator_of(vehicle, heli)
        out = replace(out, simulator=chosen)
        records = condition.flights(heli, seed)
        source = Instruments(SimulatedFlight(simulator))
        model = condition.identified(condition.structure(records[0]), records, source)
        beside = condition.truth(heli).compare(frozen_all(model))
    except SymheliError as error:
        return replace(out, reason=str(error))
    (axis,) = beside.values()
    return replace(out, found=model.details["actuators"]["delay"], gap=axis["model"].gap)
