"""Content of a log, before its columns are assigned to signals."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from symheli.logs.blackbox import blackbox_columns
from symheli.logs.column import Column
from symheli.logs.csv import csv_columns
from symheli.logs.dataflash import dataflash_columns
from symheli.logs.format import Format, format_of
from symheli.logs.mat import mat_columns
from symheli.logs.ulog import ulog_columns
from symheli.logs.xplane import xplane_columns


@dataclass(frozen=True, eq=False)
class Contents:
    """Every column of numbers of a log ("mapped": the signals of a map) by its name; `step` is an
    estimate of the sample period (s) where the log has no clock but gives itself away, else None.
    """

    format: Format | Literal["mapped"]
    columns: Mapping[str, Column]
    step: float | None = None


def contents_of(path: str | os.PathLike[str], format: Format | None = None) -> Contents:
    """Return the content of a log of this format (default: recognised by its first bytes).

    Raises `InputError` for a file that is no such log.
    """
    kind = format or format_of(path)
    match kind:
        case "xplane":
            return Contents(kind, *xplane_columns(path))
        case "ulog":
            return Contents(kind, ulog_columns(path))
        case "dataflash":
            return Contents(kind, dataflash_columns(path))
        case "blackbox":
            return Contents(kind, blackbox_columns(path))
        case "mat":
            return Contents(kind, mat_columns(path))
    return Contents(kind, csv_columns(path))
