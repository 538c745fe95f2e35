"""The gain of an LPV model of several parameters as a user of cvxpy writes it: bounded real lemma
on a grid of the box, P affine in the parameters, every corner of the rates.

Nothing is said between grid points, and the solver's word is taken.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np


def gain(
    A: Sequence[np.ndarray], B: np.ndarray, C: np.ndarray, rate: float, points: int, solver: str
) -> float:
    """The bound on x' = (A[0] + p1 A[1] + ...) x + B u, y = C x, for p in [0, 1] and |dp/dt| <=
    `rate`, with `points` of the grid in each parameter; inf where the solver finds none.
    """
    n, m, parameters = len(A[0]), B.shape[1], len(A) - 1
    P = [cp.Variable((n, n), symmetric=True) for _ in A]
    square = cp.Variable(nonneg=True)
    constraints = []
    for p in itertools.product(np.linspace(0, 1, points), repeat=parameters):
        at = (1.0, *p)
        drift: np.ndarray = np.sum([w * M for w, M in zip(at, A, strict=True)], axis=0)
        value: Any = sum(w * M for w, M in zip(at, P, strict=True))
        constraints.append(value >> 1e-6 * np.eye(n))
        for signs in itertools.product((-rate, rate), repeat=parameters):
            slope = sum(v * M for v, M in zip(signs, P[1:], strict=True))
            top = drift.T @ value + value @ drift + slope + C.T @ C
            block = cp.bmat([[top, value @ B], [B.T @ value, -square * np.eye(m)]])
            constraints.append(0.5 * (block + block.T) << -1e-7 * np.eye(n + m))
    problem = cp.Problem(cp.Minimize(square), constraints)
    try:
        problem.solve(solver=solver)
    except cp.SolverError:
        return float("inf")
    return float("inf") if square.value is None else float(np.sqrt(square.value))
