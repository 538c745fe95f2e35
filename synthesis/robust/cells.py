"""Proofs of a worst-case gain in cells: the ranges of the real parameters in parts, each with
scalings of its own.

Scalings of a real parameter are not exact where several parameters decide at once. What they miss
falls with the square of the width of the cell.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from typing import NamedTuple

import numpy as np

from symheli.progress import task
from synthesis.numerics.linear.norm import to_continuous
from synthesis.robust.exact_loop import ExactLoop
from synthesis.robust.intervals import LevelProof
from synthesis.robust.structure import BlockLoop, Part
from synthesis.robust.upper_bound import Upper, held_level, proven_level

NEAR = 1e-3
"""Relative excess over the lower bound at which a cell is not divided further."""


class Cell(NamedTuple):
    """The normalised parameters from `low` to `high`, within [-1, 1], and the proof there."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    proof: LevelProof

    @property
    def volume(self) -> Fraction:
        """Product of the widths."""
        pairs = zip(self.low, self.high, strict=True)
        return math.prod((Fraction(b) - Fraction(a) for a, b in pairs), start=Fraction(1))

    def meets(self, other: Cell) -> bool:
        """Whether they have inner points in common."""
        ends = zip(self.low, self.high, other.low, other.high, strict=True)
        return all(max(a, c) < min(b, d) for a, b, c, d in ends)


class CellsProof(NamedTuple):
    """The numbers of the proof of a gain in cells that leave no value of the parameters out."""

    cells: tuple[Cell, ...]

    @property
    def performance(self) -> bool:
        """Whether it is of the performance alone."""
        return all(cell.proof.performance for cell in self.cells)

    @property
    def bound(self) -> Fraction | None:
        """The largest of all cells, in the units of the loop; None where one has none."""
        found = [cell.proof.bound for cell in self.cells]
        known = [bound for bound in found if bound is not None]
        return max(known) if known and len(known) == len(found) else None

    def verified(self, loop: ExactLoop, parts: Sequence[Part]) -> bool:
        """Whether the cells cover the ranges, and the proof of each holds of the loop there, whose
        blocks are these `parts`.
        """
        return self.covers and all(
            cell.proof.parts == tuple(parts)
            and cell.proof.verified(loop.within(parts, cell.low, cell.high), parts)
            for cell in self.cells
        )

    @property
    def covers(self) -> bool:
        """Whether the cells are boxes side by side within [-1, 1]^m of its whole volume."""
        if not self.cells:
            return False
        m = sum(part.real for part in self.cells[0].proof.parts)
        inside = all(
            len(cell.low) == len(cell.high) == m
            and all(-1 <= a < b <= 1 for a, b in zip(cell.low, cell.high, strict=True))
            for cell in self.cells
        )
        same = all(cell.proof.parts == self.cells[0].proof.parts for cell in self.cells)
        if not (inside and same) or any(a.meets(b) for a, b in combinations(self.cells, 2)):
            return False
        return sum(cell.volume for cell in self.cells) == 2**m


def proven_in_cells(loop: BlockLoop, lower: float, most: int) -> Upper:
    """Return the least worst-case gain that is proven in at most so many cells, from `lower` on."""
    target, m = lower * (1 + NEAR), loop.reals
    waiting = deque([((-1.0,) * m, (1.0,) * m)])
    found: list[Cell] = []
    worst, decides = target, math.nan
    with task("proving the gain in cells", most) as progress:
        while waiting:
            low, high = waiting.popleft()
            own = cell_loop(loop, low, high)
            last = len(found) + len(waiting) + 2 > most or not m
            upper = (
                proven_level(own, target, performance=True)
                if last
                else held_level(own, target, performance=True)
            )
            if isinstance(upper.proof, LevelProof):
                found.append(Cell(low, high, upper.proof))
                if upper.level > worst:
                    worst, decides = upper.level, upper.omega
                progress.step(f"{worst:.6g}")
            elif last:
                return Upper(math.inf, upper.omega, None)
            else:
                waiting.extend(_halves(low, high))
    return Upper(worst, decides, CellsProof(tuple(found)))


def cell_loop(loop: BlockLoop, low: Sequence[float], high: Sequence[float]) -> BlockLoop:
    """Return the loop whose parameters have these normalised values at their ends."""
    exact = loop.in_rationals.within(loop.parts, low, high)
    A, B, C, D = exact.rounded()
    if exact.sampled:
        A, B, C, D = to_continuous(A, B, C, D)
    return loop._replace(A=A, B=B, C=C, D=D, exact=exact)


def _halves(
    low: tuple[float, ...], high: tuple[float, ...]
) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Return a cell in two, across its longest edge."""
    k = int(np.argmax(np.subtract(high, low)))
    middle = 0.5 * (low[k] + high[k])
    return [
        (low, (*high[:k], middle, *high[k + 1 :])),
        ((*low[:k], middle, *low[k + 1 :]), high),
    ]
