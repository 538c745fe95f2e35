"""Orthogonal factors of matrices with many more rows than columns, a block of rows at a time: an
interrupt is heard between two, and a block stays in the cache.
"""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array

MAX_OPERATIONS = 4e8
"""Rows of a block times the square of its columns: some tenths of a second."""


def orthonormal(A: Array) -> tuple[Array, Array]:
    """Q (m, k) and R (k, n) of A (m, n) = Q R with Q' Q = 1, k the smaller of m and n.

    Of a matrix of one block those of LAPACK. Else the triangles of the blocks, one below the other,
    are factored in turn: as stable as Householder reflections of the whole. Source: Demmel,
    Grigori, Hoemmen and Langou (2012), Communication-optimal parallel and sequential QR and LU
    factorizations, SIAM J. Scientific Computing 34.
    """
    parts = _blocks(A)
    if len(parts) == 1:
        Q, R = np.linalg.qr(A)
        return Q, R
    factors = [np.linalg.qr(part) for part in parts]
    inner, R = orthonormal(np.concatenate([triangle for _, triangle in factors]))
    n = A.shape[1]
    Q = [own @ inner[i * n : (i + 1) * n] for i, (own, _) in enumerate(factors)]
    return np.concatenate(Q), R


def triangular(A: Array) -> Array:
    """R alone."""
    parts = _blocks(A)
    if len(parts) == 1:
        return np.asarray(np.linalg.qr(A, mode="r"))
    return triangular(np.concatenate([np.linalg.qr(part, mode="r") for part in parts]))


def _blocks(A: Array) -> list[Array]:
    """Return blocks of rows, with at least four times as many rows as columns."""
    m, n = A.shape
    rows = max(int(MAX_OPERATIONS / max(n, 1) ** 2), 4 * n, 1)
    return np.array_split(A, max(m // rows, 1))
