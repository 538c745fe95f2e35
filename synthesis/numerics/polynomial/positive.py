"""Polynomials of one variable with integer coefficients: where they are positive, and whether all
roots lie left of the axis. Exact: nothing here is rounded the unsafe way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from typing import Any

import numpy as np

from symheli.values.arrays import Array

Number = Any
"""An integer or a rational."""
Coefficients = Sequence[Any] | Array
"""Coefficients of a polynomial, ascending."""

BITS = 600
"""Bits that Bernstein coefficients keep as an interval is halved; what is cut off is rounded down.
"""
DEPTH = 200
"""Largest number of halvings of one interval."""
CELLS = 4000
"""Largest number of intervals examined; beyond it nothing more is shown."""


def product(*factors: Coefficients) -> Array:
    """Return the coefficients of a product, ascending."""
    return reduce(np.convolve, (np.array([*f], dtype=object) for f in factors))


def bernstein(c: Coefficients, low: Number, high: Number | None, pace: Number = 1) -> Array:
    """Return the Bernstein coefficients on [low, high], times a positive number, of the polynomial
    with the coefficients c, ascending.

    `high` None: on [low, inf], as a function of u in x = low + pace u/(1 - u), times (1 - u)^n.
    """
    n = len(c) - 1
    a = Fraction(low)
    above, below = a.numerator, a.denominator
    # q^n p((x q + above)/q) as a polynomial in x
    row = [int(v) * below ** (n - k) for k, v in enumerate(c)]
    for i in range(n):
        for k in range(n - 1, i - 1, -1):
            row[k] += above * row[k + 1]
    width = Fraction(pace if high is None else Fraction(high) - a) * below
    common = math.lcm(*(math.comb(n, k) for k in range(n + 1)))
    up, down = width.numerator, width.denominator
    out = [v * up**k * down ** (n - k) * (common // math.comb(n, k)) for k, v in enumerate(row)]
    if high is not None:
        for i in range(n):
            for k in range(n, i, -1):
                out[k] += out[k - 1]
    return np.array(out, dtype=object)


def positive_until(b: Array, depth: int = DEPTH) -> Fraction:
    """Return the largest u found with the polynomial of these Bernstein coefficients on [0, 1] (n +
    1,) positive on all of [0, u]: 1 where it is positive everywhere, -1 where it is not at 0.
    """
    waiting, reached = [(_cut(b), Fraction(0), 0)], Fraction(-1)
    for _ in range(CELLS):
        b, left, deep = waiting.pop()
        if not b[0] > 0:
            return reached
        reached = left
        if all(v > 0 for v in b):
            reached = left + Fraction(1, 1 << deep)
            if not waiting:
                return reached
            continue
        if deep == depth:
            return reached
        first, second = halves(b)
        deep += 1
        waiting += [(second, left + Fraction(1, 1 << deep), deep), (first, left, deep)]
    return reached


def positive(c: Coefficients, low: Number, high: Number | None, pace: Number = 1) -> bool:
    """Whether the polynomial is shown to be positive on [low, high]; to infinity (`high` None) the
    coefficient of its degree counts too.
    """
    return positive_until(bernstein(c, low, high, pace)) == 1


def halves(b: Array) -> tuple[Array, Array]:
    """Return lower bounds, coefficient by coefficient, of the Bernstein coefficients on both
    halves, each times a positive number: de Casteljau's algorithm, cut to `BITS`.
    """
    n = len(b) - 1
    left, right, row = b.copy(), b.copy(), b
    for k in range(n + 1):
        left[k], right[n - k] = row[0] << (n - k), row[-1] << (n - k)
        row = row[1:] + row[:-1]
    return _cut(left), _cut(right)


def _cut(b: Array) -> Array:
    """Divide by a power of two, rounding down, where the largest has more than `BITS`."""
    spare = max(max(b).bit_length(), min(b).bit_length()) - BITS
    return b >> spare if spare > 0 else b


def hurwitz(c: Coefficients) -> bool:
    """Whether all roots of the polynomial with these coefficients, ascending, of degree len(c) - 1,
    have negative real parts: Routh's scheme without fractions.
    """
    c = [int(v) for v in c]
    if not c or c[-1] == 0:
        return False
    if c[-1] < 0:
        c = [-v for v in c]
    above, row = c[::-1][0::2], c[::-1][1::2]
    while row:
        if not row[0] > 0:
            return False
        padded = [*row, *[0] * (len(above) - len(row))]
        after = [row[0] * a - above[0] * b for a, b in zip(above[1:], padded[1:], strict=True)]
        common = math.gcd(*after) or 1
        above, row = row, [v // common for v in after]
    return True
