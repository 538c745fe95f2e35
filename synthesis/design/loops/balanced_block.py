"""Coordinates in which repeated scalar blocks b_i I are least conservative as one norm-bounded
block.

T^-1 (b I) T = b I for every invertible T: a block diag(b_1 I, b_2 I, ...) may be seen in
coordinates T = diag(T_1, T_2, ...) where the largest singular value of T^-1 H(p, jw) T is least. T
is sought by balancing what the worst responses return against what they take, which is the
stationary point of the sum of their squares.
"""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array

ITERATIONS, WEIGHT_EXPONENT = 60, 6.0
"""Number of balancing iterations, and the exponent with which larger responses are weighted."""


def balanced(responses: Array, size: int, count: int = 1) -> tuple[Array, Array, float]:
    """Return T for the `count` blocks of `size`, alpha for the block of all other channels, and the
    largest remaining norm, for `responses` H (K, rows, columns).

    Returns
    -------
    T_v (rows, rows), T_d (columns, columns), norm of T_v^-1 H T_d
        diag(T, alpha I) both, where the channels of the other block may differ in number.

    Examples
    --------
    >>> H = np.array([[[0.0, 100.0], [0.01, 0.0]]])
    >>> print(round(balanced(H, 2)[2], 3), round(balanced(H, 1, 2)[2], 3))
    1.0 1.0
    """
    rows, columns = responses.shape[1:]
    own, alpha = size * count, 1.0
    T = np.eye(own)
    best, least = (T, alpha), np.inf
    for _ in range(ITERATIONS):
        left, right = _whole(T, alpha, rows), _whole(T, alpha, columns)
        seen = np.linalg.solve(left, responses @ right)
        norms = np.linalg.norm(seen, 2, axis=(1, 2))
        worst = float(norms.max())
        if worst < least:
            least, best = worst, (T, alpha)
        if not np.isfinite(worst) or worst == 0:
            break
        weights = (norms / worst) ** WEIGHT_EXPONENT
        adjoint = np.conj(np.swapaxes(seen, 1, 2))
        out = _regular(np.real(np.tensordot(weights, seen @ adjoint, axes=1)))
        into = _regular(np.real(np.tensordot(weights, adjoint @ seen, axes=1)))
        step = np.zeros_like(T)
        for i in range(0, own, size):
            at = slice(i, i + size)
            step[at, at] = _power(_mean(out[at, at], np.linalg.inv(into[at, at])), 0.25)
        T = T @ step
        if rows > own:
            alpha *= float(np.trace(out[own:, own:]) / np.trace(into[own:, own:])) ** 0.125
    return _whole(*best, rows), _whole(*best, columns), least


def _whole(T: Array, alpha: float, size: int) -> Array:
    whole = alpha * np.eye(size)
    whole[: len(T), : len(T)] = T
    return whole


def _regular(M: Array) -> Array:
    return M + 1e-8 * np.trace(M) * np.eye(len(M))


def _power(M: Array, exponent: float) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    return (vectors * np.maximum(values, 1e-300) ** exponent) @ vectors.T


def _mean(P: Array, Q: Array) -> Array:
    """Return the geometric mean X of two positive definite matrices: X P^-1 X = Q."""
    root, inverse = _power(P, 0.5), _power(P, -0.5)
    return root @ _power(inverse @ Q @ inverse, 0.5) @ root
