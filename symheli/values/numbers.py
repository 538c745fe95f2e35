"""Single numbers that are checked when they come in."""

from __future__ import annotations

import operator
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
