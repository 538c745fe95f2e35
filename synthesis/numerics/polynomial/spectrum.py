"""Eigenvalues of a matrix of rationals, whether they decay, and its linear equations, exactly."""

from __future__ import annotations

from fractions import Fraction
from math import comb, isqrt
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import whole
from synthesis.numerics.polynomial.positive import hurwitz
from synthesis.numerics.polynomial.transfer import characteristic


def decays(A: Array, sampled: bool) -> bool:
    """Whether all eigenvalues of a matrix (n, n) of rationals have negative real parts; `sampled`:
    moduli below one.
    """
    c = polynomial(A)
    if not sampled:
        return hurwitz(c)
    n = len(c) - 1
    # z = (1 + w)/(1 - w), times (1 - w)^n
    found = [0] * (n + 1)
    for k, value in enumerate(c):
        for i in range(k + 1):
            for j in range(n - k + 1):
                found[i + j] += value * comb(k, i) * comb(n - k, j) * (-1) ** j
    return hurwitz(found)


def polynomial(A: Array) -> list[int]:
    """Return the coefficients, ascending, of det(s - A) times a positive number."""
    above, below = whole(np.asarray(A, dtype=object))
    c, n = characteristic(above), len(above)
    # det(s - M/d) d^n = det(s d - M)
    return [v * below**k for k, v in enumerate(c)] if n else [1]


def solve(left: Array, right: Array) -> Array | None:
    """Return X with left X = right, of rationals, by Gauss and Jordan; None where `left` is
    singular.
    """
    n = len(left)
    work = np.array(
        [[Fraction(v) for v in row] for row in np.hstack([left, right]).tolist()], dtype=object
    )
    for i in range(n):
        pivot = next((k for k in range(i, n) if work[k, i]), None)
        if pivot is None:
            return None
        work[[i, pivot]] = work[[pivot, i]]
        work[i] = work[i] / work[i, i]
        for k in range(n):
            if k != i and work[k, i]:
                work[k] = work[k] - work[k, i] * work[i]
    return work[:, n:]


def below_root(x: Any, bits: int = 60) -> Fraction:
    """Return a rational whose square is at most x >= 0, to about so many bits."""
    own = Fraction(x)
    scale = 1 << (bits + max(0, own.denominator.bit_length() - own.numerator.bit_length()))
    return Fraction(isqrt(own.numerator * scale * scale // own.denominator), scale)
