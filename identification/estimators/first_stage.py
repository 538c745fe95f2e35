"""Strength of instruments: the explained part of the worst direction of the regressors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.design.excitation import RANK_TOLERANCE, column_scale, direction_in_words
from identification.design.tall_factors import orthonormal, triangular
from symheli.values.arrays import Array

MIN_F = 10.0
"""First-stage F below which instruments are weak: more than about a tenth of the bias of least
squares remains. Source: Staiger and Stock (1997).
"""


class FirstStage(NamedTuple):
    """`F` of the direction of the regressors that the instruments explain worst, and that
    `direction` in words.
    """

    F: float
    direction: str


def first_stage(phi: Array, Q: Array, names: tuple[str, ...], own: Array) -> FirstStage:
    """Return the first-stage regression of regressors phi (m, n) on instruments with the
    orthonormal basis Q (m, k); those of `own` (n,) are their own instruments.

    The least eigenvalue of what k - k_own instruments explain of the regressors against what they
    do not, per degree of freedom, that of `own` taken off both: F = (m - k)/(k - k_own) rho^2/(1 -
    rho^2), rho the smallest canonical correlation; infinite where nothing is left to explain. It
    takes what is not explained for white, and counts slow dynamics beyond the window of the
    instruments among it. Source: Cragg and Donald, Econometric Theory 9 (1993); Stock and Yogo
    (2005).
    """
    scale = column_scale(phi)
    X = phi / scale
    mine = orthonormal(X[:, own])[0]
    X = X[:, ~own] - mine @ (mine.T @ X[:, ~own])
    m, k, free = len(X), Q.shape[1], Q.shape[1] - mine.shape[1]
    if not X.shape[1] or free <= 0 or m <= k:
        return FirstStage(np.inf, "")
    basis, triangle = orthonormal(X)
    U, size, Vh = np.linalg.svd(triangle, full_matrices=False)
    kept = size > RANK_TOLERANCE * size[0]
    U = basis @ U[:, kept]
    _, left_over, right = np.linalg.svd(triangular(U - Q @ (Q.T @ U)), full_matrices=False)
    unexplained = float(left_over[0]) ** 2
    direction = np.zeros(len(scale))
    direction[~own] = (Vh[kept].T / size[kept]) @ right[0]
    words = direction_in_words(direction / np.linalg.norm(direction), names)
    if unexplained <= RANK_TOLERANCE:
        return FirstStage(np.inf, words)
    return FirstStage(max(1 - unexplained, 0.0) / unexplained * (m - k) / free, words)
