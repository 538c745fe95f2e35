"""The bounded real lemma of several parameters and many states at single p, in continuous time:
fewer blocks than Bernstein coefficients, as products with P. The resulting P is only a candidate
for a proof.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.lpv.bases.polynomials import lobatto_points
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.assemble.box import Shape, coefficients_of
from synthesis.certify.assemble.lyapunov_blocks import of_state
from synthesis.certify.statement.demand import Demand
from synthesis.numerics.polynomial.bernstein import blossom
from synthesis.numerics.polynomial.regions import Region
from synthesis.numerics.polynomial.symmetric import extended
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks


def points_of(region: Region, count: int) -> Array:
    """Return this number of values of each parameter in a region, (K, m), ends included, dense
    towards them.
    """
    return lobatto_points(count, region.box).reshape(-1, len(region.box))


def at_points(
    system: Matrices, demand: Demand, shape: Shape, region: Region, points: Array, weight: Array
) -> LyapunovBlocks:
    """Return the inequalities of a region at `points` (K, m), one block for each and extreme motion
    of p; for the scaled `system` there, the state blocks in coordinates changed by `weight`.
    """
    A, B, C, D = system
    flow, state = np.concatenate([A, B], axis=2), of_state(A, B)
    seen = np.concatenate([C, D], axis=2)
    value, slopes = _spline(shape, region, points)
    drifts = list(demand.motion.drifts(demand.moving(shape.degrees)))
    moving = [
        i
        for i in range(len(slopes))
        if any(drift.rates[i] or drift.ties[i] is not None for drift in drifts)
    ]
    # of P and of its derivatives where p moves, at every point
    weights = np.stack([value, *(slopes[i] for i in moving)], axis=2)
    paces = [
        [
            np.broadcast_to(drift.rates[i] if tie is None else points[:, tie], len(points))
            for i in moving
            for tie in [drift.ties[i]]
        ]
        for drift in drifts
    ]
    beside = np.concatenate(
        [
            np.stack([flow, *(0.5 * demand.time * pace[:, None, None] * state for pace in each)], 1)
            for each in paces
        ]
    )
    blocks = LyapunovBlocks(
        coefficients_of(shape, region.segment).ravel(),
        state[None],
        beside[:, None],
        np.tile(np.swapaxes(seen, 1, 2) @ seen, (len(drifts), 1, 1)),
        weights=weights,
    )
    return blocks.congruent(extended(weight, B.shape[2]))


def _spline(shape: Shape, region: Region, points: Array) -> tuple[Array, list[Array]]:
    """Weights (K, k) of the coefficients of a segment in P at the points, and in each of its
    derivatives.
    """
    each, slopes = [], []
    for i, (knots, d) in enumerate(zip(shape.knots, shape.degrees, strict=True)):
        low, high = knots[region.segment[i]], knots[region.segment[i] + 1]
        t = (points[:, i] - low) / (high - low)
        each.append(np.stack([blossom([s] * d) for s in t]))
        lower = np.stack([blossom([s] * max(d - 1, 0)) for s in t]) * d / (high - low)
        nothing = np.zeros((len(t), 1))
        slopes.append(
            np.hstack([nothing, lower]) - np.hstack([lower, nothing]) if d else 0.0 * each[-1]
        )
    return _product(each), [
        _product([slopes[j] if j == i else each[j] for j in range(len(each))])
        for i in range(len(each))
    ]


def _product(factors: Sequence[Array]) -> Array:
    """Products of the entries of every row, the last factor's fastest."""
    out = factors[0]
    for factor in factors[1:]:
        out = (out[:, :, None] * factor[:, None, :]).reshape(len(out), -1)
    return out
