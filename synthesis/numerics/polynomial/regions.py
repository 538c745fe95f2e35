"""Boxes on which an inequality is one polynomial, and the model and P on them, in any
arithmetic.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.bernstein import composition
from synthesis.numerics.polynomial.cells import Strip, strips
from synthesis.numerics.polynomial.exact import Number, exact
from synthesis.numerics.polynomial.matrix import Box, PolynomialMatrix
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import ModelPiece, Pieces


class Region(NamedTuple):
    """One strip a parameter: a box for p, inside one piece of the model and one segment of P, and
    the limits of p(k+1).
    """

    strips: tuple[Strip, ...]
    piece: tuple[int, ...]

    @property
    def box(self) -> tuple[tuple[float, float], ...]:
        """Range of p."""
        return tuple((s.cell.low, s.cell.high) for s in self.strips)

    @property
    def segment(self) -> tuple[int, ...]:
        """Segment of P, one index a parameter."""
        return tuple(s.cell.segment for s in self.strips)

    @property
    def next_segment(self) -> tuple[int, ...]:
        """Segment of P at p(k+1)."""
        return tuple(s.next_segment for s in self.strips)


def regions(
    model: Pieces, knots: Sequence[Array], motion: Motion, varying: Sequence[bool]
) -> Iterator[Region]:
    """Yield all regions: the ranges cut at knots and breaks, and in discrete time at the limits of
    the next p, as far as P is `varying` with it. Regions that p cannot reach are left out.
    """
    m = len(motion.box)
    free = [i for i in range(m) if motion.ties[i] is None]
    first = [_strips(model, knots, motion, varying, i, None) for i in free]
    for choice in product(*first):
        found: dict[int, Strip] = dict(zip(free, choice, strict=True))
        cell = {i: (s.cell.low, s.cell.high) for i, s in found.items()}
        second = [_strips(model, knots, motion, varying, i, cell) for i, _ in motion.tied]
        for rest in product(*second):
            found.update(zip((i for i, _ in motion.tied), rest, strict=True))
            region = _region(model, tuple(found[i] for i in range(m)))
            if motion.reaches(region.box):
                yield region


def _strips(
    model: Pieces,
    knots: Sequence[Array],
    motion: Motion,
    varying: Sequence[bool],
    i: int,
    cell: Mapping[int, tuple[float, float]] | None,
) -> tuple[Strip, ...]:
    """Return the strips of one parameter; where its rate is another parameter, for that in its
    `cell`.
    """
    nothing = np.zeros((1, 0, 0))
    # only the ends of the pieces matter here
    stretches = [
        ModelPiece(a, b, nothing, nothing, nothing, nothing) for a, b in pairwise(model.breaks[i])
    ]
    span = (0.0, 0.0)
    if model.dt is not None and varying[i]:
        own = [(0.0, 0.0) if cell is None else cell.get(k, (0.0, 0.0)) for k in range(len(knots))]
        span = motion.span(i, own, model.dt)
    return strips(stretches, knots[i], span, motion.cuts(i, model.dt is None))


def _region(model: Pieces, choice: tuple[Strip, ...]) -> Region:
    index = [
        int(np.searchsorted(b, 0.5 * (s.cell.low + s.cell.high)) - 1)
        for b, s in zip(model.breaks, choice, strict=True)
    ]
    return Region(choice, tuple(index))


def convert(F: PolynomialMatrix, number: Number) -> PolynomialMatrix:
    """Return the polynomial with its doubles as numbers of the arithmetic."""
    box = tuple((number(float(a)), number(float(b))) for a, b in F.box)
    return PolynomialMatrix(box, exact(F.coefficients, number))


def model_on(model: Pieces, region: Region, number: Number) -> tuple[PolynomialMatrix, ...]:
    """Return A, B, C, D over the box of the region."""
    box = _box(region, number)
    return tuple(convert(M, number).restrict(box) for M in model.models[region.piece])


def now(P: PolynomialMatrix, region: Region, number: Number) -> PolynomialMatrix:
    """Return P(p) over the box of the region; P in the arithmetic of the proof, on its segment."""
    return P.restrict(_box(region, number))


def successor(
    P: PolynomialMatrix, region: Region, number: Number, moving: Sequence[bool]
) -> PolynomialMatrix:
    """Return P(p(k+1)) over the box of p and one [0, 1] a parameter, which runs from the lower to
    the upper limit of p(k+1).
    """
    m = len(P.box)
    box, c = _box(region, number), P.coefficients
    for i, strip in enumerate(region.strips):
        low, high = P.box[i]
        corners = [[(number(q) - low) / (high - low) for q in pair] for pair in strip.corners]
        if not moving[i]:
            corners = [[pair[0], pair[0]] for pair in corners]
        T = composition(P.degrees[i], corners)
        if not moving[i]:
            T = T[:, :1]
        elif corners[0] == corners[1]:
            # where p(k+1) may be does not depend on p: a step as wide as the range, or a strip
            # between two knots
            T = T[:1]
        # axis i becomes x_i; s_i goes behind the parameters
        c = np.tensordot(T, c, axes=(2, i))
        c = np.moveaxis(c, (0, 1), (i, m + i))
    unit = (number(0.0), number(1.0))
    return PolynomialMatrix((*box, *(unit,) * m), c)


def _box(region: Region, number: Number) -> Box:
    return tuple((number(a), number(b)) for a, b in region.box)
