"""Which flights of the study a proven tube covers, and what keeps it from the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from symheli.errors import InputError

if TYPE_CHECKING:
    from symheli.flight.flight_data import FlightData
    from synthesis.tubes import Tube

NO_TUBE = "no tube of this controller was given"


def proven(files: Iterable[str]) -> list[Tube]:
    """Tubes read from files and proven again; raises `InputError` where one is not."""
    from synthesis.tubes import Tube

    found = [(name, Tube.load(name)) for name in files]
    for name, tube in found:
        if not tube.verified:
            raise InputError(f"{name}: not proven: {tube.why}")
    return [tube for _, tube in found]


def uncovered(flown: FlightData, tubes: Sequence[Tube]) -> str:
    """What keeps a flight from being covered: the first hypothesis that fails, of the tube whose
    first failure comes last; empty where a tube covers it.
    """
    from synthesis.tubes import coverage

    if flown.lost >= 0:
        return "the flight was lost"
    if not tubes:
        return NO_TUBE
    record = flown.record()
    assert record is not None  # noqa: S101 - of a flight that was not lost
    checks = [coverage(tube, record).checks for tube in tubes]
    places = [[i for i, check in enumerate(own) if not check.kept] for own in checks]
    if not all(places):
        return ""
    best = max(range(len(checks)), key=lambda k: places[k][0])
    return checks[best][places[best][0]].words
