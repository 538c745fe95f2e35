"""Checks of the form of a proof before any inequality is checked: each returns the fault in words,
None where there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array


def first(*faults: str | None) -> str | None:
    """Return the first fault, None where there is none."""
    return next((fault for fault in faults if fault), None)


def numbers(values: Any, name: str) -> Array:
    """Return a read-only array of doubles. Raises `InputError` where `values` are something
    else.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: expected an array of numbers, got {values!r:.60}") from None
    array.flags.writeable = False
    return array


def ascending(knots: Array, name: str = "knots") -> str | None:
    """Check that there are two finite knots or more, each larger than the one before."""
    if (
        knots.ndim != 1
        or len(knots) < 2
        or not np.all(np.isfinite(knots))
        or not np.all(np.diff(knots) > 0)
    ):
        return f"{name} must be two or more finite numbers in ascending order, got {knots}"
    return None


def covering(knots: Array, low: float, high: float, name: str = "p") -> str | None:
    """Check that the knots reach from one end of the range to the other."""
    if knots[0] != low or knots[-1] != high:
        return (
            f"P is known for {name} in [{knots[0]:.6g}, {knots[-1]:.6g}], the model holds on"
            f" [{low:.6g}, {high:.6g}]"
        )
    return None


def whole(value: Any, least: int, name: str) -> str | None:
    """Check for an integer of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        return f"{name} must be an integer >= {least}, got {value!r:.60}"
    return None


def symmetric(
    coefficients: Array, shape: Sequence[int], name: str = "Lyapunov coefficients"
) -> str | None:
    """Check for finite matrices, exactly symmetric, in an array of this shape."""
    if coefficients.shape != tuple(shape):
        return f"expected {name} of shape {tuple(shape)}, got {coefficients.shape}"
    if not np.all(np.isfinite(coefficients)):
        return f"{name} must be finite"
    if not np.array_equal(coefficients, np.swapaxes(coefficients, -1, -2)):
        return f"{name} must be symmetric: x'Px does not see a skew part"
    return None


def coordinates(left: Any, right: Any, units: Sequence[Any], size: int) -> str | None:
    """Check that `left` and `right` (size, size) are inverse to each other, and every one of the
    `units` a finite number > 0.
    """
    try:
        left, right, sizes = numbers(left, "left"), numbers(right, "right"), numbers(units, "units")
    except InputError as error:
        return str(error)
    if (
        left.shape != (size, size)
        or right.shape != (size, size)
        or not np.all(np.isfinite([*left.ravel(), *right.ravel(), *sizes]))
    ):
        return f"coordinates must be finite matrices of shape {(size, size)}"
    # 1e-3: far above what inverting loses, and enough for `right` to be regular
    if not np.all(sizes > 0) or np.abs(left @ right - np.eye(size)).max(initial=0.0) > 1e-3:
        return "coordinates need units > 0 and left = right^-1"
    return None
