"""The bounded real lemma of `bounded_real` for many states: the same blocks, each kept as the
products with P that it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from symheli.lpv.lpv_matrices import Matrices
from symheli.values.arrays import Array
from synthesis.certify.assemble.bounded_real import (
    BlockMultipliers,
    Supply,
    over_cell,
    over_strips,
    supply_terms,
)
from synthesis.numerics.polynomial.bernstein import blossom, product_weights
from synthesis.numerics.polynomial.cells import Cell, Strip
from synthesis.numerics.polynomial.pieces import ModelPiece
from synthesis.numerics.polynomial.symmetric import smat
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks, Supplied


def continuous_products(
    cells: Sequence[Cell],
    knots: Array,
    degree: int,
    rate: float,
    extra: int,
    multiplier: BlockMultipliers | None = None,
) -> Iterator[LyapunovBlocks]:
    """The blocks of every cell, both signs of the rate together: [I 0]' P [A B] and its transpose,
    and half of the drift with each.
    """
    for cell in cells:
        form = over_cell(cell, knots, degree, extra, multiplier)
        state = of_state(form.A, form.B)
        flow = np.tensordot(form.flow, np.concatenate([form.A, form.B], axis=2), axes=(1, 0))
        drift = 0.5 * form.slope[:, :, None, None] * state
        constant = np.tensordot(form.up, form.output, axes=1)
        rates = (-rate, rate) if rate > 0 else (0.0,)
        yield LyapunovBlocks(
            form.columns,
            state[None],
            np.concatenate([flow + nu * drift for nu in rates])[:, None],
            np.concatenate([constant for _ in rates]),
            False,
            _supplied(form.supply, len(state.T), np.tile(np.arange(len(constant)), len(rates))),
        )


def _supplied(supply: Supply | None, size: int, order: Array) -> Supplied | None:
    """Return the supply rate of a norm-bounded block as matrices, for the coefficients in this
    order.
    """
    if supply is None:
        return None
    return Supplied(supply.columns, smat(supply.linear, size)[order])


def discrete_products(
    strips: Sequence[Strip],
    knots: Array,
    degree: int,
    extra: int,
    multiplier: BlockMultipliers | None = None,
) -> Iterator[LyapunovBlocks]:
    """The blocks of every strip: M_i' P+ times what the coefficients M = [A B] beside it add up to,
    and P itself.
    """
    for form in over_strips(strips, knots, degree, extra, multiplier):
        M, state = np.concatenate([form.A, form.B], axis=2), of_state(form.A, form.B)
        dM = len(M) - 1
        # of M_i' P+_j M_l in the block (q, s), symmetric in i and l
        weights = np.einsum(
            "qm,mrx,ril,xsj->qsijl",
            form.raised,
            product_weights(2 * dM, degree),
            product_weights(dM, dM),
            form.after,
            optimize=True,
        )
        q, s = weights.shape[:2]
        varying = np.zeros((q, s, len(M) + 1, len(form.columns), *state.shape))
        varying[:, :, :-1, form.next : form.next + degree + 1] = 0.5 * np.tensordot(
            weights, M, axes=1
        )
        varying[:, :, -1, form.own : form.own + degree + 1] = (
            -0.5 * form.here[:, None, :, None, None] * state
        )
        constant = np.tensordot(form.up, form.output, axes=1)
        yield LyapunovBlocks(
            form.columns,
            np.concatenate([M, state[None]]),
            varying.reshape(q * s, *varying.shape[2:]),
            np.repeat(constant, s, axis=0),
            True,
            _supplied(form.supply, len(state.T), np.repeat(np.arange(q), s)),
        )


def at_points(
    model: Matrices,
    points: Array,
    knots: Array,
    j: int,
    degree: int,
    pace: float,
    multiplier: BlockMultipliers | None = None,
) -> LyapunovBlocks:
    """The blocks of a model at single p in segment j, where it has these matrices (K, ...) and p
    moves by `pace` per unit of time: fewer than Bernstein coefficients, so that the resulting P is
    only a candidate.

    Of a sampled model the matrices are those of its bilinear image and `pace` is half the change of
    p in a sample. In the coordinates s = (x + x+)/sqrt(2) the change of V is s'P d + d'P s, d = (x+
    - x)/sqrt(2), well conditioned however short the sample. What P(p+) - P(p) adds is taken as
    +-dP/dp at s, as slow states see it.
    """
    A, B, C, D = model
    flow, state = np.concatenate([A, B], axis=2), of_state(A, B)
    own = slice(None, None if multiplier is None else -multiplier.block.outputs)
    seen = np.concatenate([C, D], axis=2)[:, own]
    paces = (-0.5 * pace, 0.5 * pace) if pace > 0 and degree else (0.0,)
    t = (points - knots[j]) / (knots[j + 1] - knots[j])
    value = np.stack([blossom([s] * degree) for s in t])
    lower = np.stack([blossom([s] * max(degree - 1, 0)) for s in t])
    lower = lower * degree / (knots[j + 1] - knots[j])
    slope = np.pad(lower, ((0, 0), (1, 0))) - np.pad(lower, ((0, 0), (0, 1)))
    drifts = [np.broadcast_to(each * state, flow.shape) for each in paces]
    beside = np.concatenate([np.stack([flow, drift], axis=1) for drift in drifts])
    supplied = None
    if multiplier is not None:
        rates = [
            _supply_at(p, j, knots, Matrices(*M), multiplier)
            for p, *M in zip(points.tolist(), A, B, C, D, strict=True)
        ]
        each = smat(np.concatenate([rate.linear[:1] for rate in rates]), len(state.T))
        supplied = Supplied(rates[0].columns, np.tile(each, (len(paces), 1, 1, 1)))
    return LyapunovBlocks(
        j * degree + np.arange(degree + 1),
        state[None],
        beside[:, None, : 1 + (degree > 0)],
        np.tile(np.swapaxes(seen, 1, 2) @ seen, (len(paces), 1, 1)),
        supply=supplied,
        weights=np.stack([value, slope] if degree else [value], axis=2),
    )


def _supply_at(
    p: float, j: int, knots: Array, model: Matrices, multiplier: BlockMultipliers
) -> Supply:
    """Return the supply rate of a norm-bounded block at one p in segment j."""
    cell = Cell(p, p, ModelPiece(p - 1.0, p + 1.0, *(M[None] for M in model)), j)
    rate = supply_terms(cell, multiplier).over(cell, knots, multiplier.degree)
    assert rate is not None  # noqa: S101 - there is a block
    return rate


def of_state(A: Array, B: Array) -> Array:
    """Return [I 0], which selects the state from state and input."""
    return np.eye(A.shape[1], A.shape[1] + B.shape[2])
