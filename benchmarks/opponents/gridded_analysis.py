"""The L2 gain of an LPV model on a grid with bounded rate, as written in cvxpy from a textbook; run
as a program it says what it cost.
"""

from __future__ import annotations

import json
import resource
import sys
import time

import numpy as np

STATES, POINTS, DEGREE = 5, 11, 2


def model(p: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A (5, 5), B (5, 2), C (2, 5) at p in [0, 1]: stable at every p, quadratic in p, from a fixed
    seed.
    """
    rng = np.random.default_rng(0)
    parts = [0.3 * rng.standard_normal((STATES, STATES)) for _ in range(3)]
    A = -2.0 * np.eye(STATES) + parts[0] + p * parts[1] + p**2 * parts[2]
    return A, rng.standard_normal((STATES, 2)), rng.standard_normal((2, STATES))


def gain(rate: float) -> float:
    """The bound on the grid with P(p) quadratic in p and |dp/dt| <= rate, per second (unproven
    between the points).
    """
    import cvxpy as cp

    parts = [cp.Variable((STATES, STATES), symmetric=True) for _ in range(DEGREE + 1)]
    squared = cp.Variable()
    constraints = []
    for p in np.linspace(0, 1, POINTS):
        A, B, C = model(p)
        P = sum(p**i * parts[i] for i in range(DEGREE + 1))
        slope = sum(i * p ** (i - 1) * parts[i] for i in range(1, DEGREE + 1))
        constraints.append(P >> 1e-6 * np.eye(STATES))
        for v in (-rate, rate):
            block = cp.bmat(
                [[A.T @ P + P @ A + v * slope + C.T @ C, P @ B], [B.T @ P, -squared * np.eye(2)]]
            )
            constraints.append(0.5 * (block + block.T) << 0)
    problem = cp.Problem(cp.Minimize(squared), constraints)
    problem.solve(solver="CLARABEL")
    return float(np.sqrt(squared.value))


def main() -> None:
    """Two analyses; time of the second (s), growth of the process over the imports (bytes)."""
    import clarabel  # noqa: F401
    import cvxpy  # noqa: F401

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    gain(1.0)
    begin = time.process_time()
    value = gain(1.0)
    spent = time.process_time() - begin
    unit = 1 if sys.platform == "darwin" else 1024
    print(
        json.dumps(
            {
                "gain": value,
                "seconds": spent,
                "bytes": unit * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before),
            }
        )
    )


if __name__ == "__main__":
    main()
