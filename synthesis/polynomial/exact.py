"""Exact rational arithmetic on the doubles of a model and of a proof."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from scipy import linalg

Array = np.ndarray
Number = Callable[[float], Any]
"""Conversion of a double into a number of the arithmetic: `float`, or its exact rational."""


def rational() -> Number:
    """Return the conversion to exact rationals, in the fastest arithmetic installed."""
    try:
        from flint import fmpq  # type: ignore[import-not-found]
    except ImportError:
        return Fraction

    def convert(value: float) -> Any:
        return fmpq(*float(value).as_integer_ratio())

    return convert


def positive_definite(M: Array) -> bool:
    """Whether the symmetric rational matrix is positive definite; only its lower triangle is read.

    Shown by a congruence with rounded numbers that leaves nearly the identity, where that is
    strictly dominant in its diagonal: a few products of integers. Else all pivots of an LDL'
    factorisation decide, whose numbers grow with every row.
    """
    return (len(M) > MAX_DIRECT_ROWS and _dominant(M)) or _pivots_are_positive(M)


MAX_DIRECT_ROWS = 6
"""Number of rows up to which the exact factorisation is as fast as the congruence."""
CONGRUENCE_BITS = 50
"""Number of bits to which the entries of the congruence are rounded."""


def _dominant(M: Array) -> bool:
    """Whether R' M R is strictly diagonally dominant, R the rounded inverse of a Cholesky factor in
    floating point: it is then positive definite, and R regular, so that M is too. Exact.
    """
    try:
        rounded = M.astype(float)
    except OverflowError:
        return False
    size = np.diag(rounded).copy()
    if not np.all(np.isfinite(rounded)) or not np.all(size > 0):
        return False
    size = 1.0 / np.sqrt(size)
    lower = np.tril(rounded * size * size[:, None])
    try:
        factor = np.linalg.cholesky(lower + np.tril(lower, -1).T)
    except np.linalg.LinAlgError:
        return False
    R = size[:, None] * linalg.solve_triangular(factor, np.eye(len(M)), lower=True).T
    exponents = np.frexp(np.abs(R).max(axis=0))[1]
    if not np.all(np.isfinite(R)):
        return False
    # R is `whole` times a power of two a column
    whole = np.rint(np.ldexp(R, CONGRUENCE_BITS - exponents)).astype(np.int64).astype(object)
    own = _whole(M)
    Q = whole.T @ (own @ whole)
    steps = [1 << int(e) for e in exponents - exponents.min()]
    for i, row in enumerate(Q):
        others = sum(
            abs(q) * step for j, (q, step) in enumerate(zip(row, steps, strict=True)) if j != i
        )
        if not row[i] * steps[i] > others:
            return False
    return True


def _whole(M: Array) -> Array:
    """Return the symmetric matrix of this lower triangle times a factor that makes all entries
    integers.
    """
    denominators = {int(v.denominator) for v in M.ravel()}
    common = math.lcm(*denominators)
    out = np.array(
        [[int(v.numerator) * (common // int(v.denominator)) for v in row] for row in M],
        dtype=object,
    )
    rows, columns = np.tril_indices(len(M), -1)
    out[columns, rows] = out[rows, columns]
    return out


def _pivots_are_positive(M: Array) -> bool:
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


def growth_of(alpha: float, dt: float) -> float:
    """Return exp(2 alpha dt), increased by a few units in the last place: a proof with it holds for
    alpha, however exp and its argument are rounded.
    """
    if alpha == 0.0:
        return 1.0
    exponent = 2.0 * alpha * dt
    exponent += 4.0 * math.ulp(exponent)
    return math.exp(exponent) * (1.0 + 8.0 * math.ulp(1.0))


def exact(values: Any, number: Number) -> Array:
    """Return the doubles as numbers of the arithmetic."""
    values = np.asarray(values, dtype=float)
    if number is float:
        return values
    return np.asarray(np.frompyfunc(number, 1, 1)(values), dtype=object).reshape(values.shape)
