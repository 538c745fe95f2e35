"""Conditions in which an identified model was flown: wind, mass, governor, servos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from symheli.records.flight_record import CONDITIONS, FlightRecord

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


def sentence(
    details: Sequence[Mapping[str, Any]], head_wind: tuple[float, float] = (0.0, 0.0)
) -> str:
    """Return for which vehicle in which air a statement on identified models holds; `head_wind`
    (m/s): what the statement adds along the heading.
    """
    each = []
    for name in CONDITIONS:
        said = [one.get("flown_in", {}).get(name, UNKNOWN) for one in details]
        if name == "wind":
            said = [text + _estimated(one) for text, one in zip(said, details, strict=True)]
        each.append(f"{name}: {'; '.join(dict.fromkeys(said))}")
    low, high = head_wind
    still = low == high == 0.0
    more = "" if still else f", and in a steady head wind of {low:g} to {high:g} m/s besides"
    found = f"it is about the vehicle as the flights found it ({', '.join(each)}){more}"
    return f"{found}, and about no other"


def _estimated(details: Mapping[str, Any]) -> str:
    """The wind that was found of the flights."""
    found = details.get("wind")
    if not found:
        return ""
    each = (f"{name} {value:.2g} +- {size:.1g}" for name, (value, size) in found.items())
    return f" (estimated: {', '.join(each)} m/s)"
