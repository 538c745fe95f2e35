"""Tables with one header line: separated by commas, semicolons, tabs or blanks, with decimal points
or commas. Names may carry their unit: "q [rad/s]" or "q (deg/s)".
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence

import numpy as np

from symheli.errors import InputError
from symheli.logs.column import Column
from symheli.logs.files import Table, positive, seconds_in
from symheli.logs.format import LogFormat
from symheli.logs.order import in_order
from symheli.logs.separated import SeparatedTable
from symheli.logs.signal_map import SignalMap
from symheli.values.arrays import Array
from symheli.values.signal import Signal


def read_csv(
    path: str | os.PathLike[str],
    time: str | None,
    units: Mapping[str, str | None] | None,
    dt: float | None = None,
    time_unit: str | None = None,
) -> Table:
    """Read the columns named in `units`, unconverted, and the time in s; without `units` all
    columns whose unit the header gives. An entry of `units` takes precedence over the header; for
    None the unit of the header counts, and "1" where it gives none.

    `time` names the time column (in `time_unit`; default that of its header, or s); None where the
    file has none: its rows are then `dt` (s) apart. Empty cells are missing samples (NaN). Raises
    `InputError` for a file that is no table and a cell that is no number. Rows are put in order as
    `in_order` says.
    """
    if (time is None) == (dt is None):
        raise InputError(
            "give the name of the time column, or time=None and the sample period dt in s: one of"
            " the two"
        )
    table = SeparatedTable.read(path)
    if units is None:
        units = {name: unit for name, unit in table.units.items() if name != time}
        if not units:
            raise InputError(
                f"{path}: no column has its unit in the header, such as 'q [rad/s]'; name columns"
                " and units: units={'q': 'rad/s'}"
            )
    known = {name: unit or table.units.get(name, "1") for name, unit in units.items()}
    if time is not None and time_unit is None:
        time_unit = table.units.get(time)
    factor = seconds_in(time_unit or "s")
    columns = table.columns((*known, *([time] if time else [])))
    values = {name: columns[name] for name in known}
    if time is None:
        return positive(dt or 0.0) * np.arange(len(table.rows)), values, known
    seconds = factor * columns[time]
    return *in_order(seconds, values, path), known


def csv_columns(path: str | os.PathLike[str]) -> dict[str, Column]:
    """Every column of numbers by its name, with the unit of its header; none has a clock of its
    own.
    """
    table, out = SeparatedTable.read(path), {}
    for name in table.names:
        try:
            values = table.columns([name])[name]
        except InputError:  # words
            continue
        out[name] = Column(None, values, table.units.get(name))
    return out


def with_units(time: Array, columns: Sequence[tuple[Signal, Array]]) -> str:
    """Write a table that `read_csv` reads without options: "t [s],q [rad/s]", numbers to the last
    bit, empty cells for NaN.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["t [s]", *(f"{signal} [{signal.unit}]" for signal, _ in columns)])
    for row in zip(time, *(values for _, values in columns), strict=True):
        writer.writerow(["" if np.isnan(value) else repr(float(value)) for value in row])
    return out.getvalue()


class CommaSeparated(LogFormat):
    """Text tables: what no other format recognises."""

    name, time_column, any_text = "csv", True, True
    columns = staticmethod(csv_columns)

    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Read the columns of a map; without a time column its rows are dt apart."""
        return read_csv(path, by.time, by.given, by.dt if by.time is None else None, by.time_unit)

    def declared(self, path: str | os.PathLike[str]) -> Mapping[str, str | None]:
        """Return the names in the header with their units."""
        table = SeparatedTable.read(path)
        return {name: table.units.get(name) for name in table.names}
