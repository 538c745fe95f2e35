"""Single numbers that are checked when they come in."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from typing import Any

from symheli.errors import InputError


def whole(value: Any, name: str, least: int = 0) -> int:
    """The value as an int; raises `InputError` unless it is a whole number >= `least`."""
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if number < least or isinstance(value, bool):
        raise InputError(f"{name}: expected a whole number >= {least}, got {value!r:.80}")
    return number


def finite(value: Any, name: str, unit: str = "") -> float:
    """The value as a float; raises `InputError` unless it is one finite number."""
    try:
        number = math.nan if isinstance(value, str) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(
            f"{name}: expected a finite number{unit and f' of {unit}'}, got {value!r:.80}"
        )
    return number


def by_name(value: Any, name: str, shape: str) -> Mapping[Any, Any]:
    """The value; raises `InputError` unless it is a mapping, of the `shape` that is shown."""
    if not isinstance(value, Mapping):
        raise InputError(f"{name}: expected {shape}, got {value!r:.80}")
    return value


def positive(value: Any, name: str, *, or_zero: bool = False) -> float:
    """The value as a float; raises `InputError` unless it is finite and > 0, or 0 if asked."""
    try:
        number = math.nan if isinstance(value, str | bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and (number > 0 or (or_zero and number == 0))):
        raise InputError(f"{name}: expected a number >{'=' * or_zero} 0, got {value!r:.80}")
    return number
