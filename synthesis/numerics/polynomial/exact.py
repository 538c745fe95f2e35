"""Exact rational arithmetic on the doubles of a model and of a proof."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

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
    """Whether the symmetric matrices (..., n, n) of integers or rationals are all positive
    definite; only their lower triangles are read.

    Shown by a congruence with rounded numbers that leaves nearly the identity, where that is
    strictly dominant in its diagonal: a few products of integers. Else all pivots of an elimination
    decide, whose numbers grow with every row.
    """
    own = _mirrored(integers(M).reshape(math.prod(M.shape[:-2]), *M.shape[-2:]))
    if own.shape[-1] <= MAX_DIRECT_ROWS:
        return all(map(_pivots_are_positive, own))
    for each, R in zip(own, _congruences(own), strict=True):
        if not ((R is not None and _dominant(each, R)) or _pivots_are_positive(each)):
            return False
    return True


MAX_DIRECT_ROWS = 6
"""Number of rows up to which the exact elimination is as fast as the congruence."""
CONGRUENCE_BITS = 50
"""Number of bits to which the entries of the congruence are rounded."""
FLOAT_BITS = 900
"""Number of bits beyond which integers are divided by a power of two before they become doubles."""


def integers(values: Array) -> Array:
    """Return integers or rationals (...) as integers, all times the same positive number."""
    flat = values.ravel().tolist()
    if set(map(type, flat)) != {int}:
        parts = [(int(v.numerator), int(v.denominator)) for v in flat]
        common = math.lcm(*{below for _, below in parts})
        flat = [above * (common // below) for above, below in parts]
    out = np.empty(len(flat), dtype=object)
    out[:] = flat
    return out.reshape(values.shape)


def nearest(whole: Array) -> Array:
    """Return integers as doubles, all times the same power of two where they are large."""
    flat = whole.ravel().tolist()
    bits = max(max(flat).bit_length(), min(flat).bit_length()) if flat else 0
    unit = 1 << max(bits - FLOAT_BITS, 0)
    return np.array([v / unit for v in flat], dtype=float).reshape(whole.shape)


def _mirrored(M: Array) -> Array:
    """Return the symmetric matrices of these lower triangles."""
    out = M.copy()
    rows, columns = np.tril_indices(M.shape[-1], -1)
    out[..., columns, rows] = out[..., rows, columns]
    return out


def _congruences(own: Array) -> list[Array | None]:
    """Return for each symmetric matrix of integers the inverse of its Cholesky factor, transposed,
    in floating point; None where there is none.
    """
    rounded = nearest(own)
    size = np.diagonal(rounded, axis1=-2, axis2=-1)
    try:
        if not np.all(size > 0):
            raise np.linalg.LinAlgError
        size = 1.0 / np.sqrt(size)
        factors = np.linalg.cholesky(rounded * size[:, None] * size[:, :, None])
    except np.linalg.LinAlgError:
        if len(own) == 1:
            return [None]
        return [found for each in own for found in _congruences(each[None])]
    R = size[:, :, None] * np.swapaxes(np.linalg.inv(factors), -1, -2)
    return [each if np.all(np.isfinite(each)) else None for each in R]


def _dominant(own: Array, R: Array) -> bool:
    """Whether R' M R is strictly diagonally dominant: M is then positive definite (and R regular).
    Exact, of integers M and R rounded to `CONGRUENCE_BITS` bits.
    """
    exponents = np.frexp(np.abs(R).max(axis=0))[1]
    # R is `whole` times a power of two a column
    whole = np.rint(np.ldexp(R, CONGRUENCE_BITS - exponents)).astype(np.int64).astype(object)
    Q = whole.T @ (own @ whole)
    steps = np.array([1 << int(e) for e in exponents - exponents.min()], dtype=object)
    return bool(np.all(2 * np.diagonal(Q) * steps > (np.abs(Q) * steps).sum(axis=1)))


def _pivots_are_positive(own: Array) -> bool:
    """Whether all leading minors of a symmetric matrix of integers are positive, by Bareiss'
    elimination without fractions.
    """
    M, before = own, 1
    while len(M):
        pivot = M[0, 0]
        if not pivot > 0:
            return False
        M = (M[1:, 1:] * pivot - np.multiply.outer(M[1:, 0], M[0, 1:])) // before
        before = pivot
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
