"""Reader of a log of any known format, with the requested signals."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.logs.format import OWN_CLOCKS, Format
from symheli.logs.separated import SEPARATORS, SeparatedTable
from symheli.records import FlightRecord
from symheli.records.kinematics import COMPARED
from symheli.values.signal import UNITS

STILL = 1e-6
"""A scheduling signal that moves by less than this part of its size stays where it is."""

COMBINED = "speed"
"""The scheduling signal made of --scheduling-from."""
TIMES = ("t", "time")
"""Columns taken as the time where none is named."""


def read(
    path: Path,
    signals: Sequence[str],
    *,
    format: Format,
    dt: float | None,
    time: str | None,
    units: Mapping[str, str],
    time_unit: str | None = None,
) -> FlightRecord:
    """Return the record, on a uniform step if `dt` (s) is given; a time column is in `time_unit`.

    X-Plane logs declare their units. Of a table, what `check_kinematics` compares is read too where
    it is there. Elsewhere `units` declares those of `signals`, before the header of a table; the
    names every room knows (u, q, theta, ...) are SI unless declared otherwise. A time column and
    `dt` together resample. Raises `InputError`.
    """
    if format == "xplane":
        return FlightRecord.from_xplane(path, dt)
    if format in OWN_CLOCKS:
        raise InputError(
            f"{path}: the columns of an autopilot's log are named in a signal map, --map FILE.toml;"
            " symheli identify with the log alone suggests one"
        )
    known: dict[str, str] = {}
    if format == "csv":
        table = SeparatedTable.read(path)
        known = table.units
        signals = list(dict.fromkeys([*signals, *(n for n in COMPARED if n in table.names)]))
    declared = {
        name: units.get(name) or known.get(name) or UNITS.get(name) or _undeclared(name)
        for name in signals
    }
    for name in units:
        if name not in declared:
            raise UnknownNameError("signal in --units", name, declared)
    if format == "mat":
        record = FlightRecord.from_mat(path, time or "t", declared, time_unit or "s")
    else:
        column = time or _time_column(path, dt)
        record = FlightRecord.from_csv(
            path, column, declared, dt if column is None else None, time_unit
        )
        time = column
    return record.resample(dt) if dt is not None and time is not None else record


def _undeclared(name: str) -> str:
    raise InputError(
        f"the unit of {name!r} is not known: --units {shlex.quote(f'{name}=UNIT')}, such as rad,"
        " deg/s, m/s, or 1 where it has none"
    )


def _time_column(path: Path, dt: float | None) -> str | None:
    table = SeparatedTable.read(path)
    for name in TIMES:
        if name in table.names:
            return name
    if dt is not None:
        return None
    found = f"{', '.join(map(repr, table.names))} (separated by {SEPARATORS[table.separator]})"
    raise InputError(
        f"{path}: no column is called {' or '.join(TIMES)}; name it with --time, or give the sample"
        f" period with --dt; found {found}"
    )


def scheduling_range(values: np.ndarray, degree: int) -> tuple[float, float]:
    """The range of the record the basis is declared on. Raises `InputError` where it does not move
    and `degree` is not 0.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        raise InputError("the scheduling signal contains only NaN")
    low, high = float(known.min()), float(known.max())
    if high - low > STILL * max(abs(low), abs(high)):
        return low, high
    if degree > 0:
        raise InputError(
            f"the scheduling signal stays at {low:g}: a model scheduled by it cannot be identified;"
            " --degree 0 fits an LTI model"
        )
    return low - 0.5, high + 0.5
