"""What a proof asserts, as polynomials with Bernstein coefficients in any arithmetic.

The inequalities are written out here once more, but what they are written on is shared with the
assembly of the cone program: the pieces of the model, cells and strips, restriction and composition
by blossoms. An error there both would believe; `pointwise` would not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from synthesis.lyapunov.spline import Lyapunov, MemoryLyapunov, SplineLyapunov
from synthesis.norm_bounded import NormBounded
from synthesis.polynomial.bernstein import composition, restriction
from synthesis.polynomial.cells import Cell, Strip, cells, strips
from synthesis.polynomial.exact import Number, exact
from synthesis.polynomial.matrix import PolynomialMatrix
from synthesis.polynomial.matrix import block as matrix
from synthesis.polynomial.pieces import ModelPiece
from synthesis.polynomial.symmetric_power import generator, null_matrix

Array = np.ndarray
UNIT = ((0, 1), (0, 1))
"""The box of the two local variables."""


class Form(NamedTuple):
    """A block with g = 0, and the positive weight of g, (1, 1): polynomials in two local variables,
    along p and across.
    """

    block: PolynomialMatrix
    weight: PolynomialMatrix


class Claim(NamedTuple):
    """What is to be verified: the pieces of the model, P, the rate (units of p per second) and dt
    (s, None: continuous).

    `elevation` raises the degree of the Bernstein forms, which brings their coefficients closer to
    the values.
    """

    pieces: tuple[ModelPiece, ...]
    P: Lyapunov
    rate: float
    dt: float | None
    elevation: int = 0
    block: NormBounded | None = None

    @property
    def strict(self) -> int:
        """Rows of a block of the LMI to which g does not belong."""
        return self.P.coefficients.shape[-1] + (0 if self.block is None else self.block.inputs)

    @property
    def meaningful(self) -> bool:
        """False where a P that varies meets a p that may jump in continuous time: dV/dt has no
        bound then.

        False also where this form of V is not written for the model: a memory or a higher order in
        discrete time or with channels, or a multiplier without a block and a block without one.
        """
        if (self.block is None) != (self.P.multiplier is None):
            return False
        if isinstance(self.P, MemoryLyapunov):
            return self.dt is None and math.isfinite(self.rate)
        if self.P.order > 1 and (
            self.dt is not None or any(piece.B.shape[2] or len(piece.C[0]) for piece in self.pieces)
        ):
            return False
        return self.dt is not None or self.P.degree == 0 or math.isfinite(self.rate)

    def invariant(self, number: Number) -> bool:
        """Whether p, with its lag where P has one, stays where the claim is made."""
        return not isinstance(self.P, MemoryLyapunov) or self.P.region.invariant(self.rate, number)


def lmi_polynomials(claim: Claim, number: Number) -> Iterator[Form]:
    """Every block over the whole range, with g = 0. `number` turns a double into the arithmetic of
    the proof.
    """
    P, used = claim.P, 0
    slack = (
        None
        if P.slack is None
        else null_matrix(exact(P.slack, number), claim.pieces[0].A.shape[1], P.order)
    )
    for F, weight in _polynomials(claim, number):
        degrees = (F.degrees[0] + claim.elevation, F.degrees[1])
        F = F.elevate(degrees)
        if slack is not None:
            c = F.coefficients
            own = slack[used : used + len(c)]
            # where P carries too little of it the blocks stand as they are
            c, used = (
                np.concatenate([c[: len(own)] + own[:, None], c[len(own) :]]),
                used + len(own),
            )
            F = _local(c)
        yield Form(F, weight.elevate(degrees))


def _polynomials(
    claim: Claim, number: Number
) -> Iterator[tuple[PolynomialMatrix, PolynomialMatrix]]:
    pieces, P, rate, dt, _, block = claim
    assert claim.meaningful  # noqa: S101 - checked by the callers
    one = PolynomialMatrix.constant(np.array([[number(1.0)]]), UNIT)
    squares = {} if block is None else {q.low: _squares(q, block, number) for q in pieces}
    if isinstance(P, MemoryLyapunov):
        for cell in cells(pieces, P.knots):
            yield from _remembering(cell, P, rate, number)
    elif dt is None:
        for cell in cells(pieces, P.knots):
            supply = _supply(cell, P, squares.get(cell.piece.low), number)
            yield from ((_plus(F, supply), one) for F in _continuous(cell, P, rate, block, number))
    else:
        step = rate * dt if P.degree else 0.0
        for strip in strips(pieces, P.knots, (-step, step)):
            F = _discrete(strip, P, block, number)
            yield _plus(F, _supply(strip.cell, P, squares.get(strip.cell.piece.low), number)), one


def _plus(F: PolynomialMatrix, supply: PolynomialMatrix | None) -> PolynomialMatrix:
    return F if supply is None else F + supply


def _supply(
    cell: Cell, P: SplineLyapunov, squares: Array | None, number: Number
) -> PolynomialMatrix | None:
    """lambda times the supply of a block for lambda = 1, `squares` over the piece, over the cell;
    None without a block.
    """
    if squares is None:
        return None
    low, high = number(cell.piece.low), number(cell.piece.high)
    a, b = (number(cell.low) - low) / (high - low), (number(cell.high) - low) / (high - low)
    whole = _local(_apply(restriction(len(squares) - 1, a, b), squares)[:, None])
    a, b, _ = _within(cell, P.knots, number)
    values = exact(P.multiplier_segment(cell.segment), number)
    own = _apply(restriction(P.multiplier_degree, a, b), values)
    return _times(_scalar(own[:, None]), whole)


def _squares(piece: ModelPiece, block: NormBounded, number: Number) -> Array:
    """Bernstein coefficients of bound^2 [G J H]'[G J H] - diag(0, I, 0) over the piece, v = G x +
    J d + H u.
    """
    v, bound = slice(-block.outputs, None), number(block.bound)
    C, D = (_local(exact(M[:, None, v], number)) for M in (piece.C, piece.D))
    rows = matrix([[C, D]])
    nx, nu = C.shape[1], D.shape[1]
    of_d = np.diag(np.r_[np.zeros(nx), np.ones(block.inputs), np.zeros(nu - block.inputs)])
    whole = rows.T @ rows * (bound * bound) - PolynomialMatrix.constant(exact(of_d, number), UNIT)
    return whole.coefficients[:, 0]


def _continuous(
    cell: Cell, P: SplineLyapunov, rate: float, block: NormBounded | None, number: Number
) -> Iterator[PolynomialMatrix]:
    A, B, C, D = _of_y(_model(cell, number, P.order), block)
    here, span = _now(cell, P, number)
    flow = A.T @ here
    top, side, corner = flow + flow.T + C.T @ C, here @ B + C.T @ D, D.T @ D
    if P.degree == 0 or rate == 0:
        yield matrix([[top, side], [side.T, corner]])
        return
    slope = here.derivative(0) * (number(1.0) / span)
    for nu in (-number(rate), number(rate)):
        yield matrix([[top + nu * slope, side], [side.T, corner]])


def _remembering(
    cell: Cell, P: MemoryLyapunov, rate: float, number: Number
) -> Iterator[tuple[PolynomialMatrix, PolynomialMatrix]]:
    """Blocks times height(p) = upper - lower, in (x, y): along the cell, and across one segment of
    the lead.
    """
    A, B, C, D = _model(cell, number, 1)
    a, b, width = _within(cell, P.knots, number)
    j, region = cell.segment, P.region
    low, high = (
        [number(float(v[j])) + t * (number(float(v[j + 1])) - number(float(v[j]))) for t in (a, b)]
        for v in (region.lower, region.upper)
    )
    span = (b - a) * width
    lower, height = _scalar(np.array(low)[:, None]), _scalar(np.subtract(high, low)[:, None])
    rise, widening = (low[1] - low[0]) / span, (high[1] - low[1] - high[0] + low[0]) / span
    outer = [_times(height, F) for F in (C.T @ C, C.T @ D, D.T @ D)]
    for i, ends in enumerate(pairwise(P.lead_knots)):
        share = np.array([[number(float(s)) for s in ends]])
        patch = exact(P.patch(j, i), number)
        here = _local(_apply(restriction(P.degree, a, b), patch))
        flow = _times(height, A.T @ here)
        in_p = _times(height, here.derivative(0)) * (number(1.0) / span)
        in_share = here.derivative(1) * (number(1.0) / (share[0, 1] - share[0, 0]))
        lead = lower + height @ _scalar(share)
        side = _times(height, here @ B) + outer[1]
        for nu in (-number(rate), number(rate)):
            drift = _scalar(nu * (1 - rise - widening * share)) - lead * (
                number(1.0) / number(region.time)
            )
            top = flow + flow.T + outer[0] + nu * in_p + _times(drift, in_share)
            yield matrix([[top, side], [side.T, outer[2]]]), height


def _discrete(
    strip: Strip, P: SplineLyapunov, block: NormBounded | None, number: Number
) -> PolynomialMatrix:
    A, B, C, D = _of_y(_model(strip.cell, number, 1), block)
    here, _ = _now(strip.cell, P, number)
    bottom, top = (
        number(float(P.knots[strip.next_segment])),
        number(float(P.knots[strip.next_segment + 1])),
    )
    corners = [[(number(q) - bottom) / (top - bottom) for q in pair] for pair in strip.corners]
    there = exact(P.segment(strip.next_segment), number)
    after = _local(_apply(composition(P.degree, corners), there))
    left_A, left_B = A.T @ after, B.T @ after
    state, side = left_A @ A - here + C.T @ C, left_A @ B + C.T @ D
    return matrix([[state, side], [side.T, left_B @ B + D.T @ D]])


def _model(cell: Cell, number: Number, order: int) -> list[PolynomialMatrix]:
    """A, B, C, D over the cell; for `order` > 1 the generator of the monomials, and no channels."""
    low, high = number(cell.piece.low), number(cell.piece.high)
    a, b = (number(cell.low) - low) / (high - low), (number(cell.high) - low) / (high - low)
    coefficients = [
        exact(M, number) for M in (cell.piece.A, cell.piece.B, cell.piece.C, cell.piece.D)
    ]
    if order > 1:
        coefficients[0] = generator(coefficients[0], order)
        N = coefficients[0].shape[1]
        coefficients[1:3] = [
            np.zeros((1, N, 0), dtype=coefficients[0].dtype),
            np.zeros((1, 0, N), dtype=coefficients[0].dtype),
        ]
    return [_local(_apply(restriction(len(M) - 1, a, b), M)[:, None]) for M in coefficients]


def _of_y(model: Sequence[PolynomialMatrix], block: NormBounded | None) -> list[PolynomialMatrix]:
    """The model without the outputs v of a block."""
    A, B, C, D = model
    y = slice(None, None if block is None else -block.outputs)
    return [A, B, *(_local(M.coefficients[..., y, :]) for M in (C, D))]


def _now(cell: Cell, P: SplineLyapunov, number: Number) -> tuple[PolynomialMatrix, Any]:
    """P over the cell, and how wide that is."""
    a, b, width = _within(cell, P.knots, number)
    own = _apply(restriction(P.degree, a, b), exact(P.segment(cell.segment), number))
    return _local(own[:, None]), (b - a) * width


def _within(cell: Cell, knots: Array, number: Number) -> tuple[Any, Any, Any]:
    """The cell's ends as fractions of its segment, and the segment's width."""
    bottom, top = number(float(knots[cell.segment])), number(float(knots[cell.segment + 1]))
    return (
        (number(cell.low) - bottom) / (top - bottom),
        (number(cell.high) - bottom) / (top - bottom),
        top - bottom,
    )


def _apply(weights: Array, coefficients: Array) -> Array:
    """sum_j weights[..., j] coefficients[j], in any arithmetic."""
    flat = coefficients.reshape(len(coefficients), -1)
    return (weights.reshape(-1, weights.shape[-1]) @ flat).reshape(
        *weights.shape[:-1], *coefficients.shape[1:]
    )


def _local(coefficients: Array) -> PolynomialMatrix:
    return PolynomialMatrix(UNIT, coefficients)


def _scalar(values: Array) -> PolynomialMatrix:
    return _local(values[..., None, None])


def _times(f: PolynomialMatrix, F: PolynomialMatrix) -> PolynomialMatrix:
    """f F for a scalar polynomial f."""
    return _local(f.coefficients * np.eye(F.shape[0], dtype=int)) @ F
