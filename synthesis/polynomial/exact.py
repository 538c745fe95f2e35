"""Exact rational arithmetic on the doubles of a model and of a proof."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

Array = np.ndarray
Number = Callable[[float], Any]
"""Turns a double into a number of the arithmetic: `float`, or the rational it is."""


def rational() -> Number:
    """The exact rational of a double, in the fastest arithmetic installed."""
    try:
        from flint import fmpq  # type: ignore[import-not-found]
    except ImportError:
        return Fraction

    def convert(value: float) -> Any:
        return fmpq(*float(value).as_integer_ratio())

    return convert


def positive_definite(M: Array) -> bool:
    """Whether the symmetric rational matrix is positive definite: all pivots of its LDL'
    factorisation positive.
    """
    M = M.copy()
    for k in range(len(M)):
        pivot = M[k, k]
        if not pivot > 0:
            return False
        for i in range(k + 1, len(M)):
            if M[i, k] != 0:
                factor = M[i, k] / pivot
                for j in range(k + 1, i + 1):
                    M[i, j] = M[i, j] - factor * M[j, k]
    return True


def exact(values: Any, number: Number) -> Array:
    """The doubles as numbers of the arithmetic."""
    values = np.asarray(values, dtype=float)
    if number is float:
        return values
    return np.asarray(np.frompyfunc(number, 1, 1)(values), dtype=object).reshape(values.shape)
