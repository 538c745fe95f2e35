"""Columns with names and units as text for spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

from symheli.values.arrays import Array
from symheli.values.signal import Signal


def comma_separated(columns: Iterable[tuple[Signal, Array | Sequence[float]]]) -> str:
    """One column a signal, all as long: the first line names them, the second gives their units;
    numbers to the last bit.
    """
    columns = list(columns)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([str(name) for name, _ in columns])
    writer.writerow([name.unit for name, _ in columns])
    for row in zip(*(values for _, values in columns), strict=True):
        writer.writerow([int(v) if float(v).is_integer() else float(v) for v in row])
    return out.getvalue()
