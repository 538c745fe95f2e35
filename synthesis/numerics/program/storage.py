"""A storage function of a frozen model that dissipates strictly, from a Riccati equation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import linalg

from symheli.lpv.riccati import stabilising
from symheli.values.arrays import Array
from synthesis.numerics.linear.norm import to_continuous
from synthesis.numerics.polynomial.symmetric import powered, symmetrized

MIN_DISSIPATION = 1e-12
"""Least dissipation, as a fraction of the rates of the states."""
NEWTON_STEPS = 2
"""Number of Newton steps that correct the Schur solution where rates are far apart."""
MAX_CHANGES = 3
"""Largest number of changes of coordinates, each to those of the last storage function."""
MAX_CONDITION = 100.0
"""Condition number of P below which the coordinates are kept."""
REDUCTION = 8.0
"""Factor by which the dissipation is reduced until a solution exists, and once more from there."""


class Storage(NamedTuple):
    """A storage function V = z'z of x = T z: with the supply rate level^2 |u|^2 - |y|^2, V
    decreases by z'Wz more than is supplied, per unit of time or sample.
    """

    T: Array
    W: Array


def strict_storage(
    A: Array, B: Array, C: Array, D: Array, level: float, *, discrete: bool
) -> Storage | None:
    """Return a storage function of a model whose norm is below `level`, near the centre of the set
    of all; None where rounding leaves none.

    W is as large a share of the pace of the states as the level allows. By convexity a share t of
    W costs at most the share t of what the level is above the norm.
    """
    into = np.eye(len(A))
    if discrete:
        into = _midway(A)
        A, B, C, D = to_continuous(A, B, C, D)
    T, found = np.eye(len(A)), None
    for _ in range(MAX_CHANGES):
        own = _strict(linalg.solve(T, A @ T), linalg.solve(T, B), C @ T, D, level)
        if own is None:
            break
        P, W = own
        step = powered(P, -0.5)
        T, found = T @ step, Storage(T @ step, symmetrized(step @ W @ step))
        if np.linalg.cond(P) < MAX_CONDITION:
            break
    if found is None:
        return None
    back = linalg.solve(found.T, into @ found.T)
    return found._replace(W=symmetrized(back.T @ found.W @ back))


def least_storage(
    A: Array, B: Array, C: Array, D: Array, level: float, W: Array, *, discrete: bool
) -> Array | None:
    """Return the least P of a storage function that dissipates W at this level, None where there is
    none.
    """
    if discrete:
        back = linalg.inv(_midway(A))
        return _least(*to_continuous(A, B, C, D), level, symmetrized(back.T @ W @ back))
    return _least(A, B, C, D, level, W)


def _midway(A: Array) -> Array:
    """Return the continuous model of the same norm and P for the state of a discrete one."""
    return (A + np.eye(len(A))) / math.sqrt(2.0)


def _strict(A: Array, B: Array, C: Array, D: Array, level: float) -> tuple[Array, Array] | None:
    """Return P and W."""
    pace = _pace(A)
    share = 1.0
    while share > MIN_DISSIPATION:
        if _least(A, B, C, D, level, share * pace) is not None:
            W = share / REDUCTION * pace
            P = _least(A, B, C, D, level, W)
            return (P, W) if P is not None and linalg.eigvalsh(P)[0] > 0 else None
        share /= REDUCTION
    return None


def _least(A: Array, B: Array, C: Array, D: Array, level: float, W: Array) -> Array | None:
    """Return the least P with A'P + PA + C'C + W + (PB + C'D) R^-1 (PB + C'D)' = 0, R = level^2 -
    D'D.
    """
    R = level**2 * np.eye(D.shape[1]) - D.T @ D
    if linalg.eigvalsh(R)[0] <= 0:
        return None
    RB, RD = np.linalg.solve(R, B.T), np.linalg.solve(R, D.T @ C)
    F, G, Q = A + B @ RD, B @ RB, C.T @ C + C.T @ D @ RD + W
    X = stabilising(F, G, Q)
    if X is None:
        return None
    for _ in range(NEWTON_STEPS):
        residual = symmetrized(X @ F + F.T @ X + X @ G @ X + Q)
        X = symmetrized(X + linalg.solve_continuous_lyapunov((F + G @ X).T, -residual))
    return X


def _pace(A: Array) -> Array:
    """Return (A'A)^1/2, the rates of the states."""
    _, values, directions = linalg.svd(A)
    values = np.maximum(values, 1e-13 * values[0])
    return symmetrized((directions.T * values) @ directions)
