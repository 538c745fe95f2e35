"""Repeat a search in the scale of the bound that it found."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

from synthesis.certify.statement.scaling import NEGLIGIBLE_GAIN

MAX_SCALE_RATIO = 100.0
"""Ratio of a bound to the scale in which it was found beyond which it is computed again in a new
scale.
"""


MAX_RESCALINGS = 3
"""Largest number of changes of scale."""


T = TypeVar("T")


def in_its_own_scale(found: Callable[[float], tuple[T, float, float]], expected: float) -> list[T]:
    """Return the result of `found(expected)`, (result, bound, scale it was found in); again in the
    scale of the bound while that is far off.

    The frozen gain is a scale that no search changes, but a moving p may have a gain of another
    order.
    """
    results: list[T] = []
    least = 0.0
    for _ in range(1 + MAX_RESCALINGS):
        result, bound, scale = found(expected)
        results.append(result)
        least = least or NEGLIGIBLE_GAIN * scale
        if (
            not least < bound < math.inf
            or scale / MAX_SCALE_RATIO < bound < scale * MAX_SCALE_RATIO
        ):
            break
        expected = bound
    return results
