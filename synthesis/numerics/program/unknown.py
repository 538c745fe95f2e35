"""Symmetric matrices that are unknown functions of the scheduling parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli.lpv.bases import FunctionSpace
from symheli.values.arrays import Array
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks


@dataclass(frozen=True, eq=False)
class UnknownFunction:
    """X(p) = sum_j f_j(p) X_j with the functions of `basis`; X_0 is unknown number `first` of the
    program.
    """

    basis: FunctionSpace
    first: int

    @property
    def columns(self) -> Array:
        """Indices (k,) of its coefficients."""
        return self.first + np.arange(self.basis.size)

    @property
    def moves(self) -> bool:
        """Whether it depends on p."""
        return self.basis.size > 1

    def values(self, p: Array) -> Array:
        """Return the functions (K, k) at p (K, m)."""
        return self.basis(_own(p))

    def gradient(self, p: Array) -> Array:
        """Return their derivatives (K, k, m) by each parameter."""
        if not self.moves:
            return np.zeros((len(p), 1, p.shape[1]))
        return np.swapaxes(self.basis.gradient(_own(p)), 1, 2)

    def slopes(self, p: Array, rates: Array) -> Array:
        """Return their derivatives (K, k) along the motion dp/dt = `rates` (m,) or (K, m)."""
        return np.einsum("kjm,km->kj", self.gradient(p), np.broadcast_to(rates, p.shape))

    def at(self, coefficients: Array, p: Array) -> Array:
        """Return X (K, n, n) at p (K, m) from all coefficients of the program."""
        return np.tensordot(self.values(p), coefficients[self.columns], axes=1)

    def moving(self, coefficients: Array, p: Array, rates: Array) -> Array:
        """Return dX/dt (K, n, n)."""
        return np.tensordot(self.slopes(p, rates), coefficients[self.columns], axes=1)


class BlockTerms:
    """Blocks F(p) = sum of left' X(p) right(p) and its transpose + constant - g level, for each of
    `motions` ways in which p may move at each of `count` points, collected term by term.
    """

    def __init__(self, size: int, count: int, motions: int = 1):
        self.shape = (motions, count, size, size)
        self.terms: list[tuple[Array, Array, Array, Array]] = []

    def add(
        self, unknown: UnknownFunction, weights: Array, left: Array, right: Array
    ) -> BlockTerms:
        """Add left (n, N)' X right with `weights` (K, k) of the functions of X; right (n, N), (K,
        n, N) or (motions, K, n, N).
        """
        self.terms.append((unknown.columns, weights, left, right))
        return self

    def finished(self, constant: Array | float, level: Array | float) -> LyapunovBlocks:
        """Return the blocks with the given constant and level: (K, N, N) or (N, N)."""
        motions, count, size, _ = self.shape
        lefts: list[Array] = []
        where = [_place(lefts, left) for _, _, left, _ in self.terms]
        n = lefts[0].shape[0]
        columns = np.unique(np.concatenate([c for c, *_ in self.terms]))
        weights = np.zeros((count, len(columns), len(self.terms)))
        varying = np.zeros((motions, count, len(lefts), len(self.terms), n, size))
        for a, ((own, values, _, right), r) in enumerate(zip(self.terms, where, strict=True)):
            weights[:, np.searchsorted(columns, own), a] = values
            varying[:, :, r, a] = right
        every = (motions * count, size, size)
        return LyapunovBlocks(
            columns,
            np.stack(lefts),
            varying.reshape(-1, *varying.shape[2:]),
            np.broadcast_to(constant, self.shape).reshape(every),
            level=np.broadcast_to(level, self.shape).reshape(every),
            weights=weights,
        )


def _place(lefts: list[Array], left: Array) -> int:
    for i, known in enumerate(lefts):
        if known is left:
            return i
    lefts.append(left)
    return len(lefts) - 1


def _own(p: Array) -> Array:
    return p[:, 0] if p.shape[1] == 1 else p


def selector(rows: int, start: int, size: int) -> Array:
    """Return [0 I 0] (rows, size) that takes `rows` entries from `start` on."""
    out = np.zeros((rows, size))
    out[:, start : start + rows] = np.eye(rows)
    return out


def unknowns(bases: Sequence[FunctionSpace]) -> list[UnknownFunction]:
    """Return the unknown functions, one after the other in a program."""
    firsts = np.cumsum([0, *(b.size for b in bases)])
    return [UnknownFunction(b, int(f)) for b, f in zip(bases, firsts, strict=False)]
