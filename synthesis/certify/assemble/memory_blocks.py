"""The bounded real lemma with a Lyapunov function of p and its lag: blocks in p and in the lag
error.

With e = p - q, time dq/dt = p - q, the rate of e is known where that of p is: de/dt = dp/dt -
e/time. So V = x' P(p, e) x has dV/dt of the ordinary form, over the region of (p, e) that can be
reached, for both extreme rates nu of p:

    [A'P + PA + nu dP/dp + (nu - e/time) dP/de + C'C   PB + C'D ]
    [B'P + D'C                                         D'D - g I]  < 0.

With s = (e - lower(p))/height(p), height = upper - lower, and times height(p) > 0 it is polynomial
in p and s on each patch. A finite memory of the parameter makes a quadratic V exact in the limit:
Lee and Dullerud, "Uniform stabilization of discrete-time switched and Markovian jump linear
systems", Automatica 42 (2006). Here the memory is a lag, in continuous time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from symheli.values.arrays import Array
from synthesis.certify.assemble.bounded_real import (
    Blocks,
    bordered,
    common_degree,
    local_coordinates,
    output_terms,
    slope_over,
)
from synthesis.certify.statement.lag import LagRegion
from synthesis.numerics.polynomial.bernstein import elevation_matrix, product_weights, restriction
from synthesis.numerics.polynomial.cells import Cell
from synthesis.numerics.polynomial.symmetric import basis, svec


def memory_blocks(
    cells: Sequence[Cell],
    region: LagRegion,
    lead_knots: Array,
    degree: int,
    lead_degree: int,
    rate: float,
    extra: int,
) -> Iterator[Blocks]:
    """Yield the blocks of every patch for both signs of the rate (units of p per unit of time,
    that of the region's `time`).
    """
    across = (len(lead_knots) - 1) * lead_degree + 1
    same = np.eye(lead_degree + 1)
    for cell in cells:
        lower, height = (
            np.interp([cell.low, cell.high], region.knots, v)
            for v in (region.lower, region.upper - region.lower)
        )
        width = cell.high - cell.low
        rise, widening = np.diff(lower)[0] / width, np.diff(height)[0] / width
        A, B, dM = common_degree(cell.piece.A, cell.piece.B, cell)
        times_height = product_weights(1, dM)
        A, B = (np.einsum("qim,i,mab->qab", times_height, height, M) for M in (A, B))
        output = output_terms(cell)
        output = np.einsum("qim,i,mab->qab", product_weights(1, len(output) - 1), height, output)
        d = max(1 + dM + degree, len(output) - 1) + extra
        E = basis(A.shape[1])
        lyapunov = E @ A[:, None]
        operator = svec(bordered(lyapunov + np.swapaxes(lyapunov, -1, -2), E @ B[:, None]))
        direct = svec(bordered(E, np.zeros((*E.shape[:2], B.shape[2]))))
        a, b, _ = local_coordinates(cell, region.knots)
        here = restriction(degree, a, b)
        up = elevation_matrix(1 + dM + degree, d)
        flow = np.einsum(
            "qm,mik,kj,ivl->qjvl",
            up,
            product_weights(1 + dM, degree),
            here,
            operator,
            optimize=True,
        )
        slope = np.einsum(
            "qim,i,mj->qj", product_weights(1, degree - 1), height, slope_over(degree, here, width)
        )
        slope = elevation_matrix(degree, d) @ slope
        beside = elevation_matrix(1 + degree, d) @ np.einsum(
            "quk,kj->quj", product_weights(1, degree), here
        ).reshape(degree + 2, -1)
        beside = beside.reshape(d + 1, 2, degree + 1)
        constant = np.repeat(
            elevation_matrix(len(output) - 1, d) @ svec(output), lead_degree + 1, axis=0
        )
        weight = np.repeat(elevation_matrix(1, d) @ height, lead_degree + 1)
        for i, ends in enumerate(pairwise(lead_knots)):
            share = np.array(ends)
            lead = lower[:, None] + height[:, None] * share
            steeper = np.einsum(
                "bvk,kj->bvj",
                product_weights(1, lead_degree - 1),
                slope_over(lead_degree, same, share[1] - share[0]),
            )
            columns = (
                (cell.segment * degree + np.arange(degree + 1))[:, None] * across
                + i * lead_degree
                + np.arange(lead_degree + 1)
            )
            for nu in (-rate, rate):
                # height ds/dt, bilinear on the patch
                drift = nu * (1.0 - rise - widening * share) - lead / region.time
                moving = np.einsum("uv,auj,bvk->abjk", drift, beside, steeper) + nu * np.einsum(
                    "aj,bk->abjk", slope, same
                )
                linear = np.einsum("ajvl,bk->abjkvl", flow, same) + moving[..., None, None] * direct
                shape = (len(weight), columns.size, *direct.shape)
                yield Blocks(columns.ravel(), linear.reshape(shape), constant, weight)
