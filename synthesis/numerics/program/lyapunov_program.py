"""Semidefinite programs whose blocks are linear in P by products with given matrices, as those of
Lyapunov and Riccati inequalities are.

Kept as those products, a block of N rows takes n N numbers for each coefficient of P and not n^2
N^2/4, and an interior-point method only needs a few products of matrices with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from symheli.values.arrays import Array

MANY_STATES = 12
"""Number of states above which fewer coefficients of P are tried."""
MAX_STATES_GENERAL = 9
"""Number of states up to which a general solver is as fast."""


class Sizes(NamedTuple):
    """Sizes of a program: `states`, and the inputs d of a block, which are held below a margin;
    `inputs` u, to which g belongs; coefficients of P (`unknowns`) and of the multiplier.
    """

    states: int
    inputs: int
    unknowns: int
    perturbations: int = 0
    multipliers: int = 0

    @property
    def strict(self) -> int:
        """Rows of a block that are held below a margin."""
        return self.states + self.perturbations

    @property
    def rows(self) -> int:
        """Rows of a block."""
        return self.strict + self.inputs


class Supplied(NamedTuple):
    """Supply rate of a norm-bounded block, sum_j each[., j] multipliers[columns[j]], added to F:
    `columns` (k,), `each` (m, k, N, N).
    """

    columns: Array
    each: Array

    def matrices(self, multipliers: Array) -> Array:
        """The sum (m, N, N) at the coefficients of the whole multiplier."""
        return np.einsum("j,mjab->mab", multipliers[self.columns], self.each)

    def add_adjoint(self, Z: Array, out: Array) -> None:
        """Add to `out`, of the length of the multiplier, the contribution to <Z, matrices(.)>."""
        out[self.columns] += np.einsum("mjab,mab->j", self.each, Z)


class LyapunovBlocks(NamedTuple):
    """LMI blocks F = sum_ra (fixed_r' Q_a varying_ra + its transpose) + constant - g diag(0, I).

    The Q_a are the matrices that a block is linear in: sum_j weights_ja P_columns[j], as P and its
    derivatives at a point are, however many coefficients P has. `columns` (k,) says which
    coefficients are involved, `weights` (G, k, A) how, at G places, None where Q_j = P_columns[j]
    in all blocks. `fixed` (R, n, N) are the same in all m blocks, `varying` (m, R, A, n, N) are
    not; `constant` (m, N, N). Block i stands at place i mod G.

    `symmetric`: each sum over r is, without its transpose. `supply`: what a norm-bounded block adds
    to F, None without one. `level` (m, N, N) or (N, N): where g stands instead, None for diag(0,
    I).
    """

    columns: Array
    fixed: Array
    varying: Array
    constant: Array
    symmetric: bool = False
    supply: Supplied | None = None
    level: Array | None = None
    weights: Array | None = None

    @property
    def places(self) -> int:
        """Number G of different tuples of matrices Q."""
        return 1 if self.weights is None else len(self.weights)

    def linear(self, P: Array) -> Array:
        """The part (m, N, N) linear in P, at the coefficients P (k', n, n) of the whole spline."""
        m, R, A, n, N = self.varying.shape
        P = P[self.columns]
        Q = P[None] if self.weights is None else np.tensordot(self.weights, P, axes=(1, 0))
        beside = np.swapaxes(Q, 1, 2).reshape(-1, 1, n, A * n)  # [Q_1 Q_2 ...]
        inner = beside @ self.varying.reshape(-1, self.places, R, A * n, N)
        half = self.fixed.reshape(R * n, N).T @ inner.reshape(m, R * n, N)
        return half + np.swapaxes(half, -1, -2)

    def adjoint(self, Z: Array) -> Array:
        """Matrices (k, n, n) with sum <Z, linear(P)> = sum_j <., P_columns[j]>, Z (m, N, N)."""
        m, R, A, n, N = self.varying.shape
        right = (Z @ self.fixed.reshape(R * n, N).T).reshape(m, N, R, n)
        each = self.varying.reshape(m, R, A * n, N) @ np.swapaxes(right, 1, 2)
        half = each.reshape(-1, self.places, R, A, n, n).sum(axis=(0, 2))
        if self.weights is None:
            half = half[0]
        else:
            half = np.tensordot(self.weights, half, axes=((0, 2), (0, 1)))
        return half + np.swapaxes(half, -1, -2)

    def by_coefficients(self) -> LyapunovBlocks:
        """Return the same blocks with the coefficients themselves for the matrices Q, without
        weights.
        """
        if self.weights is None:
            return self
        m, R, A, n, N = self.varying.shape
        k = len(self.columns)
        wide = self.varying.reshape(-1, self.places, R, A, n * N)
        wide = self.weights[:, None] @ wide
        return self._replace(varying=wide.reshape(m, R, k, n, N), weights=None)

    def keep(self, which: Array) -> LyapunovBlocks:
        """Return these blocks only, places with all their blocks once; without a level of their
        own.
        """
        weights = self.weights
        if weights is not None:
            each = which.reshape(-1, len(weights))
            whole = bool(np.all(each == each[0]))
            weights = weights[each[0] if whole else np.nonzero(each)[1]]
        supply = self.supply
        return self._replace(
            varying=self.varying[which],
            constant=self.constant[which],
            supply=supply and supply._replace(each=supply.each[which]),
            weights=weights,
        )

    def congruent(self, W: Array) -> LyapunovBlocks:
        """W' F W for every F, W (N, N) not acting on the part with g."""
        return self._replace(
            fixed=self.fixed @ W,
            varying=self.varying @ W,
            constant=W.T @ self.constant @ W,
            supply=self.supply and self.supply._replace(each=W.T @ self.supply.each @ W),
        )


class Program(Protocol):
    """The problem: minimise cost g subject to every block F <= -back_off, F with g `level` where a
    block has no level of its own, and sign P + constant I >= 0 for every coefficient of P and every
    (sign, constant) of the `bounds`.
    """

    @property
    def blocks(self) -> tuple[LyapunovBlocks, ...]:
        """The inequalities."""
        ...

    @property
    def sizes(self) -> Sizes:
        """Sizes of the program."""
        ...

    @property
    def places(self) -> int:
        """Number of points at which every kind of block is imposed, the last index of its order."""
        ...

    @property
    def cost(self) -> float:
        """Coefficient of the level in the objective."""
        ...

    @property
    def level(self) -> Array:
        """Matrix by which one unit of g relaxes a block that has no level of its own."""
        ...

    @property
    def back_off(self) -> Array:
        """Matrix by which a block stays below zero."""
        ...

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Pairs (sign, constant) of every sign P + constant I >= 0."""
        ...


@dataclass(frozen=True, eq=False)
class LyapunovProgram:
    """The problem: minimise g subject to every block <= -margin diag(I, 0) and every coefficient of
    P >= floor I (free where that is None), every one of a multiplier >= 0.

    Without inputs: maximise t subject to blocks <= -t I and 0 <= P <= I; t > 0 proves stability.
    """

    blocks: tuple[LyapunovBlocks, ...]
    sizes: Sizes
    margin: float
    floor: float | None

    @property
    def places(self) -> int:
        """One: a program of other cells has other blocks."""
        return 1

    @property
    def cost(self) -> float:
        """Coefficient of the level, g or t, in the objective."""
        return 1.0 if self.sizes.inputs else -1.0

    @property
    def level(self) -> Array:
        """Matrix (N, N) by which one unit of the level relaxes a block."""
        n, m = self.sizes.strict, self.sizes.inputs
        return np.diag(np.r_[np.zeros(n), np.ones(m)]) if m else -np.eye(n)

    @property
    def back_off(self) -> Array:
        """Matrix (N, N) by which a block stays below zero."""
        n, m = self.sizes.strict, self.sizes.inputs
        return self.margin * np.diag(np.r_[np.ones(n), np.zeros(m)]) if m else np.zeros((n, n))

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """(sign, constant) of every sign P + constant I >= 0."""
        if not self.sizes.inputs:
            return ((1.0, 0.0), (-1.0, 1.0))
        return () if self.floor is None else ((1.0, -self.floor),)
