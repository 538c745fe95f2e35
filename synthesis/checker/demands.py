"""Symmetric matrices of polynomials that a proof demands to be positive definite."""

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from .cells import Cell
from .exact import shortfall, shown
from .polynomials import Polynomial, first_miss


class Demand(NamedTuple):
    """`matrix` + level `paid` is positive definite on a cell, or without one on a unit box of some
    variables; `name` is the inequality in words, the level belongs to the bound that is claimed.
    """

    name: str
    matrix: Polynomial
    cell: Cell | None = None
    paid: Polynomial | None = None
    variables: int = 0

    def at_level(self, level: Fraction) -> Polynomial:
        """Return what is positive definite."""
        return self.matrix if self.paid is None else self.matrix + self.paid * level


class Claim(NamedTuple):
    """The claim of a file: sentences made from its numbers, and the demands that prove it.

    `level` turns the `bound`, an upper one or a `lower` one, into the level of the demands;
    `refused` says why nothing can be proven before any demand is looked at.
    """

    claim: str
    hypotheses: Sequence[str]
    demands: Iterable[Demand]
    bound: Fraction = Fraction(0)
    level: Callable[[Fraction], Fraction] = lambda bound: bound
    lower: bool = False
    refused: str = ""


def failure(claim: Claim) -> str:
    """Return where the first demand fails and by how much; nothing where all hold."""
    if claim.refused:
        return claim.refused
    level = claim.level(claim.bound)
    for demand in claim.demands:
        F, cell = demand.at_level(level), demand.cell
        miss = (
            first_miss(F, cell.variables, cell.reaches) if cell else first_miss(F, demand.variables)
        )
        if miss is None:
            continue
        point, false = miss
        where = f" at {cell.place(point)}" if cell else ""
        if not false:
            return f"{demand.name}: undecided within the boxes that are looked at, as{where}"
        short = shortfall(F.value(point).terms[()])
        said = f"{demand.name}: the matrix is not positive definite{where}; {short:.3g} of its own"
        return f"{said} diagonal must be added to make it so{_needed(claim, demand, point)}"
    return ""


def _needed(claim: Claim, demand: Demand, point: Sequence[Fraction]) -> str:
    """Return which bound would do at this point."""
    if demand.paid is None:
        return ""
    here = demand._replace(matrix=demand.matrix.value(point), paid=demand.paid.value(point))

    def enough(bound: float) -> bool:
        return shown(here.at_level(claim.level(Fraction(bound))).terms[()])

    low = float(claim.bound)
    high = 0.0 if claim.lower else low or 1e-12
    for _ in range(0 if claim.lower else 40):
        high *= 1.0 if enough(high) else 1.5
    if not enough(high):
        return "; no bound makes it so"
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return f"; there the bound is {'at most' if claim.lower else 'at least'} {high:.9g}"


def exponential(x: Fraction) -> tuple[Fraction, Fraction]:
    """Return numbers below and above exp(x), x >= 0, as close as 1e-25 of it: the squares of those
    of a fraction of x, each a part of the series and all that is left of it, rounded outwards.
    """
    halvings = (2 * x.numerator // x.denominator).bit_length()
    if halvings > 20:
        raise OverflowError("an exponential that is too large")
    y, unit = x / (1 << halvings), 1 << 160
    term, total, count = Fraction(1), Fraction(1), 0
    while term * (1 << 140) > 1:
        count += 1
        term = term * y / count
        total += term
    low, high = total, total + 2 * term
    for k in range(halvings + 1):
        low, high = (low * low, high * high) if k else (low, high)
        low = Fraction(math.floor(low * unit), unit)
        high = Fraction(math.ceil(high * unit), unit)
    return low, high
