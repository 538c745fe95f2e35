"""What the flights of an identified model were flown in: wind, mass, governor, servos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from symheli.records import FlightRecord

CONDITIONS = ("wind", "mass", "governor", "servos")

UNKNOWN = "unknown"


def flown_in(records: Sequence[FlightRecord]) -> dict[str, str]:
    """Return each of `CONDITIONS` over all records, from `meta["flown"]`; "unknown" where a record
    does not say it.
    """
    said = [record.meta.get("flown", {}) for record in records]
    return {
        name: "; ".join(dict.fromkeys(str(one.get(name, UNKNOWN)) for one in said))
        for name in CONDITIONS
    }


def sentence(details: Mapping[str, Any]) -> str:
    """Return for which vehicle in which air a statement on an identified model holds."""
    said = dict.fromkeys(CONDITIONS, UNKNOWN) | dict(details.get("flown_in", {}))
    if found := details.get("wind"):
        each = (f"{name} {value:.2g} +- {size:.1g}" for name, (value, size) in found.items())
        said["wind"] += f" (estimated: {', '.join(each)} m/s)"
    each = (f"{name}: {said[name]}" for name in CONDITIONS)
    return f"it is about the vehicle as the flights found it ({', '.join(each)}), and no other"
