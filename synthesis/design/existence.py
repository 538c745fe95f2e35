"""Whether there is a controller: the two halves of `elimination` and what couples them, as a
program for every p of the range.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import FunctionSpace
from symheli.lpv.bases.polynomials import factors_of
from symheli.values.numbers import whole
from synthesis.design.cells import Cell, cells, degrees_of
from synthesis.design.coordinates import Coordinates
from synthesis.design.elimination import Half, controlled, observed
from synthesis.design.motions import motions, moves, used
from synthesis.design.unknown import Blocks, Unknown, selector, unknowns
from synthesis.polynomial.symmetric import length, smat
from synthesis.program import interior_point
from synthesis.program.cone_program import Solver
from synthesis.program.lyapunov_program import LyapunovBlocks, Sizes

Array = np.ndarray

LARGEST = 1e6
"""X and Y are kept below this multiple of the identity, in scaled coordinates."""
WIDE = (1e2, 1e3, 1e4, LARGEST)
"""The same once g is settled, tried in turn."""
GROWS = 1.03
"""A larger bound that separates X Y from I by less than this factor more is not worth it."""
MARGIN = 1e-8
"""Blocks are kept below minus this multiple of the identity."""
SETTLED = (1e-3, 1e-5, 1e-8)
"""The same once g is settled, tried in turn: at a block that is singular gains have no bound."""

FINEST = 1000
"""Parts that an interval of p may be divided into: each is an LMI of its own."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """minimise cost g subject to blocks <= 0, for `interior_point.minimise`."""

    blocks: tuple[LyapunovBlocks, ...]
    sizes: Sizes
    cost: float
    level: Array = field(default_factory=lambda: np.zeros(()))
    back_off: Array = field(default_factory=lambda: np.zeros(()))
    bounds: tuple[tuple[float, float], ...] = ()


class Found(NamedTuple):
    """Coefficients of X, Y (and of the bound of Y at the next sample) with the g they admit, and
    what the solver said.
    """

    gamma: float
    coefficients: Array
    message: str


class Existence:
    """The program of a plant with X and Y of these bases, its ranges cut in so many parts."""

    def __init__(
        self,
        plant: Coordinates,
        X: FunctionSpace | None,
        Y: FunctionSpace | None,
        divisions: int = 1,
    ):
        self.plant = plant
        both = [b for b in (X, Y) if b is not None]
        if plant.dt is not None and Y is not None and Y.size > 1 and moves(plant.parameters):
            both.append(Y)  # the bound of Y at the next sample
        each = unknowns(both)
        self.X: Unknown | None = each.pop(0) if X is not None else None
        self.Y: Unknown | None = each.pop(0) if Y is not None else None
        self.S: Unknown | None = each.pop(0) if each else self.Y
        self.count = sum(b.size for b in both)
        self.states = plant.at(np.array([[s.middle for s in plant.parameters]])).A.shape[-1]
        self._cells = self._over_cells(divisions)

    def _over_cells(self, divisions: int) -> list[Cell]:
        breaks = [sorted(set(b)) for b in self.plant.breaks]
        most = np.zeros(len(breaks), int)
        for basis in (u.basis for u in (self.X, self.Y) if u is not None):
            for i, factor in enumerate(factors_of(basis)):
                for piece in factor.pieces():
                    most[i] = max(most[i], piece.bernstein.shape[1] - 1)
                    if breaks[i][0] < piece.high < breaks[i][-1]:
                        breaks[i] = sorted({*breaks[i], piece.high})
        if not 1 <= whole(divisions, "divisions", 1) <= FINEST:
            raise InputError(f"divisions: expected 1 to {FINEST}, got {divisions}")
        if divisions > 1:
            breaks = [_divided(b, divisions) for b in breaks]
        degrees = np.array(degrees_of(self._data, breaks)) + most
        return cells(breaks, [int(d) for d in degrees])

    def _data(self, p: Array) -> list[Array]:
        plant = self.plant.at(p)
        halves = [f(plant) for f, u in ((observed, self.X), (controlled, self.Y)) if u is not None]
        return [M for half in halves for M in half]

    def least_gamma(self, solver: Solver) -> Found:
        """Minimise g."""
        blocks = [*self._halves(None, MARGIN), *self._coupling(False, LARGEST)]
        return self._solved(blocks, 1.0, solver)

    def widest(self, gamma: float, solver: Solver) -> Iterator[Found]:
        """For this g the X and Y whose product is farthest from one: first within the least bound
        beyond which that hardly grows, then within larger ones.
        """
        for margin in SETTLED:
            halves = self._halves(gamma, margin)
            before: Found | None = None
            for largest in WIDE:
                blocks = [*halves, *self._coupling(True, largest)]
                found = self._solved(blocks, -1.0, solver)
                if not np.any(found.coefficients):
                    continue
                if before is not None and found.gamma < GROWS * before.gamma:
                    yield before._replace(gamma=gamma)
                before = found
            if before is not None:
                yield before._replace(gamma=gamma)

    def _solved(self, blocks: list[LyapunovBlocks], cost: float, solver: Solver) -> Found:
        n, count = self.states, self.count
        candidate = interior_point.minimise(
            Conditions(tuple(blocks), Sizes(n, 1, count), cost), solver
        )
        if candidate.x is None:
            return Found(np.inf, np.zeros((count, n, n)), candidate.message)
        coefficients = smat(candidate.x[: count * length(n)].reshape(count, -1), n)
        return Found(float(candidate.x[-1]), coefficients, candidate.message)

    def _halves(self, gamma: float | None, margin: float) -> list[LyapunovBlocks]:
        """Those of every cell, for this g or for one that is sought."""
        out = []
        for cell in self._cells:
            plant = self.plant.at(cell.nodes)
            if self.X is not None:
                out += self._half(cell, observed(plant), self.X, self.X, 1.0, gamma, margin)
            if self.Y is not None and self.S is not None:
                out += self._half(cell, controlled(plant), self.Y, self.S, -1.0, gamma, margin)
            if self.S is not self.Y:
                out += self._next(cell, margin)
        return out

    def _half(
        self,
        cell: Cell,
        half: Half,
        ahead: Unknown,
        now: Unknown,
        sign: float,
        gamma: float | None,
        margin: float,
    ) -> list[LyapunovBlocks]:
        n, N = half.flow.shape[1:]
        constant, level = half.constant, half.level
        if gamma is not None:
            constant, level = constant - gamma * level, 0.0 * level
        f = ahead.values(cell.nodes)
        if self.plant.dt is not None:
            L, own = selector(n, 0, n + N), selector(n, n, n + N)
            flow = np.concatenate([np.zeros((len(f), n, n)), half.flow], axis=-1)
            blocks = Blocks(n + N, len(f), cell.to_bernstein)
            blocks.add(ahead, f, L, flow - 0.5 * L).add(
                now, now.values(cell.nodes), own, -0.5 * own
            )
            return [blocks.finished(_below(constant, n) + margin * np.eye(n + N), _below(level, n))]
        L = selector(n, 0, N)
        out = []
        for motion in self._motions(ahead, cell):
            blocks = Blocks(N, len(f), cell.to_bernstein).add(ahead, f, L, half.flow)
            if np.any(motion):
                blocks.add(ahead, sign * ahead.slopes(cell.nodes, motion), L, 0.5 * L)
            out.append(blocks.finished(constant + margin * np.eye(N), level))
        return out

    def _motions(self, unknown: Unknown, cell: Cell) -> list[Array]:
        """Every extreme dp/dt (K, m) at the nodes of a cell, per scaled time."""
        if not unknown.moves:
            return [np.zeros(cell.nodes.shape)]
        return motions(self.plant.parameters, cell.nodes, self.plant.time, used(unknown.basis))

    def _next(self, cell: Cell, margin: float) -> list[LyapunovBlocks]:
        """S(p) <= Y(p(k+1)) to first order in the step, at its ends."""
        assert self.S is not None  # noqa: S101 - see `_halves`
        assert self.Y is not None  # noqa: S101
        out, one = [], np.eye(self.states)
        for motion in self._motions(self.Y, cell):
            step = motion * (self.plant.dt or 0.0)
            there = self.Y.values(cell.nodes) + self.Y.slopes(cell.nodes, step)
            blocks = Blocks(self.states, len(there), cell.to_bernstein)
            blocks.add(self.S, self.S.values(cell.nodes), one, 0.5 * one)
            blocks.add(self.Y, there, one, -0.5 * one)
            out.append(blocks.finished(margin * one, 0.0 * one))
        return out

    def _coupling(self, apart: bool, largest: float) -> list[LyapunovBlocks]:
        """[X I; I Y] > 0, with g in place of I where they are to be `apart`; both below a bound.

        Without one of the two the other is positive, or apart from zero by g.
        """
        return [b for cell in self._cells for b in self._coupled(cell, apart, largest)]

    def _coupled(self, cell: Cell, apart: bool, largest: float) -> list[LyapunovBlocks]:
        n, K, one = self.states, len(cell.nodes), np.eye(self.states)
        every = list({id(u): u for u in (self.X, self.Y, self.S) if u is not None}.values())
        out = []
        for unknown in every:
            f = unknown.values(cell.nodes)
            blocks = Blocks(n, K, cell.to_bernstein).add(unknown, f, one, 0.5 * one)
            out.append(blocks.finished(-largest * one, 0 * one))
        if self.X is None or self.Y is None:
            for unknown in every:
                blocks = Blocks(n, K, cell.to_bernstein)
                blocks.add(unknown, unknown.values(cell.nodes), one, -0.5 * one)
                out.append(blocks.finished((0.0 if apart else 1 / LARGEST) * one, -one * apart))
            return out
        first, second = selector(n, 0, 2 * n), selector(n, n, 2 * n)
        cross = first.T @ second
        cross = cross + cross.T
        for Y in every[1:]:
            blocks = Blocks(2 * n, K, cell.to_bernstein)
            blocks.add(self.X, self.X.values(cell.nodes), first, -0.5 * first)
            blocks.add(Y, Y.values(cell.nodes), second, -0.5 * second)
            out.append(blocks.finished(cross * (not apart), -cross * apart))
        return out


def _divided(breaks: Sequence[float], parts: int) -> list[float]:
    inner = [a + (b - a) * k / parts for a, b in pairwise(breaks) for k in range(parts)]
    return [*inner, breaks[-1]]


def _below(M: Array, n: int) -> Array:
    """[0 0; 0 M] with n rows of nothing first."""
    return np.pad(M, [(0, 0)] * (M.ndim - 2) + [(n, 0), (n, 0)])
