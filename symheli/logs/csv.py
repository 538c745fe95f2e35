"""Tables with one header line: separated by commas, semicolons, tabs or blanks, with decimal points
or commas.
"""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from symheli.errors import InputError
from symheli.logs.files import Table, positive, seconds_in
from symheli.logs.separated import SeparatedTable


def read_csv(
    path: str | os.PathLike[str],
    time: str | None,
    units: Mapping[str, str],
    dt: float | None = None,
    time_unit: str = "s",
) -> Table:
    """The columns named in `units`, as they stand, and the time in s.

    `time` names the time column (in `time_unit`); None where the file has none: its rows are then
    `dt` (s) apart. Empty cells are missing samples (NaN). Raises `InputError` for a file that is no
    table, a cell that is no number, or a time missing.
    """
    if (time is None) == (dt is None):
        raise InputError(
            "give the name of the time column, or time=None and the sample period dt in s: one of"
            " the two"
        )
    factor = seconds_in(time_unit)
    table = SeparatedTable.read(path)
    columns = table.columns((*units, *([time] if time else [])))
    values = {name: columns[name] for name in units}
    if time is None:
        return positive(dt or 0.0) * np.arange(len(table.rows)), values, dict(units)
    seconds = factor * columns[time]
    if np.isnan(seconds).any():
        raise InputError(
            f"{path}: the time is missing in row {int(np.flatnonzero(np.isnan(seconds))[0]) + 1} of"
            f" column {time!r}"
        )
    return seconds, values, dict(units)
