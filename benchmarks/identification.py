"""One recursive update that yields the coefficients (two inputs, four outputs): square-root RLS against covariance RLS in NumPy."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path[0] = str(Path(__file__).resolve().parents[1])  # this folder holds scripts named like the packages they measure

from benchmarks.timing import arguments, medians, show  # noqa: E402
from identification import LPVARX, Polynomial, RecursiveLeastSquares  # noqa: E402

CALLS = 100


class CovarianceRLS:
    """The textbook update of P, as users write it (loses positive definiteness with raw monomials; see the tests)."""

    def __init__(self, n: int, outputs: int):
        self.P, self.theta = 1e6 * np.eye(n), np.zeros((n, outputs))

    def update(self, phi: np.ndarray, y: np.ndarray) -> np.ndarray:
        Pphi = self.P @ phi
        gain = Pphi / (1.0 + phi @ Pphi)
        self.theta = self.theta + np.outer(gain, y - phi @ self.theta)
        self.P = self.P - np.outer(gain, Pphi)
        return self.theta


def main() -> None:
    options = arguments(__doc__)
    arx = LPVARX(("a", "b", "c", "d"), ("u", "v"), "p", 3, 3, 1, Polynomial(2, 0.0, 13.0))
    rng = np.random.default_rng(0)
    rows, y = rng.standard_normal((2000, arx.n_regressors)), rng.standard_normal((2000, 4))
    rls = RecursiveLeastSquares(arx)
    state = rls.init()
    for k in range(500):
        state, _ = rls.absorb(state, rows[k], y[k])
    other = CovarianceRLS(arx.n_regressors, 4)
    for k in range(500):
        other.update(rows[k], y[k])

    def ours() -> None:
        nonlocal state
        for k in range(500, 500 + CALLS):
            state, _ = rls.absorb(state, rows[k], y[k])

    def theirs() -> None:
        for k in range(500, 500 + CALLS):
            other.update(rows[k], y[k])

    times = medians({"square-root RLS (NumPy)": ours, "covariance RLS (NumPy)": theirs}, 2.0 if options.quick else 10.0)
    times = {f"{name}, one update": t / CALLS for name, t in times.items()}
    first, second = times.values()
    show(options, times, {"covariance RLS / square-root RLS (above 1: ours is faster)": second / first})


if __name__ == "__main__":
    main()
