"""The bounded real lemma of `bounded_real` for many states: the same blocks, each kept as the
products with P that it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from synthesis.certify.assemble.bounded_real import BlockMultipliers, Supply, over_cell, over_strips
from synthesis.numerics.polynomial.bernstein import product_weights
from synthesis.numerics.polynomial.cells import Cell, Strip
from synthesis.numerics.polynomial.symmetric import smat
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks, Supplied

Array = np.ndarray


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


def of_state(A: Array, B: Array) -> Array:
    """Return [I 0], which selects the state from state and input."""
    return np.eye(A.shape[1], A.shape[1] + B.shape[2])
