"""Existence of a controller: the two inequalities of `elimination` and their coupling, as a program
whose blocks are imposed at points of the range of p.

The points are few at first; between them the blocks are checked on a finer grid, and where one is
violated a point is added, unless a `Grid` was asked for. This proves nothing, and need not: the
proof is the certificate of the closed loop. Points do not raise gamma, as the hull of Bernstein
coefficients would where an entry of B2 or C2 passes through zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import UserFunctions
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.bases.polynomials import factors_of, piecewise_lobatto
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from synthesis.certify.statement.impose import Grid
from synthesis.design.lpv.elimination import Half, controlled, observed
from synthesis.design.lpv.scaled_plant import ScaledPlant
from synthesis.numerics.polynomial.symmetric import length, smat
from synthesis.numerics.program import interior_point
from synthesis.numerics.program.bases import MAX_DIVISIONS, moves, used
from synthesis.numerics.program.cone_program import Solver
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks, Sizes
from synthesis.numerics.program.unknown import BlockTerms, UnknownFunction, selector, unknowns

Divisions = int | Grid
"""In how many parts every range is cut at first, or the points themselves."""

MATRIX_BOUNDS = (1e8, 1e10)
"""X and Y are kept below this multiple of the identity, in scaled coordinates; the second bound is
used where the first is active and a lower gamma is possible.
"""
ACTIVE_FRACTION = 0.1
"""A bound counts as active where the largest eigenvalue of X or Y exceeds this fraction of it."""
SETTLED_BOUNDS = (1e2, 1e3, 1e4, 1e6, 1e8)
"""Bounds on X and Y once gamma is fixed, tried in turn."""
MIN_GROWTH = 1.03
"""Least factor by which a larger bound must increase the separation of X Y from I to be preferred.
"""
COARSE_TOLERANCE, FINE_TOLERANCE = 1e-3, 1e-5
"""Tolerances of g while points are added, and of the last program where p moves (points are
checked to `MAX_VIOLATION`).
"""
SEPARATION_TOLERANCE = 0.1
"""Tolerance to which X and Y are separated once g is fixed. Near the centre of the feasible set
gains change slowly with p; near its boundary they change steeply at the ends of a range.
"""
MARGIN = 1e-8
"""Blocks are kept below minus this multiple of the identity."""
SETTLED_MARGINS = (1e-3, 1e-5, 1e-8)
"""The same once g is fixed, tried in turn: where a block is singular the gains are unbounded."""

MIN_POINTS = {1: 13, 2: 5}
"""Least number of points of each parameter (more parameters: 3)."""
CHECK_RATIO = {1: 8, 2: 3}
"""Number of points at which blocks are checked for each point at which they are imposed (more
parameters: 2).
"""
MAX_ROUNDS = 8
"""Largest number of times that points are added."""
MAX_ADDED = 8
"""Largest number of points added at a time."""
MAX_VIOLATION = 1e-4
"""Relative increase of g with which a block must be negative between the points."""
ROUNDING = 1e-8
"""Eigenvalue up to which a block counts as negative there, in scaled coordinates."""


def imposed_at(divisions: int, impose: Grid | None) -> Divisions:
    """Points at which the inequalities of a design are imposed; raises `InputError` for what is no
    `Grid`.
    """
    if impose is not None and not isinstance(impose, Grid):
        raise InputError(
            f"impose: expected a Grid, or None for points where they are needed, got {impose!r:.60}"
        )
    return divisions if impose is None else impose


@dataclass(frozen=True, eq=False)
class ExistenceProgram:
    """minimise cost g subject to blocks <= 0, for `interior_point.minimise`."""

    blocks: tuple[LyapunovBlocks, ...]
    sizes: Sizes
    cost: float
    places: int = 1
    level: Array = field(default_factory=lambda: np.zeros(()))
    back_off: Array = field(default_factory=lambda: np.zeros(()))
    bounds: tuple[tuple[float, float], ...] = ()


class Solution(NamedTuple):
    """Coefficients of X, Y (and of the bound of Y at the next sample) with the g they admit, the
    solver's answer, a point to start again from, and the g below which there is none for the points
    imposed.
    """

    gamma: float
    coefficients: Array
    message: str
    early: interior_point.Early | None = None
    lower: float = -np.inf


class Existence:
    """The program of a plant with X and Y of these bases, its ranges cut in so many parts; `p` (m,)
    is one of the points at which blocks are imposed. Of a `Grid` they are all points.
    """

    def __init__(
        self,
        plant: ScaledPlant,
        X: FunctionSpace | None,
        Y: FunctionSpace | None,
        divisions: Divisions = 1,
        largest: float = MATRIX_BOUNDS[0],
        p: Array | None = None,
    ):
        self.plant, self.largest = plant, largest
        both = [b for b in (X, Y) if b is not None]
        if plant.dt is not None and Y is not None and Y.size > 1 and moves(plant.parameters):
            both.append(Y)  # the bound of Y at the next sample
        each = unknowns(both)
        self.X: UnknownFunction | None = each.pop(0) if X is not None else None
        self.Y: UnknownFunction | None = each.pop(0) if Y is not None else None
        self.S: UnknownFunction | None = each.pop(0) if each else self.Y
        self.count = sum(b.size for b in both)
        self.states = plant.at(np.array([[s.middle for s in plant.parameters]])).A.shape[-1]
        self.fixed = isinstance(divisions, Grid)
        if isinstance(divisions, Grid):
            ends = ((b[0], b[-1]) for b in plant.breaks)
            self.points = tensor_grid([np.linspace(*pair, divisions.points) for pair in ends])
            return
        first = self._first(divisions)
        self.points = first if p is None else np.unique(np.vstack([first, p]), axis=0)

    def _first(self, divisions: int) -> Array:
        """Return the points (K, m) at which blocks are imposed at first."""
        if not 1 <= whole(divisions, "divisions", 1) <= MAX_DIVISIONS:
            raise InputError(f"divisions: expected 1 to {MAX_DIVISIONS}, got {divisions}")
        breaks = [set(b) for b in self.plant.breaks]
        m = len(breaks)
        most = np.zeros(m, int)
        for basis in (u.basis for u in (self.X, self.Y) if u is not None):
            for i, factor in enumerate(factors_of(basis)):
                if isinstance(factor, UserFunctions):
                    most[i] = max(most[i], factor.size)
                    continue
                for piece in factor.pieces():
                    most[i] = max(most[i], piece.bernstein.shape[1] - 1)
                    if min(breaks[i]) < piece.high < max(breaks[i]):
                        breaks[i].add(piece.high)
        axes = []
        for ends, degree in zip(breaks, most, strict=True):
            parts = [
                a + (b - a) * np.arange(divisions) / divisions for a, b in pairwise(sorted(ends))
            ]
            knots = [*np.concatenate(parts), max(ends)]
            least = MIN_POINTS.get(m, 3)
            count = max(-(-(least - 1) // (len(knots) - 1)), 2 * int(degree) + (m == 1))
            axes.append(piecewise_lobatto(knots, count))
        return tensor_grid(axes)

    def least_gamma(self, solver: Solver, above: float = np.inf) -> Solution:
        """Minimise g, adding points where a block is violated between them; no further once it is
        known not to be below `above`, and g is inf.
        """
        fine = replace(solver, tolerance=FINE_TOLERANCE)
        if self.fixed or len(self.points) == 1:
            return self._least(fine if self.fixed else solver, None, above)
        found = self._least(replace(solver, tolerance=COARSE_TOLERANCE), None, above)
        for k in range(MAX_ROUNDS):
            if not np.isfinite(found.gamma) or not (self._added(found, found.gamma) or k == 0):
                break
            # later points are nearer the boundary, from where steps are short
            found = self._least(fine, found.early, above)._replace(early=found.early)
        return found

    def _least(
        self,
        solver: Solver,
        start: interior_point.Early | None = None,
        above: float = np.inf,
        largest: float | None = None,
    ) -> Solution:
        bound = self.largest if largest is None else largest
        blocks = [*self._halves(None, MARGIN), *self._coupling(False, bound)]
        found = self._solved(blocks, 1.0, solver, start, above)
        return found._replace(gamma=np.inf) if found.lower > above else found

    def could_fall(self, found: Solution, largest: float, share: float, solver: Solver) -> bool:
        """Whether g may be below this share of the one found within a larger bound on X and Y; for
        the present points: more of them raise g.
        """
        above = share * found.gamma
        coarse = replace(solver, tolerance=COARSE_TOLERANCE)
        return not self._least(coarse, found.early, above, largest).lower > above

    def bounded(self, found: Solution) -> bool:
        """Whether the bound on X and Y is active."""
        each = (u.at(found.coefficients, self.points) for u in (self.X, self.Y) if u is not None)
        return any(np.linalg.eigvalsh(M).max() > ACTIVE_FRACTION * self.largest for M in each)

    def _added(self, found: Solution, gamma: float) -> bool:
        """Whether a block is violated between the points at this g: then points are added where it
        is violated most, one in each cell of the present ones.
        """
        axes = [np.unique(x) for x in self.points.T]
        finer = CHECK_RATIO.get(len(axes), 2)
        between = tensor_grid([piecewise_lobatto(x.tolist(), finer) for x in axes])
        gamma = (1 + MAX_VIOLATION) * gamma
        worst = self._excess(between, found, gamma)
        allowed = max(ROUNDING, 2 * float(self._excess(self.points, found, gamma).max()))
        chosen: dict[tuple[int, ...], Array] = {}
        for k in np.argsort(-worst):
            if worst[k] <= allowed or len(chosen) == MAX_ADDED:
                break
            cell = tuple(int(np.searchsorted(x, q)) for x, q in zip(axes, between[k], strict=True))
            chosen.setdefault(cell, between[k])
        self.points = np.concatenate([self.points, *(p[None] for p in chosen.values())])
        return bool(chosen)

    def _excess(self, points: Array, found: Solution, gamma: float) -> Array:
        """Return the largest eigenvalue (K,) of any half at each point."""
        values = [
            np.linalg.eigvalsh(b.linear(found.coefficients) + b.constant)[:, -1]
            for b in self._halves_at(points, gamma, 0.0)
        ]
        return np.concatenate([v.reshape(-1, len(points)) for v in values]).max(axis=0)

    def widest(self, gamma: float, solver: Solver) -> Iterator[Solution]:
        """Return, for this g, the X and Y whose product is farthest from the identity: within the
        least bound beyond which that hardly grows, then within larger ones.
        """
        for margin in SETTLED_MARGINS:
            before: Solution | None = None
            for largest in SETTLED_BOUNDS:
                found = self._widest(
                    gamma, margin, largest, replace(solver, tolerance=SEPARATION_TOLERANCE)
                )
                if not np.any(found.coefficients):
                    continue
                if before is not None and found.gamma < MIN_GROWTH * before.gamma:
                    yield before._replace(gamma=gamma)
                before = found
            if before is not None:
                yield before._replace(gamma=gamma)

    def _widest(self, gamma: float, margin: float, largest: float, solver: Solver) -> Solution:
        """Solve this within one bound, adding points as for the least g."""
        for _ in range(MAX_ROUNDS):
            blocks = [*self._halves(gamma, margin), *self._coupling(True, largest)]
            found = self._solved(blocks, -1.0, solver)
            if not np.any(found.coefficients) or len(self.points) == 1 or self.fixed:
                break
            if not self._added(found, gamma):
                break
        return found

    def _solved(
        self,
        blocks: list[LyapunovBlocks],
        cost: float,
        solver: Solver,
        start: interior_point.Early | None = None,
        above: float = np.inf,
    ) -> Solution:
        n, count = self.states, self.count
        candidate = interior_point.minimise(
            ExistenceProgram(tuple(blocks), Sizes(n, 1, count), cost, len(self.points)),
            solver,
            start,
            above,
        )
        if candidate.x is None:
            empty = np.zeros((count, n, n))
            return Solution(np.inf, empty, candidate.message, lower=candidate.lower)
        coefficients = smat(candidate.x[: count * length(n)].reshape(count, -1), n)
        return Solution(
            float(candidate.x[-1]),
            coefficients,
            candidate.message,
            candidate.early,
            candidate.lower,
        )

    def _halves(self, gamma: float | None, margin: float) -> list[LyapunovBlocks]:
        """Return the halves at every point, for this g or for an unknown one."""
        return self._halves_at(self.points, gamma, margin)

    def _halves_at(self, p: Array, gamma: float | None, margin: float) -> list[LyapunovBlocks]:
        out = []
        plant = self.plant.at(p)
        if self.X is not None:
            out += self._half(p, observed(plant), self.X, self.X, 1.0, gamma, margin)
        if self.Y is not None and self.S is not None:
            out += self._half(p, controlled(plant), self.Y, self.S, -1.0, gamma, margin)
        if self.S is not self.Y:
            out += self._next(p, margin)
        return out

    def _half(
        self,
        p: Array,
        half: Half,
        ahead: UnknownFunction,
        now: UnknownFunction,
        sign: float,
        gamma: float | None,
        margin: float,
    ) -> list[LyapunovBlocks]:
        n, N = half.flow.shape[1:]
        constant, level = half.constant, half.level
        if gamma is not None:
            constant, level = constant - gamma * level, 0.0 * level
        f = ahead.values(p)
        if self.plant.dt is not None:
            L, own = selector(n, 0, n + N), selector(n, n, n + N)
            flow = np.concatenate([np.zeros((len(f), n, n)), half.flow], axis=-1)
            blocks = BlockTerms(n + N, len(f))
            blocks.add(ahead, f, L, flow - 0.5 * L).add(now, now.values(p), own, -0.5 * own)
            return [blocks.finished(_below(constant, n) + margin * np.eye(n + N), _below(level, n))]
        L = selector(n, 0, N)
        motions = np.stack(self._motions(ahead, p))
        blocks = BlockTerms(N, len(f), len(motions)).add(ahead, f, L, half.flow)
        slopes = ahead.gradient(p)
        for i in np.flatnonzero(np.any(motions, axis=(0, 1))):
            moved = sign * motions[..., i, None, None] * 0.5 * L
            blocks.add(ahead, slopes[..., i], L, moved)
        return [blocks.finished(constant + margin * np.eye(N), level)]

    def _motions(self, unknown: UnknownFunction, p: Array) -> list[Array]:
        """Return every extreme dp/dt (K, m) at these points, per scaled time."""
        if not unknown.moves:
            return [np.zeros(p.shape)]
        return self.plant.motions(p, used(unknown.basis))

    def _next(self, p: Array, margin: float) -> list[LyapunovBlocks]:
        """Impose S(p) <= Y(p(k+1)) to first order in the step, at its ends."""
        assert self.S is not None  # noqa: S101 - see `_halves_at`
        assert self.Y is not None  # noqa: S101
        out, one = [], np.eye(self.states)
        for motion in self._motions(self.Y, p):
            step = motion * (self.plant.dt or 0.0)
            there = self.Y.values(p) + self.Y.slopes(p, step)
            blocks = BlockTerms(self.states, len(there))
            blocks.add(self.S, self.S.values(p), one, 0.5 * one)
            blocks.add(self.Y, there, one, -0.5 * one)
            out.append(blocks.finished(margin * one, 0.0 * one))
        return out

    def _coupling(self, apart: bool, largest: float) -> list[LyapunovBlocks]:
        """Impose [X I; I Y] > 0, with g in place of I if they are to be `apart`, and an upper bound
        on both.

        Without one of the two the other is positive, or apart from zero by g.
        """
        p = self.points
        n, K, one = self.states, len(p), np.eye(self.states)
        every = list({id(u): u for u in (self.X, self.Y, self.S) if u is not None}.values())
        out = []
        for unknown in every:
            blocks = BlockTerms(n, K).add(unknown, unknown.values(p), one, 0.5 * one)
            out.append(blocks.finished(-largest * one, 0 * one))
        if self.X is None or self.Y is None:
            for unknown in every:
                blocks = BlockTerms(n, K).add(unknown, unknown.values(p), one, -0.5 * one)
                out.append(blocks.finished((0.0 if apart else 1 / largest) * one, -one * apart))
            return out
        first, second = selector(n, 0, 2 * n), selector(n, n, 2 * n)
        cross = first.T @ second
        cross = cross + cross.T
        for Y in every[1:]:
            blocks = BlockTerms(2 * n, K)
            blocks.add(self.X, self.X.values(p), first, -0.5 * first)
            blocks.add(Y, Y.values(p), second, -0.5 * second)
            out.append(blocks.finished(cross * (not apart), -cross * apart))
        return out


def _below(M: Array, n: int) -> Array:
    """Return [0 0; 0 M] with n rows of zeros first."""
    return np.pad(M, [(0, 0)] * (M.ndim - 2) + [(n, 0), (n, 0)])
