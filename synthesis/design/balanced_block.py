"""Coordinates in which a repeated scalar block b I costs least as one of bounded norm.

T^-1 (b I) T = b I for every invertible T, so that a norm-bounded block may be seen in the
coordinates where the largest singular value of T^-1 H(p, jw) T is least. T is sought by balancing
what the worst responses return against what they take, which is the stationary point of the sum of
their squares.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Array = np.ndarray

ROUNDS, SHARPNESS = 60, 6.0
"""Rounds of balancing; how much more the worst responses count."""


def balanced(responses: Sequence[Array], size: int) -> tuple[Array, float]:
    """T (size, size) of the repeated block and alpha of the rest, for `responses` H (K, rows,
    columns) whose first `size` rows and columns are its own.

    The rest is a block of bounded norm, of which alpha scales what enters and 1 / alpha what leaves.

    Examples
    --------
    >>> H = np.array([[[0.0, 100.0], [0.01, 0.0]]])
    >>> T, alpha = balanced([H], 2)
    >>> print(np.linalg.norm(np.linalg.solve(T, H[0] @ T), 2).round(3), alpha)
    1.0 1.0
    """
    H = np.concatenate(list(responses))
    T, alpha = np.eye(size), 1.0
    least, best = np.inf, (T, alpha)
    for _ in range(ROUNDS):
        seen = H.copy()
        seen[:, :size] = np.linalg.solve(T, H[:, :size])
        seen[:, size:] /= alpha
        seen[:, :, :size] = seen[:, :, :size] @ T
        seen[:, :, size:] *= alpha
        norms = np.linalg.norm(seen, 2, axis=(1, 2))
        worst = float(norms.max())
        if not np.isfinite(worst) or worst == 0:
            break
        if worst < least:
            least, best = worst, (T, alpha)
        weights = (norms / worst) ** SHARPNESS
        adjoint = np.conj(np.swapaxes(seen, 1, 2))
        out = np.real(np.tensordot(weights, seen @ adjoint, axes=1))
        into = np.real(np.tensordot(weights, adjoint @ seen, axes=1))
        own = _regular(out)[:size, :size], _regular(into)[:size, :size]
        T = T @ _power(_mean(own[0], np.linalg.inv(own[1])), 0.25)
        if H.shape[1] > size:
            ratio = np.trace(out[size:, size:]) / np.trace(into[size:, size:])
            alpha *= float(ratio) ** 0.125
    return best


def _regular(M: Array) -> Array:
    return M + 1e-10 * np.trace(M) * np.eye(len(M))


def _power(M: Array, exponent: float) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    return (vectors * np.maximum(values, 1e-300) ** exponent) @ vectors.T


def _mean(P: Array, Q: Array) -> Array:
    """The geometric mean X of two positive definite matrices: X P^-1 X = Q."""
    root, inverse = _power(P, 0.5), _power(P, -0.5)
    return root @ _power(inverse @ Q @ inverse, 0.5) @ root
