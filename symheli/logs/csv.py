"""Comma-separated tables with one header line."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.logs.files import Table, positive, text
from symheli.lpv.units import to_si


def read_csv(
    path: str | os.PathLike[str], time: str | None, units: Mapping[str, str], dt: float | None = None, time_unit: str = "s"
) -> Table:
    """The columns named in `units`, as they stand, and the time in s.

    `time` names the time column (in `time_unit`); None where the file has none: its rows are then `dt` (s) apart. Empty
    cells are missing samples (NaN). Raises `InputError` for a file that is no table, a cell that is no number, or a time missing,
    and without pandas.
    """
    pd = _pandas()
    if (time is None) == (dt is None):
        raise InputError("give the name of the time column, or time=None and the sample period dt in s: one of the two")
    content = text(path)
    try:
        frame = pd.read_csv(io.StringIO(content), skipinitialspace=True)
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise InputError(f"{path}: not a table with one header line ({error})") from error
    if frame.empty:
        raise InputError(f"{path}: a header but no rows")
    header = next(row for row in csv.reader(io.StringIO(content), skipinitialspace=True) if row)
    for name in (*units, *([time] if time else [])):
        if header.count(name) > 1:
            raise InputError(f"{path}: {header.count(name)} columns are called {name!r}; rename them, so that it is clear which is meant")
        if name not in frame.columns:
            raise UnknownNameError("column", name, [str(c) for c in frame.columns])
    columns = {name: _numbers(frame[name], name, path) for name in units}
    if time is None:
        return positive(dt or 0.0) * np.arange(len(frame)), columns, dict(units)
    factor, unit = to_si(time_unit)
    if unit != "s":
        raise InputError(f"time_unit must be a time such as 's', 'ms' or 'us', got {time_unit!r}")
    seconds = factor * _numbers(frame[time], time, path)
    if np.isnan(seconds).any():
        raise InputError(f"{path}: the time is missing in row {int(np.flatnonzero(np.isnan(seconds))[0]) + 1} of column {time!r}")
    return seconds, columns, dict(units)


def _pandas() -> Any:
    with extra("logs", "reading a CSV log"):
        import pandas
    return pandas


def _numbers(series: object, name: str, path: object) -> np.ndarray:
    pd = _pandas()
    values = np.asarray(pd.to_numeric(series, errors="coerce"), dtype=float)  # type: ignore[call-overload]
    wrong = np.isnan(values) & ~pd.isna(series)  # type: ignore[call-overload]
    if np.any(wrong):
        row = int(np.flatnonzero(wrong)[0])
        raise InputError(f"{path}: column {name!r}, row {row + 1}: expected a number, got {series.iloc[row]!r}")  # type: ignore[attr-defined]
    return values
