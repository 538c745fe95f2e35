"""Semidefinite programs whose blocks are linear in P by products with given matrices, as those of
Lyapunov and Riccati inequalities are.

Kept as those products, a block of N rows takes n N numbers for each coefficient of P and not n^2
N^2/4, and all that an interior-point method asks of it is a few products of matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

Array = np.ndarray

MANY = 12
"""States beyond which a P costs a general solver minutes."""


class LyapunovBlocks(NamedTuple):
    """LMI blocks F = sum_jr (fixed_r' P_columns[j] varying_jr + its transpose) + constant - g
    diag(0, I).

    `columns` (k,) says which coefficients of P are involved; `fixed` (R, n, N) are the same in all
    m blocks, `varying` (m, k, R, n, N) are not; `constant` (m, N, N). `symmetric`: each sum over r
    is, without its transpose.
    """

    columns: Array
    fixed: Array
    varying: Array
    constant: Array
    symmetric: bool = False

    def linear(self, P: Array) -> Array:
        """The part (m, N, N) linear in P, at the coefficients P (k', n, n) of the whole spline."""
        inner = P[self.columns][:, None] @ self.varying
        half = (np.swapaxes(self.fixed, -1, -2) @ inner).sum(axis=(1, 2))
        return half + np.swapaxes(half, -1, -2)

    def adjoint(self, Z: Array) -> Array:
        """Matrices (k, n, n) with sum <Z, linear(P)> = sum_j <., P_columns[j]>, Z (m, N, N)."""
        half = (self.varying @ Z[:, None, None] @ np.swapaxes(self.fixed, -1, -2)).sum(axis=(0, 2))
        return half + np.swapaxes(half, -1, -2)

    def congruent(self, W: Array) -> LyapunovBlocks:
        """W' F W for every F, W (N, N) not acting on the part with g."""
        return self._replace(
            fixed=self.fixed @ W, varying=self.varying @ W, constant=W.T @ self.constant @ W
        )


@dataclass(frozen=True, eq=False)
class LyapunovProgram:
    """minimise g subject to every block <= -margin diag(I, 0) and every coefficient of P >= floor
    I.

    Without inputs: maximise t subject to blocks <= -t I and 0 <= P <= I; t > 0 proves stability.
    There are `unknowns` coefficients of P.
    """

    blocks: tuple[LyapunovBlocks, ...]
    states: int
    inputs: int
    unknowns: int
    margin: float
    floor: float

    @property
    def cost(self) -> float:
        """Of the level, g or t, in what is minimised."""
        return 1.0 if self.inputs else -1.0

    @property
    def level(self) -> Array:
        """Matrix (N, N) by which one unit of the level relaxes a block."""
        n, m = self.states, self.inputs
        return np.diag(np.r_[np.zeros(n), np.ones(m)]) if m else -np.eye(n)

    @property
    def back_off(self) -> Array:
        """Matrix (N, N) by which a block stays below zero."""
        n, m = self.states, self.inputs
        return self.margin * np.diag(np.r_[np.ones(n), np.zeros(m)]) if m else np.zeros((n, n))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """(sign, constant) of every sign P + constant I >= 0."""
        return ((1.0, -self.floor),) if self.inputs else ((1.0, 0.0), (-1.0, 1.0))
