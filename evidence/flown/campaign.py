"""The trial of the campaign: one controller on hundreds of transitions in turbulence of one size,
against the hypotheses of its proof and the flown entries of the specification sheet.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from evidence.flown.designs import VEHICLE
from studies.campaigns.campaign import Campaign
from studies.campaigns.trial import Trial
from studies.controllers.flown import HIGH, LOW, WINDS, plan
from studies.controllers.measures import Measures, of_flight
from studies.specs.flown import ACCELERATIONS, OF_A_SWITCH, SHARE, measured
from studies.specs.of_vehicle import share_met
from symheli import AirspeedSchedule, Helicopter, LPVStateSpace
from symheli.errors import UnknownNameError, ValidityWarning
from symheli.flight import fly_batch
from symheli.flight.flight_data import FlightData
from synthesis.sheet.sheet import Sheet, Specification

SEEDS_FROM, FLIGHTS, BATCH = 20000, 500, 50
"""First seed of the flights that judge, their number, and how many are held in memory at once."""

OF_A_FLIGHT = {
    "energy ratio": "1",
    "speed error": "m/s",
    "deviation": "1",
    "attitude": "rad",
    "at a stop": "1",
    "outside": "1",
    "faster": "1",
    "beyond the equations": "1",
}
"""What is measured of a flight that was not lost: median and worst are kept."""


def flown_entries(sheet: Sheet) -> list[Specification]:
    """The entries of the sheet that transitions are held against: those that count and whose
    measure a transition has.
    """
    without = ("quickness", *OF_A_SWITCH)
    return [
        s
        for s in sheet.specifications
        if s.kind == "flown" and s.counts and s.measure not in without
    ]


def of_the_vehicle() -> Sheet:
    """The sheet at the length of the vehicle."""
    heli = Helicopter.load(VEHICLE, governor="ideal")
    return Sheet.load().at_length(heli.vehicle.sections["main_rotor"]["radius"].value)


def entry(spec: Specification) -> str:
    """Name of an entry in a dataset."""
    return f"{spec.axis}, {spec.name}"


def trial_of(controllers: Mapping[str, LPVStateSpace]) -> Trial:
    """The trial that flies these controllers."""
    sheet = of_the_vehicle()
    entries = flown_entries(sheet)
    heli = Helicopter.load(VEHICLE, governor="pi")

    def flown(
        *,
        controller: str = "",
        wind: float = WINDS[0],
        acceleration: float = ACCELERATIONS[1],
        flights: int = FLIGHTS,
        first: int = SEEDS_FROM,
    ) -> dict[str, float]:
        """`flights` transitions at `acceleration` (m/s^2), seeds from `first` on, in turbulence of
        a mean `wind` (m/s); lost ones meet no entry.
        """
        if controller not in controllers:
            raise UnknownNameError("controller", controller, controllers)
        chunks = of_flights(heli, controllers[controller], wind, acceleration, flights, first)
        each = [(of_flight(one), measured(one)) for one in chunks]
        return {**_measures([m for m, _ in each]), **_entries(entries, sheet, [v for _, v in each])}

    units = {
        "lost": "1",
        "every entry met": "1",
        "hypotheses": "1",
        **{f"{n}, {which}": u for n, u in OF_A_FLIGHT.items() for which in ("median", "worst")},
    }
    for spec in entries:
        units |= {f"{entry(spec)}, met": "1", f"{entry(spec)}, {SHARE:.0%}": spec.unit}
    return Trial(flown, units)


def of_flights(
    heli: Helicopter,
    controller: LPVStateSpace,
    wind: float,
    acceleration: float,
    flights: int,
    first: int,
) -> Iterator[FlightData]:
    """The flights of one case, in compiled batches of two threads."""
    there = AirspeedSchedule.transition(LOW, HIGH, acceleration=acceleration, hold=3.0)
    asked = replace(plan(controller, wind), schedule=there)
    for begin in range(first, first + flights, BATCH):
        seeds = range(begin, min(begin + BATCH, first + flights))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ValidityWarning)  # counted
            batch = fly_batch(heli, asked, seeds=seeds, workers=2)
        yield from batch.data


def cases(
    controllers: Mapping[str, LPVStateSpace],
    winds: Sequence[float],
    accelerations: Sequence[float] = ACCELERATIONS,
    flights: int = FLIGHTS,
) -> Campaign:
    """Every controller in turbulence of every size at every acceleration, with the same seeds."""
    return Campaign(
        trial_of(controllers),
        grid={"acceleration": accelerations, "wind": winds, "controller": list(controllers)},
        fixed={"flights": flights},
    )


def _measures(each: Sequence[Measures]) -> dict[str, float]:
    kept = [m for m in each if not m.lost]
    row = {"lost": float(np.mean([m.lost for m in each]))}
    if not kept:
        return row
    row["hypotheses"] = float(np.mean([m.outside == 0 and m.faster == 0 for m in kept]))
    values = {
        "energy ratio": [m.ratio for m in kept],
        "speed error": [m.speed for m in kept],
        "deviation": [m.deviation for m in kept],
        "attitude": [m.attitude for m in kept],
        "at a stop": [m.stops for m in kept],
        "outside": [m.outside for m in kept],
        "faster": [m.faster for m in kept],
        "beyond the equations": [m.beyond for m in kept],
    }
    for name, of in values.items():
        row |= {f"{name}, median": float(np.median(of)), f"{name}, worst": float(max(of))}
    return row


def _entries(
    entries: Sequence[Specification], sheet: Sheet, each: Sequence[Mapping[tuple[str, str], float]]
) -> dict[str, float]:
    row, every = {}, np.ones(len(each), bool)
    for spec in entries:
        control = sheet.axes[spec.axis].control if spec.axis in sheet.axes else ""
        values = np.array([one[spec.measure, control] for one in each])
        met = values <= spec.level_1
        every &= met
        row[f"{entry(spec)}, met"] = float(met.mean())
        row[f"{entry(spec)}, {SHARE:.0%}"] = share_met(values, SHARE)
    row["every entry met"] = float(every.mean())
    return row
