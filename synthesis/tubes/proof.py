"""The exact check of an invariant ellipsoid."""

from __future__ import annotations

import numpy as np

from synthesis.polynomial.exact import exact, positive_definite, rational
from synthesis.tubes.deviations import Cell
from synthesis.tubes.inequality import MatrixSet, Multipliers, Shares, conditions, motion

Array = np.ndarray

SPARE = 1e-6
"""Spare of bounds that are computed in floating point, 1/s, in the coordinates of the factor."""


def holds(
    nodes: Array,
    airspeeds: Array,
    cell: Cell,
    over: MatrixSet,
    factor: Array,
    by: Multipliers,
) -> bool:
    """Whether e'P e <= 1 lies within the deviations enclosed, factor' P factor >= I, and the
    inequality holds for all matrices of the set and all commands of the cell; in rational
    arithmetic on the doubles given.

    nodes (1 or 2, n, n): P at the nodes of the cell's interval, at these airspeeds.
    """
    number = rational()
    half = number(0.5)

    def symmetric(M: Array) -> Array:
        own = exact(M, number)
        return (own + own.T) * half

    L, given = exact(factor, number), [symmetric(P) for P in nodes]
    terms, wind = exact(np.diag(np.diag(by.terms)), number), exact(np.atleast_2d(by.wind), number)
    own = Multipliers(symmetric(by.tube), symmetric(by.gust), terms, wind, number(by.decay))
    if own.wind[0, 0] < 0:
        return False
    ends = exact(airspeeds, number)
    P = motion(given, ends[-1] - ends[0], *(exact(part, number) for part in cell.domain))
    matrices = MatrixSet(*(exact(part, number) for part in over))
    try:
        X = [_shares(end.astype(float), over, factor, by) for end in P.ends]
    except np.linalg.LinAlgError:
        return False
    if not np.all(np.isfinite([part for at in X for part in at])):
        return False
    shares = [Shares(*(exact(part, number) for part in at)) for at in X]
    bounds, falls = conditions(P, shares, matrices, own, number)
    unit = exact(np.eye(len(factor)), number)
    inside = [L.T @ end @ L - unit for end in P.ends]
    return all(map(positive_definite, [*inside, *bounds, *falls]))


def _shares(P: Array, over: MatrixSet, factor: Array, by: Multipliers) -> Shares:
    """Those that leave a little to spare."""
    inverse = np.linalg.inv(factor)
    spare = SPARE * inverse.T @ inverse
    rows = (P, P, P @ over.left.T)
    X = [
        row @ np.linalg.solve(multiplier, row.T)
        for row, multiplier in zip(rows, by[:3], strict=True)
    ]
    return Shares(*(0.5 * (own + own.T) + spare for own in X))
