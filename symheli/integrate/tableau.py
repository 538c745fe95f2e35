"""Explicit Runge-Kutta methods as their coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False)
class Tableau:
    """k_s = f(x + h sum_j a[s, j] k_j), x_next = x + h sum_s b[s] k_s; a (stages, stages) strictly
    lower triangular, b (stages,).
    """

    a: Array
    b: Array

    @property
    def stages(self) -> int:
        """Evaluations a step."""
        return len(self.b)


def _tableau(rows: list[list[float]], b: list[float]) -> Tableau:
    a = np.zeros((len(b), len(b)))
    for s, row in enumerate(rows, 1):
        a[s, : len(row)] = row
    return Tableau(a, np.array(b))


CLASSICAL = _tableau([[1 / 2], [0, 1 / 2], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6])
"""Kutta's method of order 4."""

DORMAND_PRINCE = _tableau(
    [
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
    ],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
)
"""Order 5 of the pair of Dormand and Prince (1980), without the seventh stage, which only the error
estimate uses.
"""

DORMAND_PRINCE_ERROR = np.array(
    [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]
)
"""b of order 5 less b of order 4, seven stages: the last one is at the end of the step."""
