"""How soon `symheli circle` notices that the vehicle has changed, and how often it is mistaken."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence

import numpy as np

import symheli
from evidence.tables import DOCS, keep, markdown, parsed
from studies.circle.alarm import HORIZON, VehicleAlarm, deviations
from studies.circle.circle import LEARN
from studies.circle.vehicle import MASS, Vehicle
from studies.known_kinematics.models import identified, simulator_of
from symheli import FlightRecord
from symheli.flight import ParameterChange

PAGE, SECTION = DOCS / "howto" / "live.md", "alarm"
FLOWN, CHANGE = 600.0, 300.0
"""Length of a flight, and when the vehicle changes, s."""
LATERAL, TAIL = "main_rotor.lateral_gain", "tail_rotor.lift_slope"
CASES = (
    ("nothing", MASS, 1.0),
    ("mass + 5 %", MASS, 1.05),
    ("mass + 10 %", MASS, 1.1),
    ("mass - 10 %", MASS, 0.9),
    ("mass + 20 %", MASS, 1.2),
    ("lateral cyclic - 30 %", LATERAL, 0.7),
    ("tail rotor - 30 %", TAIL, 0.7),
)
"""What changes, its parameter, and by which factor."""


def alarmed(alarm: VehicleAlarm, flight: FlightRecord, since: float) -> float:
    """Return after how many seconds from `since` (s) on the alarm is given; NaN where it is not."""
    seconds = np.arange(since + HORIZON, flight.time[-1], HORIZON)
    for t in seconds:
        if alarm.take(flight.between(t - 2.5 * HORIZON, t)) is not None:
            return float(t - since)
    return math.nan


def of_seed(seed: int) -> list[float]:
    """Return the seconds to the alarm for each of `CASES`, of the flight of a seed."""
    vehicle = Vehicle(duration=FLOWN, seed=seed)
    heli = vehicle.helicopter
    plan, found = vehicle.plan(heli), []
    model, usual = None, None
    for _, name, factor in CASES:
        changed = ParameterChange(CHANGE, {name: factor * float(heli.parameters[name])})
        flight = symheli.fly(heli, plan, change=changed if factor != 1.0 else None)
        if model is None or usual is None:
            first = flight.between(0.0, LEARN)
            model = identified(first, simulator_of(vehicle.name, heli)[1])
            usual = deviations(model, first)
        since = LEARN if factor == 1.0 else CHANGE
        found.append(alarmed(VehicleAlarm(model, usual), flight, since))
    return found


def table(found: Sequence[Sequence[float]]) -> str:
    """The table in Markdown."""
    rows = []
    for (what, *_), seconds in zip(CASES, np.transpose(found), strict=True):
        seen = seconds[np.isfinite(seconds)]
        numbers = [f"{np.median(seen):.0f}", f"{seen.max():.0f}"] if len(seen) else ["", ""]
        rows.append([what, f"{len(seen)} of {len(seconds)}", *numbers])
    return markdown(["what changes", "alarms", "after, median, s", "worst, s"], rows)


def main() -> None:
    """Print the table, and write it where it stands."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=21, help="how many")
    parser.add_argument("--first", type=int, default=100, help="the first of them")
    arguments = parsed(parser, "docs/howto/live.md", timed=False)
    found = []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        found.append(of_seed(seed))
        print(seed, *(f"{s:g}" for s in found[-1]), flush=True)
    text = table(found)
    print(text)
    if arguments.write:
        keep(PAGE, SECTION, text)


if __name__ == "__main__":
    main()
