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


@dataclass(frozen=True, eq=False)
class EmbeddedTableau(Tableau):
    """A method of order 5 that is followed, and weights `lower` (stages,) of one of order 4 with
    the same stages; stage `at_end` lies at the end of the step.
    """

    lower: Array
    at_end: int

    @property
    def error(self) -> Array:
        """Weights of the difference (stages,)."""
        return self.b - self.lower


def _pair(
    rows: list[list[float]], b: list[float], lower: list[float], at_end: int
) -> EmbeddedTableau:
    plain = _tableau(rows, b)
    return EmbeddedTableau(plain.a, plain.b, np.array(lower), at_end)


CLASSICAL = _tableau([[1 / 2], [0, 1 / 2], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6])
"""Kutta's method of order 4."""

DORMAND_PRINCE = _pair(
    [
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0],
    [5179 / 57600, 0, 7571 / 16695, 393 / 640, -92097 / 339200, 187 / 2100, 1 / 40],
    at_end=6,
)
"""The pair of Dormand and Prince (1980): its seventh stage is the end of the step."""

CASH_KARP = _pair(
    [
        [1 / 5],
        [3 / 40, 9 / 40],
        [3 / 10, -9 / 10, 6 / 5],
        [-11 / 54, 5 / 2, -70 / 27, 35 / 27],
        [1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096],
    ],
    [37 / 378, 0, 250 / 621, 125 / 594, 0, 512 / 1771],
    [2825 / 27648, 0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4],
    at_end=4,
)
"""The pair of Cash and Karp (1990)."""
