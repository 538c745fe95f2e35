"""Exact rational arithmetic on the doubles of a model and of a proof."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from symheli.values.arrays import Array

Number = Callable[[float], Any]
"""Conversion of a double into a number of the arithmetic: `float`, or its exact rational."""


def rational() -> Number:
    """Return the conversion to exact rationals."""
    return Fraction


def positive_definite(M: Array) -> bool:
    """Whether the symmetric matrices (..., n, n) of integers or rationals are all positive
    definite; only their lower triangles are read.

    Shown by a Cholesky factorisation in doubles with a bound of its rounding, where the margin
    allows; else after a congruence with rounded numbers that leaves nearly the identity; else all
    pivots of an exact elimination decide.
    """
    own = M.reshape(math.prod(M.shape[:-2]), *M.shape[-2:])
    for each in _mirrored(integers(own[~shown_positive(own)])):
        nearly_one = _congruence(each)
        shown = nearly_one is not None and shown_positive(nearly_one[None]).all()
        if not (shown or _pivots_are_positive(each)):
            return False
    return True


def shown_positive(own: Array) -> Array:
    """Whether each symmetric matrix (K, n, n) of integers or rationals is shown to be positive
    definite in doubles; False decides nothing. Only lower triangles are read.

    Rows and columns times powers of two make a matrix H with a diagonal between 1/2 and 4. Its
    entries are rounded to doubles, |h_ij| <= 4, and its diagonal is lowered by s; let u = 2^-53.
    Where the factorisation R'R of that ends, R'R differs from it by at most g/(1 - g) sqrt(h_ii
    h_jj) an entry, g = (n + 1) u/(1 - (n + 1) u), in any order of the sums. The spectral norm of
    this is below 4 n g/(1 - g), that of rounding H below 4 n u, that of lowering it 4 u. Together
    they are below s = 4 (n + 2)^2 u, by more than what underflow adds, n^2 2^-1000. So H > 0.
    Source: Rump, "Verification of positive definiteness", BIT 46 (2006).
    """
    count, n = own.shape[:2]
    good = np.full(count, n < MAX_ROWS_IN_DOUBLES and rounds_to_nearest())
    H = np.zeros(own.shape)
    for k in np.flatnonzero(good):
        try:
            H[k] = _scaled_to_one(own[k])
        except OverflowError:
            good[k] = False
    good &= (np.abs(H) <= 4.0).all(axis=(1, 2))
    H[:, range(n), range(n)] -= 4.0 * (n + 2) ** 2 * 2.0**-53
    with np.errstate(all="ignore"):
        for k in range(n):
            good &= H[:, k, k] > 0.0
            column = H[:, k + 1 :, k] / np.sqrt(H[:, k, k])[:, None]
            H[:, k + 1 :, k + 1 :] -= column[:, :, None] * column[:, None, :]
    return good


def _scaled_to_one(M: Array) -> Array:
    """Return the lower triangle of a symmetric matrix, rows and columns times powers of two, each
    entry rounded once, as a quotient of integers is. A positive diagonal is between 1/2 and 4 then:
    an a with b more bits than its divisor is between 2^(b - 1) and 2^(b + 1).
    """
    diagonal, out = np.diagonal(M).tolist(), np.zeros(M.shape)
    half = [(v.numerator.bit_length() - v.denominator.bit_length()) // 2 for v in diagonal]
    for i, row in enumerate(M.tolist()):
        for j, v in enumerate(row[: i + 1]):
            k = half[i] + half[j]
            out[i, j] = (v.numerator << max(-k, 0)) / (v.denominator << max(k, 0))
    return out


def rounds_to_nearest() -> bool:
    """Whether sums of doubles are rounded once and to nearest here, as in IEEE 754."""
    ones, u = np.array([1.0, 1.0, -1.0, -1.0]), 2.0**-53
    # a hair more than half a unit is rounded up, and half of one to even
    more = np.array([1.0, 1.0 + 2.0**-20, -1.0, -1.0 - 2.0**-20])
    return (ones + u * more).tolist() == [1.0, 1.0 + 2 * u, -1.0, -1.0 - 2 * u]


MAX_ROWS_IN_DOUBLES = 1000
"""Number of rows below which the bound of rounding covers its own rounding."""
CONGRUENCE_BITS = 50
"""Number of bits to which the entries of the congruence are rounded."""
FLOAT_BITS = 900
"""Number of bits beyond which integers are divided by a power of two before they become doubles."""


def whole(values: Array) -> tuple[Array, int]:
    """Return integers, and the positive one that they are divided by to be these integers or
    rationals (...).
    """
    flat, common = values.ravel().tolist(), 1
    if set(map(type, flat)) != {int}:
        parts = [(v.numerator, v.denominator) for v in flat]
        common = math.lcm(*{below for _, below in parts})
        flat = [above * (common // below) for above, below in parts]
    out = np.empty(len(flat), dtype=object)
    out[:] = flat
    return out.reshape(values.shape), common


def integers(values: Array) -> Array:
    """Return integers or rationals (...) as integers, all times the same positive number."""
    return whole(values)[0]


quotient = np.frompyfunc(Fraction, 2, 1)
"""Integers over integers, as rationals."""


def matmul(F: Array, G: Array) -> Array:
    """Return F @ G of doubles or rationals; of rationals by integers over one denominator, so that
    no sum is of fractions.
    """
    if F.dtype != object and G.dtype != object:
        return np.asarray(F @ G)
    (above, first), (right, second) = whole(F), whole(G)
    return np.asarray(quotient(above @ right, first * second), dtype=object)


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


def _congruence(M: Array) -> Array | None:
    """Return R' M R for a symmetric matrix of integers and the inverse R of its Cholesky factor,
    transposed, rounded to `CONGRUENCE_BITS` and a power of two a column, in integers; None where
    there is none. Where it is positive definite, R is regular and M is too.
    """
    rounded = nearest(M)
    if not np.all(np.diagonal(rounded) > 0):
        return None
    size = 1.0 / np.sqrt(np.diagonal(rounded))
    try:
        factor = np.linalg.cholesky(rounded * size[:, None] * size)
    except np.linalg.LinAlgError:
        return None
    R = size[:, None] * np.linalg.inv(factor).T
    if not np.all(np.isfinite(R)):
        return None
    exponents = np.frexp(np.abs(R).max(axis=0))[1]
    near = np.rint(np.ldexp(R, CONGRUENCE_BITS - exponents)).astype(np.int64).astype(object)
    return np.asarray(near.T @ (M @ near))


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
