"""Regions of the scheduling parameter, and of its next value, on which an LMI is one polynomial."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.pieces import ModelPiece


class Cell(NamedTuple):
    """The interval p in [low, high], inside the model's `piece` and segment `segment` of P."""

    low: float
    high: float
    piece: ModelPiece
    segment: int


class Strip(NamedTuple):
    """The region p in [cell.low, cell.high] with p(k+1) between two straight lines in p, both in
    segment `next_segment` of P.

    `corners[e][f]` is p(k+1) on line f (0 lower, 1 upper) at the end e of the cell.
    """

    cell: Cell
    next_segment: int
    corners: tuple[tuple[float, float], tuple[float, float]]


def cells(
    pieces: Sequence[ModelPiece], knots: Array, cuts: Sequence[float] = ()
) -> tuple[Cell, ...]:
    """Return the range cut at the model's breaks, the knots of P and the extra `cuts`."""
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


def strips(
    pieces: Sequence[ModelPiece],
    knots: Array,
    span: tuple[float, float],
    cuts: Sequence[float] = (),
) -> tuple[Strip, ...]:
    """Return strips that cover all (p, p(k+1)) with p(k+1) - p in the `span` (least, largest), both
    in range, without gaps.

    The range is cut at the knots, at the ends of the span to either side of them and at the extra
    `cuts`; over each such cell the limits of p(k+1) are straight lines that cross no knot, and the
    knots between them cut the band into strips. The span is widened by 1e-12 of the range, and by
    some units in the last place of p: more than the rounding of the cuts, however far from zero the
    range is.
    """
    if span == (0, 0):
        return tuple(
            Strip(c, c.segment, ((c.low, c.low), (c.high, c.high)))
            for c in cells(pieces, knots, cuts)
        )
    low, high = float(knots[0]), float(knots[-1])
    slack = 1e-12 * (high - low) + 8 * float(np.spacing(max(abs(low), abs(high))))
    back, on = max(span[0], low - high) - slack, min(span[1], high - low) + slack
    out = []
    every = [*cuts, *(float(k) - side for k in knots for side in (back, on))]
    for cell in cells(pieces, knots, every):
        middle = 0.5 * (cell.low + cell.high)
        levels = [
            min(max(low, middle + back), high),
            *(float(k) for k in knots if low < k < high and back < k - middle < on),
        ]
        for level in levels:
            segment = min(int(np.searchsorted(knots, level, side="right") - 1), len(knots) - 2)
            bottom, top = float(knots[segment]), float(knots[segment + 1])

            def inside(value: float, bottom: float = bottom, top: float = top) -> float:
                return min(max(value, bottom), top)

            corners = tuple((inside(p + back), inside(p + on)) for p in (cell.low, cell.high))
            out.append(Strip(cell, segment, corners))  # type: ignore[arg-type]
    return tuple(out)
