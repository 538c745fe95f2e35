"""Symmetric matrices as vectors: the upper triangle column by column, off-diagonal entries times
sqrt(2).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from symheli.values.arrays import Array


def length(n: int) -> int:
    """Return the number of entries n (n + 1) / 2."""
    return n * (n + 1) // 2


@lru_cache(maxsize=64)
def indices(n: int) -> tuple[Array, Array, Array]:
    """Return the row and column of every entry of such a vector, and its weight."""
    columns, rows = np.tril_indices(n)
    return rows, columns, np.where(rows == columns, 1.0, math.sqrt(2.0))


def svec(M: Array) -> Array:
    """Vectors (..., n (n + 1) / 2) of symmetric matrices (..., n, n); <M, N> = svec(M) .
    svec(N).
    """
    rows, columns, weight = indices(M.shape[-1])
    return M[..., rows, columns] * weight


def smat(v: Array, n: int) -> Array:
    """Matrices (..., n, n) from vectors (..., n (n + 1) / 2)."""
    rows, columns, weight = indices(n)
    out = np.zeros((*v.shape[:-1], n, n))
    out[..., rows, columns] = out[..., columns, rows] = v / weight
    return out


def symmetrized(M: Array) -> Array:
    """Return the symmetric part of matrices (..., n, n), to remove the rounding of a product."""
    return 0.5 * (M + np.swapaxes(M, -1, -2))


def extended(M: Array, by: int) -> Array:
    """[M 0; 0 I] with an identity of size `by`."""
    out = np.eye(len(M) + by)
    out[: len(M), : len(M)] = M
    return out


def schur_complement(F: Array, n: int) -> Array:
    """Return the Schur complement of matrices (..., N, N), eliminating the first n variables."""
    top, side, corner = F[..., :n, :n], F[..., :n, n:], F[..., n:, n:]
    return corner - np.swapaxes(side, -1, -2) @ np.linalg.solve(top, side)


def basis(n: int) -> Array:
    """The matrices (n (n + 1) / 2, n, n) with smat(v) = sum_i v_i basis_i."""
    return smat(np.eye(length(n)), n)


def powered(M: Array, exponent: float) -> Array:
    """M^exponent of a symmetric M (n, n), its eigenvalues no less than 1e-12 of the largest."""
    values, vectors = np.linalg.eigh(symmetrized(M))
    return symmetrized(
        (vectors * np.maximum(values, 1e-12 * abs(values[-1])) ** exponent) @ vectors.T
    )
