"""Where the scheduling parameter is, and where it may be next: regions on which an LMI is one
polynomial.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from synthesis.polynomial.pieces import ModelPiece

Array = np.ndarray


class Cell(NamedTuple):
    """p in [low, high], inside the model's `piece` and segment `segment` of P."""

    low: float
    high: float
    piece: ModelPiece
    segment: int


class Strip(NamedTuple):
    """p in [cell.low, cell.high] and p(k+1) between two straight lines in p, both in segment
    `next_segment` of P.

    `corners[e][f]` is p(k+1) on line f (0 lower, 1 upper) at the end e of the cell.
    """

    cell: Cell
    next_segment: int
    corners: tuple[tuple[float, float], tuple[float, float]]


def cells(
    pieces: Sequence[ModelPiece], knots: Array, cuts: Sequence[float] = ()
) -> tuple[Cell, ...]:
    """The range cut at the model's breaks, the knots of P and the extra `cuts`."""
    low, high = float(knots[0]), float(knots[-1])
    points = sorted(
        {*map(float, knots), *(q.low for q in pieces[1:]), *(c for c in cuts if low < c < high)}
    )
    out, j = [], 0
    for a, b in pairwise(points):
        while pieces[j].high < b:
            j += 1
        out.append(Cell(a, b, pieces[j], int(np.searchsorted(knots, a, side="right") - 1)))
    return tuple(out)


def strips(pieces: Sequence[ModelPiece], knots: Array, step: float) -> tuple[Strip, ...]:
    """All (p, p(k+1)) with |p(k+1) - p| <= `step`, both in range, covered without gaps.

    The range is cut at the knots and one step to either side of them; over each such cell the
    limits p - step and p + step are straight lines that cross no knot, and the knots between them
    cut the band into strips. The step is widened by 1e-12 of the range, which absorbs the rounding
    of the cuts.
    """
    if step == 0:
        return tuple(
            Strip(c, c.segment, ((c.low, c.low), (c.high, c.high))) for c in cells(pieces, knots)
        )
    low, high = float(knots[0]), float(knots[-1])
    step = min(step, high - low) + 1e-12 * (high - low)
    out = []
    for cell in cells(pieces, knots, [float(k) + side for k in knots for side in (-step, step)]):
        middle = 0.5 * (cell.low + cell.high)
        levels = [
            max(low, middle - step),
            *(float(k) for k in knots if low < k < high and abs(k - middle) < step),
        ]
        for level in levels:
            segment = min(int(np.searchsorted(knots, level, side="right") - 1), len(knots) - 2)
            bottom, top = float(knots[segment]), float(knots[segment + 1])

            def inside(value: float, bottom: float = bottom, top: float = top) -> float:
                return min(max(value, bottom), top)

            corners = tuple((inside(p - step), inside(p + step)) for p in (cell.low, cell.high))
            out.append(Strip(cell, segment, corners))  # type: ignore[arg-type]
    return tuple(out)
