"""Text tables: recognition of the separator, the decimal sign and the line of names."""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.logs.files import text
from symheli.values.units import to_si

SEPARATORS = {"\t": "tab", "|": "bar", ";": "semicolon", ",": "comma", " ": "blanks"}
"""Separators in the order in which they are tried: those that also occur in names and numbers come
last.
"""

LOOKED_AT = 20
"""Rows that decide on the separator."""

MISSING = {"", "na", "n/a", "nan", "-nan", "null", "none", "#n/a"}
"""Cells (lower case) of a missing sample."""


@dataclass(frozen=True, eq=False)
class SeparatedTable:
    """The names in the header of a table and its rows of cells, without blanks around them; every
    row as long as the header.

    `separator` one of `SEPARATORS`. Lines that begin with # are comments, unless the last of them
    above the numbers is the header.
    """

    path: str
    header: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    separator: str

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> SeparatedTable:
        """Read the table; raise `InputError` with the reason where the file is no table: no header,
        no rows, or the row that does not fit.
        """
        lines = [line for line in text(path).splitlines() if line.strip()]
        first = next(
            (i for i, line in enumerate(lines) if not line.lstrip().startswith("#")), len(lines)
        )
        comments, lines = (
            lines[:first],
            [line for line in lines[first:] if not line.lstrip().startswith("#")],
        )
        if lines and comments and _numeric(lines[0]):
            lines.insert(0, comments[-1].lstrip("# \t"))
        if not lines:
            raise InputError(
                f"{path}: nothing but comments; expected a line of names, then rows of numbers"
            )
        if _numeric(lines[0]):
            raise InputError(
                f"{path}: the first line holds numbers, {lines[0].strip()[:40]!r}; expected the"
                " names of the columns there"
            )
        try:
            separator = _separator(lines[: LOOKED_AT + 1])
            header, *rows = _split(lines, separator)
        except csv.Error as error:
            raise InputError(
                f"{path}: not a table: {error}; is a quotation mark left open?"
            ) from error
        width = len(header)
        for number, row in enumerate(rows, start=1):
            if any(row[width:]):
                raise InputError(
                    f"{path}: not a table: row {number} has {len(row)} cells, the header {width}"
                    f" names (separator: {SEPARATORS[separator]})"
                    + (
                        "; a comma cannot be both separator and decimal sign"
                        if separator == ","
                        else ""
                    )
                )
        if not rows:
            raise InputError(f"{path}: a header but no rows")
        return cls(
            os.fspath(path),
            tuple(header),
            [(row + [""] * (width - len(row)))[:width] for row in rows],
            separator,
        )

    @cached_property
    def _declared(self) -> dict[str, tuple[str, str]]:
        """The whole name and the unit of columns with a unit in the header, by bare name."""
        found = [(whole, declared) for whole in self.header if (declared := _with_unit(whole))]
        bare = [name for _, (name, _) in found]
        return {
            name: (whole, unit)
            for whole, (name, unit) in found
            if bare.count(name) == 1 and name not in self.header
        }

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column that has it in the header, by name without it."""
        return {name: unit for name, (_, unit) in self._declared.items()}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns in order, by their names without units."""
        bare = {whole: name for name, (whole, _) in self._declared.items()}
        return tuple(bare.get(whole, whole) for whole in self.header)

    def columns(self, names: Iterable[str]) -> dict[str, np.ndarray]:
        """Return the named columns as numbers (n,), NaN where a cell is empty; "q" finds "q
        [rad/s]" too.

        A comma in numbers is the decimal sign where it does not separate. Raises `UnknownNameError`
        for a name the header lacks, `InputError` for one that stands there twice and for the first
        cell that is no number.
        """
        names = list(dict.fromkeys(names))
        index: dict[str, int] = {}
        for name in names:
            whole = name if name in self.header else self._declared.get(name, ("",))[0]
            if self.header.count(whole) > 1:
                raise InputError(
                    f"{self.path}: {self.header.count(whole)} columns are called {name!r}; rename"
                    " them, so that it is clear which is meant"
                )
            if whole not in self.header:
                raise UnknownNameError("column", name, self.names)
            index[name] = self.header.index(whole)
        cells = {name: [row[i] for row in self.rows] for name, i in index.items()}
        comma = self.separator != "," and any("," in c for column in cells.values() for c in column)
        return {name: self._numbers(name, column, comma) for name, column in cells.items()}

    def _numbers(self, name: str, cells: Sequence[str], comma: bool) -> np.ndarray:
        out = np.empty(len(cells))
        for i, cell in enumerate(cells):
            value = _number(cell, comma)
            if value is None:
                mixed = (
                    "; the decimal sign is a comma elsewhere in this file"
                    if comma and _number(cell, False) is not None
                    else "; leave the cell of a missing sample empty"
                )
                raise InputError(
                    f"{self.path}: column {name!r}, row {i + 1}: expected a number, got"
                    f" {cell!r}{mixed}"
                )
            out[i] = value
        return out


def _with_unit(name: str) -> tuple[str, str] | None:
    """Return name and unit of "q [rad/s]" or "q (rad/s)"; None where the brackets hold no unit, or
    an index (xyz[1]; "n [1]" is a unit).
    """
    match = re.fullmatch(r"(.*\S)(\s*)(?:\[([^][]+)\]|\(([^()]+)\))", name)
    if match is None:
        return None
    unit = (match[3] or match[4]).strip()
    if unit.isdigit() and not match[2]:
        return None
    try:
        to_si(unit)
    except InputError:
        return None
    return match[1], unit


def _number(cell: str, comma: bool) -> float | None:
    """The number of a cell, None where it is none; with a decimal `comma` a point is no part of a
    number.
    """
    if cell.lower() in MISSING:
        return float("nan")
    if "_" in cell or (comma and "." in cell):
        return None
    try:
        return float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return None


def _numeric(line: str) -> bool:
    """Whether every cell of a line is a number, however it is separated."""
    cells = line.replace(";", " ").replace(",", " ").split()
    return bool(cells) and all(_number(cell, False) is not None for cell in cells)


def _separator(lines: Sequence[str]) -> str:
    """The one that gives the header two names or more and every row as many cells; else that which
    gives the header most.
    """
    widths = {s: [len(row) for row in _split(lines, s)] for s in SEPARATORS}
    for separator, (header, *rows) in widths.items():
        if header > 1 and all(row == header for row in rows):
            return separator
    return max((s for s in widths if s != " "), key=lambda s: (widths[s][0], s == ","))


def _split(lines: Iterable[str], separator: str) -> list[list[str]]:
    if separator == " ":
        return [line.split() for line in lines]
    return [
        [cell.strip() for cell in row]
        for row in csv.reader(lines, delimiter=separator, skipinitialspace=True)
    ]
