"""A number as data has it: value, unit, where it was published."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from symheli.errors import InputError, UnknownNameError
from symheli.values.units import dimension, to_si, units_of

KEYS = ("value", "unit", "deviation", "source", "assumed", "unusual", "ref")
"""Permitted keys of an entry of a data file."""


class Quantity(NamedTuple):
    """A value in SI, its SI unit, its source, whether it is an assumption (`source` then gives the
    reason), and the name of the entry it is taken from where it has no value of its own.

    `unusual`: meant although no other airframe has it. `given`: the unit it was written in.
    `deviation`: standard deviation of its error, SI; 0 where none is stated.
    """

    value: float
    unit: str
    source: str
    assumed: bool = False
    ref: str = ""
    unusual: bool = False
    given: str = ""
    deviation: float = 0.0


def read_quantity(where: str, table: Any, unit: str) -> Quantity:
    """A quantity from `{ value = ..., unit = ..., source = ... }`, converted to `unit`.

    `where` begins the message of the `InputError`, which says everything that is wrong with it.
    """
    if not isinstance(table, Mapping):
        raise InputError(
            f"{where}: a bare number has no unit: write {{ value = {table}, unit = {unit!r}, source"
            " = ... }"
        )
    value, given = table.get("value"), table.get("unit")
    wrong = [str(UnknownNameError("key", key, KEYS)) for key in table if key not in KEYS]
    number = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value)
    if not math.isfinite(number):
        wrong.append(f"expected a finite number as value, got {value!r}")
    factor = 1.0
    if given is None:
        wrong.append(f"the unit is missing: expected unit = {unit!r}{_others(unit)}")
    else:
        try:
            factor = to_si(str(given), unit)[0]
            if dimension(str(given), unit) != dimension(unit):
                wrong.append(
                    f"expected {unit}{_others(unit)}, got {value} {given}, which is another kind"
                    " of quantity"
                )
        except UnknownNameError:
            wrong.append(_misspelt(str(given), number, unit))
        except InputError as error:
            wrong.append(str(error))
    deviation = table.get("deviation", 0.0)
    if isinstance(deviation, bool) or not isinstance(deviation, int | float):
        deviation = math.nan
    if not 0.0 <= deviation < math.inf:
        wrong.append(
            "expected a standard deviation >= 0 in the unit of the value, got"
            f" {table['deviation']!r}"
        )
    for key in ("assumed", "unusual"):
        if not isinstance(table.get(key, False), bool):
            wrong.append(f"{key} must be true or false, got {table[key]!r}")
    if not table.get("source"):
        wrong.append(
            "every number needs a source; of an assumed one (assumed = true) the source says why"
            " this value"
        )
    if wrong:
        raise InputError(f"{where}: {'; '.join(wrong)}")
    return Quantity(
        factor * number,
        unit,
        str(table["source"]),
        bool(table.get("assumed", False)),
        unusual=bool(table.get("unusual", False)),
        given=str(given),
        deviation=abs(factor) * float(deviation),
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
    factor = to_si(near[0], unit)[0]
    return f"{start}; did you mean {near[0]!r}" + (
        f", {value:g} {near[0]} = {factor * value:.6g} {unit}?"
        if near[0] != unit and math.isfinite(value)
        else "?"
    )
