"""Symmetric matrices that are unknown functions of the scheduling parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli.lpv import FunctionSpace
from synthesis.program.lyapunov_program import LyapunovBlocks

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Unknown:
    """X(p) = sum_j f_j(p) X_j with the functions of `basis`; X_0 is unknown number `first` of the
    program.
    """

    basis: FunctionSpace
    first: int

    @property
    def columns(self) -> Array:
        """Numbers (k,) of its coefficients."""
        return self.first + np.arange(self.basis.size)

    @property
    def moves(self) -> bool:
        """Whether it depends on p."""
        return self.basis.size > 1

    def values(self, p: Array) -> Array:
        """The functions (K, k) at p (K, m)."""
        return self.basis(_own(p))

    def slopes(self, p: Array, rates: Array) -> Array:
        """Their derivatives (K, k) along the motion dp/dt = `rates` (m,) or (K, m)."""
        if not self.moves:
            return np.zeros((len(p), 1))
        return np.einsum(
            "kmj,km->kj", self.basis.gradient(_own(p)), np.broadcast_to(rates, p.shape)
        )

    def at(self, coefficients: Array, p: Array) -> Array:
        """X (K, n, n) at p (K, m) from all coefficients of the program."""
        return np.tensordot(self.values(p), coefficients[self.columns], axes=1)

    def moving(self, coefficients: Array, p: Array, rates: Array) -> Array:
        """dX/dt (K, n, n)."""
        return np.tensordot(self.slopes(p, rates), coefficients[self.columns], axes=1)


class Blocks:
    """Blocks F(p) = sum of left' X(p) right(p) and its transpose + constant - g level, one for each
    of `count` points p, collected term by term.
    """

    def __init__(self, size: int, count: int):
        self.shape = (count, size, size)
        self.terms: list[tuple[Array, Array, Array]] = []

    def add(self, unknown: Unknown, weights: Array, left: Array, right: Array) -> Blocks:
        """left (n, N)' X right (K, n, N) or (n, N), X with `weights` (K, k) of its functions."""
        wide = np.broadcast_to(right, (len(weights), *right.shape[-2:]))
        self.terms.append((unknown.columns, left, weights[:, :, None, None] * wide[:, None]))
        return self

    def finished(self, constant: Array | float, level: Array | float) -> LyapunovBlocks:
        """With what is known: (K, N, N) or (N, N)."""
        lefts: list[Array] = []
        where = [_place(lefts, left) for _, left, _ in self.terms]
        columns = np.unique(np.concatenate([c for c, _, _ in self.terms]))
        n = lefts[0].shape[0]
        varying = np.zeros((self.shape[0], len(columns), len(lefts), n, self.shape[1]))
        for (own, _, values), r in zip(self.terms, where, strict=True):
            varying[:, np.searchsorted(columns, own), r] += values
        return LyapunovBlocks(
            columns,
            np.stack(lefts),
            varying,
            np.broadcast_to(constant, self.shape),
            level=np.broadcast_to(level, self.shape),
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
    """[0 I 0] (rows, size) that takes `rows` entries from `start` on."""
    out = np.zeros((rows, size))
    out[:, start : start + rows] = np.eye(rows)
    return out


def unknowns(bases: Sequence[FunctionSpace]) -> list[Unknown]:
    """One after the other in a program."""
    firsts = np.cumsum([0, *(b.size for b in bases)])
    return [Unknown(b, int(f)) for b, f in zip(bases, firsts, strict=False)]
