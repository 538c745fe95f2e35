"""Output feedback of an LPV plant as a user of cvxpy writes it: the existence conditions on a grid,
X constant, Y of some degree in p, both rates, Clarabel.

Nothing is said between grid points, the solver's word is taken, and there is no controller yet.
Source: Wu, Yang, Packard and Becker, Int. J. Robust and Nonlinear Control 6 (1996).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cvxpy as cp
import numpy as np
from scipy.linalg import null_space

DEGREE = 2


def gain(
    plant: Callable[[float], Any],
    low: float,
    high: float,
    rate: float,
    points: int = 11,
    degree: int = DEGREE,
) -> float:
    """The least gamma of the plant p -> (A, B1, B2, C1, C2, D11, D12, D21, D22) for |dp/dt| <=
    `rate` (any, where Y is of degree 0), inf where the solver finds none.
    """
    n = len(plant(low).A)
    X = cp.Variable((n, n), symmetric=True)
    Ys = [cp.Variable((n, n), symmetric=True) for _ in range(degree + 1)]
    gamma = cp.Variable()
    constraints = []
    for p in np.linspace(low, high, points):
        s = (p - low) / (high - low)
        Y = sum(s**i * Ys[i] for i in range(degree + 1))
        slope = sum(i * s ** (i - 1) / (high - low) * Ys[i] for i in range(1, degree + 1))
        P = plant(float(p))
        nw, nz = P.D11.shape[1], P.D11.shape[0]
        one = np.eye(n)
        both = cp.bmat([[X, one], [one, Y]])
        constraints.append(0.5 * (both + both.T) >> 1e-6 * np.eye(2 * n))
        w, z = gamma * np.eye(nw), gamma * np.eye(nz)
        N = _blank(np.hstack([P.C2, P.D21]), nz)
        M = cp.bmat(
            [
                [X @ P.A + P.A.T @ X, X @ P.B1, P.C1.T],
                [P.B1.T @ X, -w, P.D11.T],
                [P.C1, P.D11, -z],
            ]
        )
        constraints.append(_negative(N, M))
        N = _blank(np.hstack([P.B2.T, P.D12.T]), nw)
        for v in (-rate, rate) if degree else (0.0,):
            M = cp.bmat(
                [
                    [P.A @ Y + Y @ P.A.T - v * slope, Y @ P.C1.T, P.B1],
                    [P.C1 @ Y, -z, P.D11],
                    [P.B1.T, P.D11.T, -w],
                ]
            )
            constraints.append(_negative(N, M))
    problem = cp.Problem(cp.Minimize(gamma), constraints)
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return float("inf")
    return float("inf") if gamma.value is None else float(gamma.value)


def _blank(rows: np.ndarray, more: int) -> np.ndarray:
    N = null_space(rows)
    return np.block([[N, np.zeros((len(N), more))], [np.zeros((more, N.shape[1])), np.eye(more)]])


def _negative(N: np.ndarray, M: Any) -> Any:
    inner = N.T @ M @ N
    return 0.5 * (inner + inner.T) << -1e-7 * np.eye(N.shape[1])
