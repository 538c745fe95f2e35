"""Directions in which a symmetric matrix is not positive, exactly."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import integers, nearest

DIGITS = 2**20
"""Entries of a direction in doubles are rounded to so many parts of the largest one."""


def not_positive(M: Array) -> tuple[Any, Array] | None:
    """Return (x' M x, x) with x' M x <= 0 and x not zero, of a symmetric matrix (n, n) of integers
    or rationals, in exact arithmetic; None where M is positive definite.

    The value is zero only where M is positive semidefinite. A direction of few digits is tried
    first, that of the least eigenvalue, in units in which the diagonal is one.
    """
    whole = integers(M)
    x = _eliminated(whole)
    if x is None:
        return None
    near = _rounded(whole)
    if near is not None and near @ whole @ near < 0:
        x = near
    return x @ M @ x, x


def _rounded(M: Array) -> Array | None:
    numbers = nearest(M)
    size = np.sqrt(np.abs(np.diagonal(numbers)))
    size = np.where(size > 0, size, 1.0)
    with np.errstate(all="ignore"):
        scaled = numbers / size[:, None] / size
        if not np.all(np.isfinite(scaled)):
            return None
        x = np.linalg.eigh(scaled)[1][:, 0] / size
        x = np.rint(x / np.abs(x).max() * DIGITS)
    return np.array([Fraction(int(v), DIGITS) for v in x], dtype=object)


def _eliminated(M: Array) -> Array | None:
    """Return x with x' M x < 0, or = 0 where no direction is below; None: positive definite.

    By an elimination M = L D L': where a pivot is d, L' x = e_k has x' M x = d.
    """
    n = len(M)
    own = np.array([[Fraction(v) for v in row] for row in M.tolist()], dtype=object)
    T = np.array([[Fraction(i == j) for j in range(n)] for i in range(n)], dtype=object)
    flat = None
    for k in range(n):
        # own = T' M T, its first k rows and columns diagonal
        pivot = own[k, k]
        if pivot < 0:
            return T[:, k]
        if pivot == 0:
            coupled = [j for j in range(k + 1, n) if own[k, j] != 0]
            if coupled:
                j = coupled[0]
                t = -(abs(own[j, j]) + 1) / (2 * own[k, j])
                return T[:, k] * t + T[:, j]
            flat = T[:, k] if flat is None else flat
            continue
        factors = own[k, k + 1 :] / pivot
        own[k + 1 :, k + 1 :] -= np.multiply.outer(factors, own[k, k + 1 :])
        own[k, k + 1 :] = own[k + 1 :, k] = Fraction(0)
        T[:, k + 1 :] -= np.multiply.outer(T[:, k], factors)
    return flat
