"""Units of a log that kinematics contradicts, and what to type."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from symheli.logs.meaning import MAX_RATE, NAMES, plain_name
from symheli.records import FlightRecord
from symheli.records.kinematics import ANGLES, RATES, UNIT
from symheli.records.tied_units import POSITIONS, Tie, tied_units
from symheli.values.units import to_si

UNITS = {
    "rad/s": ("rad/s", "deg/s"),
    "rad": ("rad", "deg"),
    "m/s": ("m/s", "km/h", "kt", "ft/s", "mph"),
    "m": ("m", "ft"),
}
"""Units in which signals are logged, by SI unit."""

NEAR = 1.25
"""Factor within which a ratio is that of two units."""

STEEPEST = 1.05 * np.pi / 2
"""Largest pitch, rad; of other angles four times that."""


def named_by_signals(record: FlightRecord) -> tuple[FlightRecord, dict[str, str]]:
    """The record with its columns called as the signals that their names say they are, and {signal:
    column} of those renamed.
    """
    columns = {}
    for signal in (*RATES, *ANGLES, "airspeed"):
        unit = UNIT.get(signal, "m/s")
        alike = [
            str(s)
            for s in record.signals
            if s not in (*UNIT, *POSITIONS) and s.unit == unit and _means(str(s)) == signal
        ]
        if signal not in record.signals and alike:
            columns[signal] = alike[0]
    if not columns:
        return record, {}
    units = {signal: UNIT.get(signal, "m/s") for signal in columns}
    named = record.with_signals(units, **{s: record[c] for s, c in columns.items()})
    return named, columns


def contradicted(record: FlightRecord, declared: Mapping[str, str]) -> list[str]:
    """A sentence for each pair of signals whose units contradict each other; `declared` are the
    units of the log by column, SI where one is not there.
    """
    record, columns = named_by_signals(record)
    found = [tie for tie in tied_units(record) if not tie.of_one_unit]
    return [said for tie in found if (said := _sentence(tie, record, columns, declared))]


def _means(column: str) -> str | None:
    name, _ = plain_name(column)
    return next((signal for signal, names in NAMES.items() if name in names), None)


def _sentence(
    tie: Tie, record: FlightRecord, columns: Mapping[str, str], declared: Mapping[str, str]
) -> str:
    """Name the ratio of the pair, and the flags that would mend it; empty where wind may have made
    it.
    """
    signal, other = (columns.get(name, name) for name in (tie.signal, tie.other))
    change = "position" if tie.other in POSITIONS else other
    flags = [
        f"--units {columns.get(name, name)}={unit}"
        for name, factor in ((tie.signal, 1 / tie.ratio), (tie.other, tie.ratio))
        for unit in _units(name, factor, record, declared.get(columns.get(name, name)))
    ]
    if not flags and tie.signal == "airspeed":  # wind makes any ratio
        return ""
    advice = " or ".join(flags) or f"check the units of {signal} and {other}"
    return (
        f"units: {signal} is {tie.ratio:.3g} times what {change} says: one of the two is in another"
        f" unit; {advice}"
    )


def _units(name: str, factor: float, record: FlightRecord, declared: str | None) -> Iterator[str]:
    """Units in which the signal would be `factor` times as large, and of a plausible size."""
    si = record.signals[record.signals.index(name)].unit  # type: ignore[arg-type]
    as_declared = to_si(declared or si)[0]
    largest = float(np.nanmax(np.abs(record[name])))
    most = {"rad/s": MAX_RATE, "rad": STEEPEST if name == "theta" else 4 * STEEPEST}
    ratios = {unit: to_si(unit)[0] / as_declared for unit in UNITS[si]}
    near = [u for u, ratio in ratios.items() if 1 / NEAR < ratio / factor < NEAR]
    for unit in sorted(near, key=lambda u: abs(np.log(ratios[u] / factor)))[:1]:
        if ratios[unit] * largest <= most.get(si, np.inf):
            yield unit
