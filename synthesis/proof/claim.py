"""What a proof asserts, as polynomials with Bernstein coefficients in any arithmetic.

The inequalities are written out here once more, but what they are written on is shared with the
assembly of the cone program: the pieces of the model, cells and strips, restriction and composition
by blossoms. An error there both would believe; `pointwise` would not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from synthesis.lyapunov.spline import Lyapunov, MemoryLyapunov, SplineLyapunov
from synthesis.polynomial.bernstein import composition, elevate, multiply, restriction, transpose
from synthesis.polynomial.cells import Cell, Strip, cells, strips
from synthesis.polynomial.exact import Number, exact
from synthesis.polynomial.pieces import ModelPiece
from synthesis.polynomial.symmetric_power import generator, null_matrix

Array = np.ndarray


class Form(NamedTuple):
    """Bernstein coefficients (a + 1, b + 1, N, N) of a block with g = 0, and those of the positive
    weight of g, (a + 1, b + 1).
    """

    block: Array
    weight: Array


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

    @property
    def meaningful(self) -> bool:
        """False where a P that varies meets a p that may jump in continuous time: dV/dt has no
        bound then.

        False also where this form of V is not written for the model: a memory or a higher order in
        discrete time or with channels.
        """
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
    for block, weight in _polynomials(claim, number):
        degrees = (block.shape[0] - 1 + claim.elevation, block.shape[1] - 1)
        block = elevate(block, degrees)
        if slack is not None:
            own = slack[used : used + len(block)]
            # where P carries too little of it the blocks stand as they are
            block, used = (
                np.concatenate([block[: len(own)] + own[:, None], block[len(own) :]]),
                used + len(own),
            )
        yield Form(block, elevate(weight[..., None, None], degrees)[..., 0, 0])


def _polynomials(claim: Claim, number: Number) -> Iterator[tuple[Array, Array]]:
    pieces, P, rate, dt, _ = claim
    assert claim.meaningful  # noqa: S101 - checked by the callers
    one = np.array([[number(1.0)]])
    if isinstance(P, MemoryLyapunov):
        for cell in cells(pieces, P.knots):
            yield from _remembering(cell, P, rate, number)
    elif dt is None:
        for cell in cells(pieces, P.knots):
            yield from ((block, one) for block in _continuous(cell, P, rate, number))
    else:
        step = rate * dt if P.degree else 0.0
        for strip in strips(pieces, P.knots, step):
            yield _discrete(strip, P, number), one


def _continuous(cell: Cell, P: SplineLyapunov, rate: float, number: Number) -> Iterator[Array]:
    A, B, C, D = _model(cell, number, P.order)
    a, b, width = _local(cell.low, cell.high, P.knots, cell.segment, number)
    Pc = _apply(restriction(P.degree, a, b), exact(P.segment(cell.segment), number))[:, None]
    still = multiply(transpose(A), Pc)
    still, side = (
        [still, transpose(still), multiply(transpose(C), C)],
        [multiply(Pc, B), multiply(transpose(C), D)],
    )
    corner = [multiply(transpose(D), D)]
    if P.degree == 0 or rate == 0:
        yield _stack(still, side, corner)
        return
    slope = P.degree * (Pc[1:] - Pc[:-1]) / ((b - a) * width)
    for nu in (-number(rate), number(rate)):
        yield _stack([*still, nu * slope], side, corner)


def _remembering(
    cell: Cell, P: MemoryLyapunov, rate: float, number: Number
) -> Iterator[tuple[Array, Array]]:
    """Blocks times height(p) = upper - lower, in (x, y): along the cell, and across one segment of
    the lead.
    """
    A, B, C, D = _model(cell, number, 1)
    a, b, width = _local(cell.low, cell.high, P.knots, cell.segment, number)
    j, region = cell.segment, P.region
    low, high = (
        [number(float(v[j])) + t * (number(float(v[j + 1])) - number(float(v[j]))) for t in (a, b)]
        for v in (region.lower, region.upper)
    )
    lower, height = (
        np.array(low)[:, None],
        np.array([u - v for u, v in zip(high, low, strict=True)])[:, None],
    )
    span = (b - a) * width
    rise, widening = (low[1] - low[0]) / span, (height[1, 0] - height[0, 0]) / span
    outer = [
        _scaled(height, F)
        for F in (multiply(transpose(C), C), multiply(transpose(C), D), multiply(transpose(D), D))
    ]
    for i, ends in enumerate(pairwise(P.lead_knots)):
        share = np.array([[number(float(s)) for s in ends]])
        patch = exact(P.patch(j, i), number)
        here = _apply(restriction(P.degree, a, b), patch)
        still = _scaled(height, multiply(transpose(A), here))
        in_p = _scaled(height, P.degree * (here[1:] - here[:-1]) / span)
        in_share = P.lead_degree * (here[:, 1:] - here[:, :-1]) / (share[0, 1] - share[0, 0])
        lead = lower + height * share
        for nu in (-number(rate), number(rate)):
            drift = nu * (1 - rise - widening * share) - lead / number(region.time)
            top = [still, transpose(still), outer[0], nu * in_p, _scaled(drift, in_share)]
            block = _stack(top, [_scaled(height, multiply(here, B)), outer[1]], [outer[2]])
            degrees = (block.shape[0] - 1, block.shape[1] - 1)
            yield block, elevate(height[..., None, None], degrees)[..., 0, 0]


def _discrete(strip: Strip, P: SplineLyapunov, number: Number) -> Array:
    cell = strip.cell
    A, B, C, D = _model(cell, number, 1)
    a, b, _ = _local(cell.low, cell.high, P.knots, cell.segment, number)
    now = _apply(restriction(P.degree, a, b), exact(P.segment(cell.segment), number))[:, None]
    bottom, top = (
        number(float(P.knots[strip.next_segment])),
        number(float(P.knots[strip.next_segment + 1])),
    )
    corners = [[(number(q) - bottom) / (top - bottom) for q in pair] for pair in strip.corners]
    after = _apply(composition(P.degree, corners), exact(P.segment(strip.next_segment), number))
    left_A, left_B = multiply(transpose(A), after), multiply(transpose(B), after)
    return _stack(
        [multiply(left_A, A), -now, multiply(transpose(C), C)],
        [multiply(left_A, B), multiply(transpose(C), D)],
        [multiply(left_B, B), multiply(transpose(D), D)],
    )


def _model(cell: Cell, number: Number, order: int) -> list[Array]:
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
    return [_apply(restriction(len(M) - 1, a, b), M)[:, None] for M in coefficients]


def _local(
    low: float, high: float, knots: Array, segment: int, number: Number
) -> tuple[Any, Any, Any]:
    bottom, top = number(float(knots[segment])), number(float(knots[segment + 1]))
    return (
        (number(low) - bottom) / (top - bottom),
        (number(high) - bottom) / (top - bottom),
        top - bottom,
    )


def _apply(weights: Array, coefficients: Array) -> Array:
    """sum_j weights[..., j] coefficients[j], in any arithmetic."""
    flat = coefficients.reshape(len(coefficients), -1)
    return (weights.reshape(-1, weights.shape[-1]) @ flat).reshape(
        *weights.shape[:-1], *coefficients.shape[1:]
    )


def _scaled(f: Array, F: Array) -> Array:
    """f F for a scalar polynomial f (a + 1, b + 1)."""
    return multiply(f[..., None, None] * np.eye(F.shape[2], dtype=int), F)


def _stack(top: list[Array], side: list[Array], corner: list[Array]) -> Array:
    every = [*top, *side, *corner]
    degrees = (max(F.shape[0] for F in every) - 1, max(F.shape[1] for F in every) - 1)
    sums = [
        sum((elevate(F, degrees) for F in part[1:]), elevate(part[0], degrees))
        for part in (top, side, corner)
    ]
    upper = np.concatenate([sums[0], sums[1]], axis=-1)
    lower = np.concatenate([transpose(sums[1]), sums[2]], axis=-1)
    return np.concatenate([upper, lower], axis=-2)
