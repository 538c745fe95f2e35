"""The gain of an LPV model as a user of cvxpy writes it: bounded real lemma on a grid, P a Legendre
polynomial, Clarabel.

Nothing is said between grid points, and the solver's word is taken.
"""

from __future__ import annotations

from collections.abc import Callable

import cvxpy as cp
import numpy as np
from numpy.polynomial import legendre

Matrices = Callable[[float], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]


def gain(
    matrices: Matrices, low: float, high: float, rate: float, degree: int = 6, points: int = 51
) -> tuple[float, float]:
    """(gain, seconds in the solver) of x' = A(p) x + B(p) u, y = C(p) x + D(p) u for |dp/dt| <=
    `rate` on `points` of [low, high].
    """
    A, B, C, D = matrices(low)
    n, m = B.shape
    P = [cp.Variable((n, n), symmetric=True) for _ in range(degree + 1)]
    square = cp.Variable(nonneg=True)
    slopes = [legendre.legder(np.eye(degree + 1)[i]) * 2 / (high - low) for i in range(degree + 1)]
    constraints = []
    for p in np.linspace(low, high, points):
        A, B, C, D = matrices(float(p))
        x = 2 * (p - low) / (high - low) - 1
        value = sum(legendre.legval(x, np.eye(degree + 1)[i]) * P[i] for i in range(degree + 1))
        slope = sum(legendre.legval(x, slopes[i]) * P[i] for i in range(degree + 1))
        constraints.append(value >> 1e-6 * np.eye(n))
        for sign in (-1, 1) if rate else (0,):
            top = A.T @ value + value @ A + sign * rate * slope + C.T @ C
            corner = D.T @ D - square * np.eye(m)
            M = cp.bmat([[top, value @ B + C.T @ D], [B.T @ value + D.T @ C, corner]])
            constraints.append(0.5 * (M + M.T) << -1e-7 * np.eye(n + m))
    problem = cp.Problem(cp.Minimize(square), constraints)
    problem.solve(solver=cp.CLARABEL)
    if square.value is None:
        return float("inf"), problem.solver_stats.solve_time or 0.0
    return float(np.sqrt(square.value)), problem.solver_stats.solve_time
