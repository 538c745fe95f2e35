"""A matrix made small by what may be added on some of its rows and columns."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

ROUNDING = 1e-6
"""By this part a level is kept above the least one, at which the formula has no digits."""


def contraction(M: Array, left: Array, right: Array, level: float) -> Array:
    """K (N, k, l) with |M + left K right| <= level, or nearly the least that can be, if that is
    more; `left` (N, r, k) of full column, `right` (N, l, c) of full row rank.

    References
    ----------
    Davis, Kahan and Weinberger, SIAM J. Numerical Analysis 19 (1982), the central solution.
    """
    k, l = left.shape[-1], right.shape[-2]
    P, into = np.linalg.qr(left, mode="complete")
    Q, out = np.linalg.qr(_t(right), mode="complete")
    inner = _t(P) @ M @ Q
    above, beside, corner = inner[:, :k, l:], inner[:, k:, :l], inner[:, k:, l:]
    least = np.maximum(_norm(inner[:, k:]), _norm(inner[:, :, l:]))
    bound = np.maximum(level, least * (1 + ROUNDING))[:, None, None]
    room = bound**2 * np.eye(corner.shape[-1]) - _t(corner) @ corner
    best = -above @ np.linalg.solve(room, _t(corner) @ beside)
    gain = best - inner[:, :k, :l]
    return np.linalg.solve(into[:, :k], gain) @ np.linalg.inv(_t(out[:, :l]))


def _norm(M: Array) -> Array:
    return np.linalg.svd(M, compute_uv=False).max(axis=-1, initial=0.0)


def _t(M: Array) -> Array:
    return np.swapaxes(M, -1, -2)
