"""Coordinates in which repeated scalar blocks b_i I cost least as one block of bounded norm.

T^-1 (b I) T = b I for every invertible T: a block diag(b_1 I, b_2 I, ...) may be seen in
coordinates T = diag(T_1, T_2, ...) where the largest singular value of T^-1 H(p, jw) T is least. T
is sought by balancing what the worst responses return against what they take, which is the
stationary point of the sum of their squares.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

ROUNDS, SHARPNESS = 60, 6.0
"""Rounds of balancing; how much more the worst responses count."""


def balanced(responses: Array, size: int) -> tuple[Array, float]:
    """T (n, n) of blocks of `size` for `responses` H (K, n, n), and the largest norm of T^-1 H T.

    Examples
    --------
    >>> H = np.array([[[0.0, 100.0], [0.01, 0.0]]])
    >>> print([round(balanced(H, size)[1], 3) for size in (1, 2)])
    [1.0, 1.0]
    """
    n = responses.shape[-1]
    T = best = np.eye(n)
    least = np.inf
    for _ in range(ROUNDS):
        seen = np.linalg.solve(T, responses @ T)
        norms = np.linalg.norm(seen, 2, axis=(1, 2))
        worst = float(norms.max())
        if worst < least:
            least, best = worst, T
        if not np.isfinite(worst) or worst == 0:
            break
        weights = (norms / worst) ** SHARPNESS
        adjoint = np.conj(np.swapaxes(seen, 1, 2))
        out = _regular(np.real(np.tensordot(weights, seen @ adjoint, axes=1)))
        into = _regular(np.real(np.tensordot(weights, adjoint @ seen, axes=1)))
        step = np.zeros((n, n))
        for i in range(0, n, size):
            own = slice(i, i + size)
            step[own, own] = _power(_mean(out[own, own], np.linalg.inv(into[own, own])), 0.25)
        T = T @ step
    return best, least


def _regular(M: Array) -> Array:
    return M + 1e-8 * np.trace(M) * np.eye(len(M))


def _power(M: Array, exponent: float) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    return (vectors * np.maximum(values, 1e-300) ** exponent) @ vectors.T


def _mean(P: Array, Q: Array) -> Array:
    """The geometric mean X of two positive definite matrices: X P^-1 X = Q."""
    root, inverse = _power(P, 0.5), _power(P, -0.5)
    return root @ _power(inverse @ Q @ inverse, 0.5) @ root
