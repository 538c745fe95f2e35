"""A number as data has it: value, unit, where it was published."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from symheli.errors import InputError, UnknownNameError
from symheli.values.units import dimension, to_si, units_of

KEYS = ("value", "unit", "source", "assumed", "ref")
"""What an entry of a data file may say."""


class Quantity(NamedTuple):
    """A value in SI, its SI unit, where it was published, whether it is an assumption (`source`
    then says why), and the name of the entry it is taken from where it has no value of its own.
    """

    value: float
    unit: str
    source: str
    assumed: bool = False
    ref: str = ""


def read_quantity(where: str, table: Any, unit: str) -> Quantity:
    """A quantity from `{ value = ..., unit = ..., source = ... }`, converted to `unit`.

    `where` begins the message of every `InputError`: file, line and entry.
    """
    if not isinstance(table, Mapping):
        raise InputError(
            f"{where}: a bare number has no unit: write {{ value = {table}, unit = {unit!r}, source"
            " = ... }"
        )
    for key in table:
        if key not in KEYS:
            raise InputError(f"{where}: {UnknownNameError('key', key, KEYS)}")
    value, given = table.get("value"), table.get("unit")
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number as value, got {value!r}")
    if given is None:
        raise InputError(f"{where}: the unit is missing: expected unit = {unit!r}{_others(unit)}")
    try:
        factor = to_si(str(given))[0]
        powers = dimension(str(given))
    except UnknownNameError as error:
        raise InputError(f"{where}: {_misspelt(str(given), float(value), unit)}") from error
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    if powers != dimension(unit):
        raise InputError(
            f"{where}: expected {unit}{_others(unit)}, got {value} {given}, which is another kind"
            " of quantity"
        )
    if not isinstance(table.get("assumed", False), bool):
        raise InputError(f"{where}: assumed must be true or false, got {table['assumed']!r}")
    if not table.get("source"):
        raise InputError(
            f"{where}: every number needs a source; of an assumed one (assumed = true) the source"
            " says why this value"
        )
    return Quantity(
        factor * float(value), unit, str(table["source"]), bool(table.get("assumed", False))
    )


def _others(unit: str) -> str:
    names = [u for u in units_of(dimension(unit)) if u != unit]
    return f" (or {', '.join(names)})" if names else ""


def _misspelt(given: str, value: float, unit: str) -> str:
    """The nearest unit of the right kind, with the value it would give."""
    near = difflib.get_close_matches(given, units_of(dimension(unit)), n=1, cutoff=0.4)
    start = f"unknown unit {given!r}; expected {unit}{_others(unit)}"
    if not near:
        return start
    factor = to_si(near[0])[0]
    return f"{start}; did you mean {near[0]!r}" + (
        f", {value:g} {near[0]} = {factor * value:.6g} {unit}?" if near[0] != unit else "?"
    )
