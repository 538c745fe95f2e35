"""The exact check of an invariant ellipsoid and of a gain on it."""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import Number, exact, matmul, positive_definite, rational
from synthesis.tubes.deviations import CommandCell
from synthesis.tubes.inequality import (
    MatrixSet,
    MovingEllipsoid,
    Multipliers,
    Shares,
    bounded,
    conditions,
    invariant,
    motion,
)

SPARE = 1e-6
"""Spare of bounds that are computed in floating point, 1/s, as a share of P."""


def holds(
    nodes: Array,
    values: Array,
    cell: CommandCell,
    over: MatrixSet,
    factor: Array,
    by: Multipliers,
) -> bool:
    """Whether e'P e <= 1 lies within the deviations enclosed, factor' P factor >= I, and falls on
    its border for all matrices of the set and all commands of the cell; in rational arithmetic on
    the doubles given.

    nodes (1 or 2, n, n): P at the nodes of the cell's interval, at these values of the scheduling
    command.
    """
    number = rational()
    own = _exact(by, number)
    supply = invariant(own, over.corners.shape[-2:], number)
    if own.wind[0, 0] < 0:
        return False
    found = _matrices(nodes, values, cell, over, by, supply, number)
    if found is None:
        return False
    P, matrices = found
    L, unit = exact(factor, number), exact(np.eye(len(factor)), number)
    return all(
        map(positive_definite, [*(matmul(matmul(L.T, end), L) - unit for end in P.ends), *matrices])
    )


def is_bounded(
    nodes: Array,
    values: Array,
    cell: CommandCell,
    over: MatrixSet,
    by: Multipliers,
    output: Array,
    bias: float,
) -> bool:
    """Whether V = e'Q e > 0 grows by no more than wind |w|^2 - |output e|^2 + bias, as `holds`;
    `wind` of the multipliers, |w| <= 1, decay 0.
    """
    number = rational()
    own = _exact(by, number)
    price, free = own.wind, exact([[bias]], number)
    supply = bounded(price, free, exact(output, number), over.corners.shape[-2:], number)
    if price[0, 0] < 0 or by.decay != 0:
        return False
    found = _matrices(nodes, values, cell, over, by, supply, number)
    return found is not None and all(map(positive_definite, [*found[0].ends, *found[1]]))


def is_above(nodes: Array, output: Array) -> bool:
    """Whether e'Q e > |output e|^2 at all nodes, in rational arithmetic."""
    number = rational()
    C = exact(output, number)
    return all(positive_definite(_symmetric(Q, number) - matmul(C.T, C)) for Q in nodes)


def falls_in(jump: Array, after: Array, before: Array) -> bool:
    """Whether e'P e after a jump R e is less than that before it, with P (n, n) after and before,
    in rational arithmetic.
    """
    number = rational()
    R, last = exact(jump, number), _symmetric(before, number)
    return positive_definite(last - matmul(matmul(R.T, _symmetric(after, number)), R))


def is_within(nodes: Array, rows: Array, bound: float) -> bool:
    """Whether |k'e| < bound for all e with e'P e <= 1, P (nodes, n, n) and k (nodes, n) linear
    between the nodes, in rational arithmetic.
    """
    number = rational()
    size = exact([[bound]], number)
    for P, row in zip(nodes, rows, strict=True):
        k = exact(row[None], number)
        corner = np.block([[_symmetric(P, number), k.T], [k, size * size]])
        if not (bound > 0 and positive_definite(corner)):
            return False
    return True


def _symmetric(M: Array, number: Number) -> Array:
    own = exact(M, number)
    return (own + own.T) * number(0.5)


def _exact(by: Multipliers, number: Number) -> Multipliers:
    """The multipliers as rationals, made symmetric and diagonal."""
    terms, wind = exact(np.diag(np.diag(by.terms)), number), exact(np.atleast_2d(by.wind), number)
    tube, gust = _symmetric(by.tube, number), _symmetric(by.gust, number)
    return Multipliers(tube, gust, terms, wind, number(by.decay))


def _matrices(
    nodes: Array,
    values: Array,
    cell: CommandCell,
    over: MatrixSet,
    by: Multipliers,
    supply: Array,
    number: Number,
) -> tuple[MovingEllipsoid, list[Array]] | None:
    """P over the cell and the matrices that must be positive definite; None where there are no
    shares.
    """
    ends = exact(values, number)
    centre, half = (exact(part[:2], number) for part in cell.domain)
    given = [_symmetric(P, number) for P in nodes]
    P = motion(given, ends[-1] - ends[0], centre, half)
    try:
        X = [_shares(end.astype(float), over, by) for end in P.ends]
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.isfinite([part for at in X for part in at])):
        return None
    shares = [Shares(*(exact(part, number) for part in at)) for at in X]
    over = MatrixSet(*(exact(part, number) for part in over))
    bounds, falls = conditions(P, shares, over, _exact(by, number), supply, number)
    return P, [*bounds, *falls]


def _shares(P: Array, over: MatrixSet, by: Multipliers) -> Shares:
    """Those that leave a little to spare."""
    rows = (P @ over.onto, P @ over.onto, P @ over.left.T)
    X = [
        row @ np.linalg.solve(multiplier, row.T)
        for row, multiplier in zip(rows, by[:3], strict=True)
    ]
    return Shares(*(0.5 * (own + own.T) + SPARE * P for own in X))
