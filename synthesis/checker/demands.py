"""What a proof demands: symmetric matrices of polynomials that are positive definite; where the
first of them is not, and by how much.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from .exact import shortfall, shown
from .polynomials import Box, Polynomial, Whole, first_miss

LARGEST_FACTOR = 1e6
"""Largest factor on a claimed bound by which one is looked for that would hold at a point."""


class Demand(NamedTuple):
    """`matrix` is positive definite on the part of the unit box that is `reached`.

    `name` is the inequality in words. Where it rests on a bound, `with_bound` makes it of another
    one; `place` says in words where a point is.
    """

    name: str
    matrix: Polynomial
    place: Callable[[Sequence[Fraction]], str] = lambda point: ""
    reached: Callable[[Box], bool] = lambda box: True
    with_bound: Callable[[Fraction], Polynomial] | None = None


class Claim(NamedTuple):
    """What a file claims: sentences made from its numbers, and the demands that prove it; `refused`
    says why it cannot be proven before any demand is looked at.
    """

    claim: str
    hypotheses: tuple[str, ...]
    demands: Iterable[Demand]
    bound: Fraction | None = None
    rising: bool = True
    refused: str = ""


def failure(claim: Claim) -> str:
    """Return where the first demand fails and by how much, in a sentence; nothing where all hold."""
    if claim.refused:
        return claim.refused
    for demand in claim.demands:
        miss = first_miss(demand.matrix, demand.reached)
        if miss is None:
            continue
        where = demand.place(miss.point)
        where = f" at {where}" if where else ""
        if not miss.false:
            return f"{demand.name}: not decided within the boxes that are looked at, near{where[3:]}"
        short = shortfall(Whole.of(demand.matrix.at(miss.point)).rows)
        said = (
            f"{demand.name}: the matrix is not positive definite{where}; {short:.3g} of its own"
            " diagonal must be added to make it so"
        )
        return said + _needed(claim, demand, miss.point)
    return ""


def _needed(claim: Claim, demand: Demand, point: Sequence[Fraction]) -> str:
    """Return which bound would do at this point."""
    bound, made = claim.bound, demand.with_bound
    if bound is None or made is None:
        return ""

    def enough(trial: float) -> bool:
        return shown(Whole.of(made(Fraction(trial)).at(point)).rows)

    start = float(bound)
    low = start
    if claim.rising:
        high = start or 1e-12
        while not enough(high) and high < LARGEST_FACTOR * max(start, 1e-12):
            low, high = high, 1.5 * high
        if not enough(high):
            return "; no larger bound would make it so"
    else:
        high = 0.0
        if not enough(high):
            return "; no smaller rate would make it so"
    while abs(high - low) > 1e-9 * abs(start):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return f"; there it takes {'at least' if claim.rising else 'at most'} {high:.9g}"


def exponential_above(x: Fraction) -> Fraction:
    """Return a number not below exp(x), x >= 0, and larger by less than 1e-25 of it."""
    return _exponential(x)[1]


def exponential_below(x: Fraction) -> Fraction:
    """Return a number not above exp(x), x >= 0."""
    return _exponential(x)[0]


def _exponential(x: Fraction) -> tuple[Fraction, Fraction]:
    """Return limits of exp(x), x >= 0: the squares of those of a fraction of x below 1/2, each a
    part of the series and all that is left of it, rounded outwards.
    """
    halvings = max(0, (2 * x.numerator // x.denominator).bit_length())
    if halvings > 20:
        raise OverflowError("an exponential that is too large")
    y = x / (1 << halvings)
    term, total, count = Fraction(1), Fraction(1), 0
    while term > Fraction(1, 1 << 140):
        count += 1
        term = term * y / count
        total += term
    unit = 1 << 160
    low = Fraction(math.floor(total * unit), unit)
    high = Fraction(math.ceil((total + 2 * term) * unit), unit)
    for _ in range(halvings):
        low = Fraction(math.floor(low * low * unit), unit)
        high = Fraction(math.ceil(high * high * unit), unit)
    return low, high
