"""Stabilising solutions of algebraic Riccati equations, accepted only if their properties hold, the
linear-quadratic regulator that they give, and Lyapunov equations.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli.errors import InputError
from symheli.lpv.modes import hidden_modes, on_the_border, unstable
from symheli.values.arrays import Array, frozen

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


def lyapunov(A: Array, Q: Array, dt: float | None) -> Array:
    """Return X of AX + XA' + Q = 0, with a sample period of AXA' - X + Q = 0."""
    if dt is None:
        return linalg.solve_continuous_lyapunov(A, -Q)
    return linalg.solve_discrete_lyapunov(A, Q)


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


class Regulator(NamedTuple):
    """The control u = -K x of the least cost x'Xx, and the weight R of u in the Riccati equation.

    Of a sampled model that weight is the given one and B'XB.
    """

    K: Array
    X: Array
    R: Array


def regulator(
    A: Array,
    B: Array,
    Q: Array,
    R: Array,
    N: Array | None = None,
    dt: float | None = None,
    *,
    terms: Array | None = None,
) -> Regulator:
    """Return the linear-quadratic regulator of dx/dt = Ax + Bu, with a sample period of x(k+1) = Ax
    + Bu: the least integral or sum of x'Qx + 2x'Nu + u'Ru.

    A Kalman filter is the regulator of A', C', W, V, whose K' is the filter's gain. `terms` (n, n)
    are sizes of the sums that Q was computed from, default Q's own.

    Raises `InputError` for matrices that do not fit, and where no solution stabilises, with the
    reason.
    """
    n, m = np.shape(B)
    S = np.zeros((m, n)) if N is None else N.T
    shapes = {"A": (A, n, n), "B": (B, n, m), "Q": (Q, n, n), "R": (R, m, m), "N": (S.T, n, m)}
    for name, (M, *shape) in shapes.items():
        frozen(M, name, shape)
    try:
        if dt is None:
            inverse = np.linalg.inv(R)
            sizes = np.abs(Q) if terms is None else terms
            rest = without_rounding(
                Q - S.T @ inverse @ S, sizes + np.abs(S).T @ np.abs(inverse) @ np.abs(S)
            )
            X = stabilising(A - B @ inverse @ S, -B @ inverse @ B.T, rest)
            if X is not None:
                return Regulator(inverse @ (S + B.T @ X), X, R)
        else:
            with np.errstate(all="ignore"):
                X = linalg.solve_discrete_are(A, B, Q, R, s=N)
            whole = R + B.T @ X @ B
            K = np.linalg.solve(whole, B.T @ X @ A + S)
            if np.abs(np.linalg.eigvals(A - B @ K)).max(initial=0.0) < 1:
                return Regulator(K, X, whole)
    except (np.linalg.LinAlgError, ValueError):
        pass
    raise InputError(f"no linear-quadratic regulator: {_obstacle(A, B, Q, R, S, dt)}")


def _obstacle(A: Array, B: Array, Q: Array, R: Array, S: Array, dt: float | None) -> str:
    """Return why no solution stabilises, with what to change."""
    sampled = dt is not None
    for mode in hidden_modes(A.T, B.T, partial(unstable, sampled=sampled)):
        return (
            f"the mode {mode.place(dt)} is not stable and no control moves it; add a control that"
            " drives it, or leave it out"
        )
    if len(R) and np.linalg.eigvalsh(R)[0] <= 0:
        return "R is not positive definite; give every control a weight > 0"
    inverse = np.linalg.inv(R)
    own, weight = A - B @ inverse @ S, Q - S.T @ inverse @ S
    if len(Q) and np.linalg.eigvalsh(weight)[0] < -SEMIDEFINITE * np.abs(Q).max():
        return "the weight [Q N; N' R] is indefinite; give larger weights of the states"
    for mode in hidden_modes(own, weight, partial(on_the_border, sampled=sampled)):
        return (
            f"the mode {mode.place(dt)} is on the border of stability and has no weight; give the"
            " states that move in it one"
        )
    return "rounding leaves no solution; bring states and controls to units of similar size"
