"""Stabilising solutions of algebraic Riccati equations, accepted only if their properties hold."""

from __future__ import annotations

import numpy as np
from scipy import linalg

Array = np.ndarray

MAX_SUBSPACE_ERROR = 1e-6
"""Largest entry of V'JV of the stable subspace V with orthonormal columns, exactly zero in theory:
rounding leaves less, an eigenvalue on the axis taken for a stable one far more.
"""

SEMIDEFINITE = 1e-8
"""Negative eigenvalues below this fraction of the largest, or of one, count as zero, in units in
which the Hamiltonian matrix is balanced.
"""


ROUNDING = 1e-13
"""Entries of a difference below this fraction of its terms count as zero."""


def without_rounding(value: Array, terms: Array) -> Array:
    """Return a symmetric matrix, computed from sums of this size, with rounding errors set to zero.
    Balancing would raise them to solutions of either sign.
    """
    symmetric = 0.5 * (value + value.T)
    return np.where(np.abs(symmetric) > ROUNDING * np.maximum(terms, terms.T), symmetric, 0.0)


def stabilising(A: Array, R: Array, Q: Array) -> Array | None:
    """Return X = X' >= 0 of A'X + XA + XRX + Q = 0 with A + RX stable, or None where there is none.

    From the stable invariant subspace of the Hamiltonian matrix [A R; -Q -A'], balanced by a
    symplectic scaling, so that the units of the states play no part. R and Q may be indefinite.

    References
    ----------
    Laub, IEEE Trans. Automatic Control 24 (1979); scaling after Benner, Numer. Algorithms (2001).
    """
    n = len(A)
    if n == 0:
        return np.zeros((0, 0))
    H = np.block([[A, R], [-Q, -A.T]])
    if not np.all(np.isfinite(H)):
        return None
    size = np.abs(H)
    np.fill_diagonal(size, 0.0)
    with np.errstate(invalid="ignore"):  # of the permutation, which is not used
        _, (factors, _) = linalg.matrix_balance(size, permute=False, separate=True)
    exponents = np.log2(factors)
    units = 2.0 ** np.round(0.5 * (exponents[:n] - exponents[n:]))
    scale = np.concatenate([units, 1 / units])
    try:
        _, vectors, stable = linalg.schur(H * scale / scale[:, None], sort="lhp")  # type: ignore[misc]
    except np.linalg.LinAlgError:
        return None  # eigenvalues on the axis change sides as they are sorted
    if stable != n:
        return None
    X1, X2 = vectors[:n, :n], vectors[n:, :n]
    if np.abs(X1.T @ X2 - X2.T @ X1).max() > MAX_SUBSPACE_ERROR:
        return None
    try:
        X = np.linalg.solve(X1.T, X2.T)
    except np.linalg.LinAlgError:
        return None
    X = 0.5 * (X + X.T)
    if not np.all(np.isfinite(X)):
        return None
    values = np.linalg.eigvalsh(X)
    if values[0] < -SEMIDEFINITE * max(1.0, float(np.abs(values).max())):
        return None
    X = X / np.multiply.outer(units, units)
    return X if np.linalg.eigvals(A + R @ X).real.max() < 0 else None
