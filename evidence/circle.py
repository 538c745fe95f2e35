"""How soon `symheli circle` notices that the vehicle has changed, and how often it is mistaken."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import symheli
from evidence.tables import DOCS, keep, markdown, parsed
from identification import KinematicARX, Polynomial, fit
from identification.methods import FilterError
from studies.circle.alarm import HORIZON, THRESHOLD, VehicleAlarm, deviations, errors
from studies.circle.circle import LEARN
from studies.circle.vehicle import MASS, Vehicle
from studies.known_kinematics.models import SCHEDULING, identified, simulator_of
from studies.setup.axes import ALL
from studies.setup.flights import TOP, light_turbulence
from symheli import FlightRecord
from symheli.flight import ParameterChange, SimulatedFlight
from symheli.progress import tracked
from symheli.values.arrays import Array

PAGE, SECTION = DOCS / "howto" / "live.md", "alarm"
GUSTY_PAGE, GUSTS = DOCS / "identified.md", "alarm in light turbulence"
FLOWN, CHANGE = 600.0, 300.0
"""Length of a flight, and when the vehicle changes, s."""
LATERAL, TAIL = "main_rotor.lateral_gain", "tail_rotor.lift_slope"
GUSTY, GUSTY_CHANGE = 1840.0, 840.0
"""The same in light turbulence."""
THRESHOLDS = (THRESHOLD, 15.0, 20.0, 30.0, 40.0)
SOON = 5.0
"""s"""
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


GUST = 2.0
"""Standard deviation of the gust that the identification is told, m/s."""


@dataclass(frozen=True)
class InGusts:
    """Of one threshold and seed: false alarms in `hours` without a change, and seconds to the alarm
    after the mass became 10 % larger, and smaller; infinite where none is given.
    """

    threshold: float
    false: int
    hours: float
    delays: tuple[float, float]


def in_gusts(seed: int) -> list[InGusts]:
    """Count the alarms of a seed in light turbulence, for each of `THRESHOLDS`."""
    vehicle = Vehicle(duration=GUSTY, seed=seed)
    heli = vehicle.helicopter
    plan = replace(vehicle.plan(heli), wind=light_turbulence(seed))
    first = symheli.fly(heli, plan).between(0.0, LEARN)
    source = SimulatedFlight(simulator_of(vehicle.name, heli)[1])
    kin = KinematicARX(ALL.inputs, SCHEDULING[0], basis=Polynomial(2, 0.0, TOP))
    model = fit(kin, first, method=FilterError(source, gust=GUST))
    usual, every = deviations(model, first), round(HORIZON / plan.dt)
    looks = []
    for factor in (1.0, 1.1, 0.9):
        since = LEARN if factor == 1.0 else GUSTY_CHANGE
        mass = ParameterChange(GUSTY_CHANGE, {MASS: factor * float(heli.parameters[MASS])})
        flight = symheli.fly(heli, plan, change=mass if factor != 1.0 else None)
        looks.append(errors(model, flight)[round(since / plan.dt) + every :: every])
    out = []
    for threshold in THRESHOLDS:
        alarms = [_alarms(VehicleAlarm(model, usual, threshold), each) for each in looks]
        delays = [HORIZON * (each[0] + 1) if each else math.inf for each in alarms[1:]]
        hours = len(looks[0]) * HORIZON / 3600.0
        out.append(InGusts(threshold, len(alarms[0]), hours, (delays[0], delays[1])))
    return out


def _alarms(alarm: VehicleAlarm, looks: Array) -> list[int]:
    """Looks (n, 8) at which the alarm is given; it begins anew after each."""
    found = []
    for k, error in enumerate(looks):
        if alarm.look(error) is not None:
            found.append(k)
            alarm.sums[:] = 0.0
    return found


def table_in_gusts(found: Sequence[Sequence[InGusts]]) -> str:
    """What each threshold costs, in Markdown."""
    rows = []
    for each in zip(*found, strict=True):
        delays = np.array([d for one in each for d in one.delays])
        median, worst = np.median(delays), delays.max()
        rows.append(
            [
                f"{each[0].threshold:g}",
                f"{sum(one.false for one in each) / sum(one.hours for one in each):.1f}",
                f"{sum(one.false == 0 for one in each)} of {len(each)}",
                *(f"{d:.0f}" if math.isfinite(d) else "none" for d in (median, worst)),
                f"{int(np.sum(delays <= SOON))} of {len(delays)}",
            ]
        )
    head = ["threshold", "false alarms an hour", "flights without", "mass +- 10 %: median, s"]
    return markdown([*head, "worst, s", f"within {SOON:g} s"], rows)


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
    parser.add_argument("--turbulent", action="store_true", help="in light turbulence")
    arguments = parsed(parser, "docs/howto/live.md", timed=False)
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    if arguments.turbulent:
        page, section = GUSTY_PAGE, GUSTS
        text = table_in_gusts(list(map(in_gusts, tracked("seeds", seeds))))
    else:
        found = []
        for seed in seeds:
            found.append(of_seed(seed))
            print(seed, *(f"{s:g}" for s in found[-1]), flush=True)
        page, section, text = PAGE, SECTION, table(found)
    print(text)
    if arguments.write:
        keep(page, section, text)


if __name__ == "__main__":
    main()
