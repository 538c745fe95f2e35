"""Stabilising solutions of algebraic Riccati equations, believed only after their properties were
checked.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

Array = np.ndarray

SYMMETRIC = 1e-6
"""How far from symmetric, beside its size, a solution may come out: rounding leaves less, a
subspace that is not the stable one far more.
"""

SEMIDEFINITE = 1e-8
"""Negative eigenvalues below this part of the largest are zero."""


def stabilising(A: Array, R: Array, Q: Array) -> Array | None:
    """X = X' of A'X + XA + XRX + Q = 0 with A + RX stable, or None where there is none.

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
    if np.linalg.norm(X1.T @ X2 - X2.T @ X1, 2) > SYMMETRIC * np.linalg.norm(X1.T @ X2, 2):
        return None  # not isotropic: eigenvalues on the axis were split
    try:
        X = np.linalg.solve(X1.T, X2.T)
    except np.linalg.LinAlgError:
        return None
    X = 0.5 * (X + X.T) / np.multiply.outer(units, units)
    if not np.all(np.isfinite(X)) or np.linalg.eigvals(A + R @ X).real.max() >= 0:
        return None
    return X


def is_semidefinite(X: Array) -> bool:
    """Whether a symmetric matrix is positive semidefinite, to rounding."""
    values = np.linalg.eigvalsh(X)
    return not len(values) or bool(values[0] >= -SEMIDEFINITE * np.abs(values).max())
