"""Content of a log, before its columns are assigned to signals."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

from symheli.logs.column import Column
from symheli.logs.format import format_named, format_of


@dataclass(frozen=True, eq=False)
class Contents:
    """Every column of numbers of a log ("mapped": the signals of a map) by its name; `step` is an
    estimate of the sample period (s) where the log has no clock but gives itself away, else None.
    """

    format: str
    columns: Mapping[str, Column]
    step: float | None = None


def contents_of(path: str | os.PathLike[str], format: str | None = None) -> Contents:
    """Return the content of a log of this format (default: recognised by its first bytes).

    Raises `InputError` for a file that is no such log.
    """
    return format_named(format or format_of(path)).contents(path)
