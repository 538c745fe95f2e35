"""Numbers with their units, as JSON can hold them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any


def value(number: float, unit: str) -> dict[str, Any]:
    """{"value", "unit"}; infinite and undefined numbers as the strings "inf", "-inf", "nan" (JSON
    has none).
    """
    return {"value": _number(number), "unit": unit}


def values(numbers: Iterable[float], unit: str) -> dict[str, Any]:
    """{"value", "unit"} of many."""
    return {"value": [_number(number) for number in numbers], "unit": unit}


def named(numbers: Mapping[Any, float], unit: str) -> dict[str, Any]:
    """One `value` a signal."""
    return {str(name): value(number, unit) for name, number in numbers.items()}


def _number(number: float) -> float | str:
    number = float(number)
    return number if math.isfinite(number) else str(number)
