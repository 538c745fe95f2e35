"""Opening a log of any known format, with the signals that are asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.logs.files import existing
from symheli.logs.separated import SEPARATORS, SeparatedTable
from symheli.records import FlightRecord
from symheli.records.kinematics import COMPARED
from symheli.values.signal import UNITS

STILL = 1e-6
"""A scheduling signal that moves by less than this part of its size stays where it is."""

Format = Literal["xplane", "csv", "mat"]
COMBINED = "speed"
"""The scheduling signal made of --scheduling-from."""
TIMES = ("t", "time")
"""Columns taken as the time where none is named."""


def format_of(path: Path) -> Format:
    """By extension, then by content: a MATLAB file, an X-Plane log ("name,unit |" in its first
    line), else a table.
    """
    existing(path)
    if path.suffix.lower() == ".mat":
        return "mat"
    if path.suffix.lower() == ".ulg":
        raise InputError(
            f"{path}: PX4 logs need topics: name them in a signal map, --map FILE.toml, or read it"
            " by FlightRecord.from_ulog"
        )
    with path.open("rb") as file:
        head = file.read(4096)
    if head.startswith(b"MATLAB"):
        return "mat"
    first = next((line for line in head.splitlines() if line.strip()), b"")
    return "xplane" if b"|" in first and b"," in first.split(b"|")[0] else "csv"


def read(
    path: Path,
    signals: Sequence[str],
    *,
    format: Format,
    dt: float | None,
    time: str | None,
    units: Mapping[str, str],
    time_unit: str = "s",
) -> FlightRecord:
    """The record, on a uniform step where `dt` (s) says so; a time column is in `time_unit`.

    X-Plane logs declare their units. Of a table, what `check_kinematics` compares is read too where
    it is there. Elsewhere `units` declares those of `signals`; the names every
    room knows (u, q, theta, ...) are SI unless declared otherwise. A time column and `dt` together
    resample. Raises `InputError`.
    """
    if format == "xplane":
        return FlightRecord.from_xplane(path, dt)
    if format == "csv":
        header = SeparatedTable.read(path).header
        signals = list(dict.fromkeys([*signals, *(n for n in COMPARED if n in header)]))
    declared = {name: units.get(name) or UNITS.get(name) or _undeclared(name) for name in signals}
    for name in units:
        if name not in declared:
            raise UnknownNameError("signal in --units", name, declared)
    if format == "mat":
        record = FlightRecord.from_mat(path, time or "t", declared, time_unit)
    else:
        column = time or _time_column(path, dt)
        record = FlightRecord.from_csv(
            path, column, declared, dt if column is None else None, time_unit
        )
        time = column
    return record.resample(dt) if dt is not None and time is not None else record


def _undeclared(name: str) -> str:
    raise InputError(
        f"the unit of {name!r} is not known: --units {name}=UNIT, such as rad, deg/s, m/s, or 1"
        " where it has none"
    )


def _time_column(path: Path, dt: float | None) -> str | None:
    table = SeparatedTable.read(path)
    for name in TIMES:
        if name in table.header:
            return name
    if dt is not None:
        return None
    found = f"{', '.join(map(repr, table.header))} (separated by {SEPARATORS[table.separator]})"
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
        raise InputError("the scheduling signal has no sample that is a number")
    low, high = float(known.min()), float(known.max())
    if high - low > STILL * max(abs(low), abs(high)):
        return low, high
    if degree > 0:
        raise InputError(
            f"the scheduling signal stays at {low:g}: a model scheduled by it cannot be told;"
            " --degree 0 fits an LTI model"
        )
    return low - 0.5, high + 0.5
