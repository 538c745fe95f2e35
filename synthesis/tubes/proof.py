"""The exact check of an invariant ellipsoid."""

from __future__ import annotations

import numpy as np

from synthesis.polynomial.exact import positive_definite, rational
from synthesis.tubes.inequality import MatrixSet, Multipliers, block

Array = np.ndarray


def holds(P: Array, over: MatrixSet, factor: Array, by: Multipliers) -> bool:
    """Whether e'P e <= 1 lies within the deviations enclosed, factor' P factor >= I, and the
    inequality holds for all matrices of the set; in rational arithmetic on the doubles given.
    """
    number = rational()
    exact = np.frompyfunc(number, 1, 1)
    L, lyapunov = exact(factor), exact(P)
    if not positive_definite(L.T @ lyapunov @ L - exact(np.eye(len(P)))):
        return False
    tube, gust, terms, wind = (exact(np.atleast_2d(part)) for part in by[:4])
    own = Multipliers(tube, gust, terms, wind, number(by.decay))
    if own.wind[0, 0] < 0:
        return False
    matrices = MatrixSet(*(exact(part) for part in over))
    return positive_definite(block(lyapunov, matrices, own, number(1.0)))
