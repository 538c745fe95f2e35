"""Search for the sums of squares that prove a region of attraction, in floating point."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.gram import half_polytope, sum_exponents
from synthesis.numerics.polynomial.multivariate import (
    Exponents,
    SparsePolynomial,
    linear_substitution,
)
from synthesis.numerics.polynomial.symmetric import indices, length, smat
from synthesis.numerics.program.cone_program import ConeProgram, Solver, solve
from synthesis.regions.proof import Gram, RegionProof

LEAST = 1e-10
"""Least eigenvalue, in the search's units, from which the exact check is tried."""
MULTIPLIER_BITS = 40
"""Bits to which multipliers are rounded."""

Terms = dict[Exponents, float]


class SumsOfSquares:
    """A program in unknown sums of squares m' Q m, which enter polynomial equations linearly.

    Equations are numbered from 0; each says that the sum of its parts is the zero polynomial.
    """

    def __init__(self) -> None:
        self.sizes: list[int] = []
        self.count = 0
        self._starts: list[int] = []
        self._rows: dict[tuple[int, Exponents], int] = {}
        self._known: dict[int, float] = {}
        self._entries: list[tuple[int, int, float]] = []
        self._pairs: list[list[tuple[Exponents, float]]] = []

    def known(self, equation: int, terms: Terms) -> None:
        """Add a known polynomial to an equation."""
        for k, value in terms.items():
            row = self._row(equation, k)
            self._known[row] = self._known.get(row, 0.0) + value

    def sum(self, basis: Sequence[Exponents]) -> int:
        """Add an unknown sum of squares of these monomials; return its number."""
        r, c, weight = indices(len(basis))
        self._pairs.append(
            [
                (sum_exponents(basis[i], basis[j]), float(w))
                for i, j, w in zip(r, c, weight, strict=True)
            ]
        )
        self.sizes.append(len(basis))
        self._starts.append(self.count)
        self.count += length(len(basis))
        return len(self.sizes) - 1

    def times(self, equation: int, number: int, factor: Terms) -> None:
        """Add a known polynomial times a sum of squares to an equation."""
        self.image(equation, number, lambda k: {sum_exponents(k, a): c for a, c in factor.items()})

    def image(self, equation: int, number: int, linear: Callable[[Exponents], Terms]) -> None:
        """Add a linear function of a sum of squares, given by the images of monomials."""
        images: dict[Exponents, Terms] = {}
        for place, (k, weight) in enumerate(self._pairs[number]):
            for a, c in images.setdefault(k, images.get(k) or linear(k)).items():
                column = self._starts[number] + place
                self._entries.append((self._row(equation, a), column, c * weight))

    def unit_trace(self, number: int) -> None:
        """Impose that the eigenvalues of Q have the mean one."""
        row = self._row(-1 - number, ())
        self._entries += [(row, int(k), 1.0) for k in self._diagonal(number)]
        self._known[row] = -float(self.sizes[number])

    def largest_margin(self, solver: Solver) -> tuple[float, list[Array]] | None:
        """Return the largest t with Q >= t I of all sums, and Q; None: the solver has no point."""
        cost = np.zeros(self.count + 1)
        cost[-1] = -1.0
        return self._solved(cost, None, solver)

    def least(
        self, number: int, weight: Callable[[Exponents], float], margin: float, solver: Solver
    ) -> tuple[float, list[Array]] | None:
        """Return the least sum of weighted coefficients of one sum of squares where Q >= margin I
        of all, and Q; None: the solver has no point.
        """
        cost = np.zeros(self.count + 1)
        start = self._starts[number]
        cost[start : start + len(self._pairs[number])] = [
            weight(k) * w for k, w in self._pairs[number]
        ]
        return self._solved(cost, margin, solver)

    def _solved(
        self, cost: Array, margin: float | None, solver: Solver
    ) -> tuple[float, list[Array]] | None:
        rows = len(self._rows) + (margin is not None)
        b = np.zeros(rows + self.count)
        b[list(self._known)] = [-c for c in self._known.values()]
        entries = list(self._entries)
        if margin is not None:
            entries.append((rows - 1, self.count, 1.0))
            b[rows - 1] = margin
        i, j, v = map(np.array, zip(*entries, strict=True))
        equal = sparse.csr_matrix((v, (i, j)), shape=(rows, self.count + 1))
        cones = sparse.lil_matrix((self.count, self.count + 1))
        cones.setdiag(-1.0)
        for number in range(len(self.sizes)):
            cones[self._diagonal(number), self.count] = 1.0
        A = sparse.csc_matrix(sparse.vstack([equal, cones]))
        program = ConeProgram(cost, A, b, tuple(self.sizes), rows, own_units=True)
        x = solve(program, solver).x
        if x is None:
            return None
        parts = zip(self._starts, self.sizes, strict=True)
        return float(x[-1]), [smat(x[a : a + length(n)], n) for a, n in parts]

    def _diagonal(self, number: int) -> Array:
        r, c, _ = indices(self.sizes[number])
        return self._starts[number] + np.flatnonzero(r == c)

    def _row(self, equation: int, k: Exponents) -> int:
        return self._rows.setdefault((equation, k), len(self._rows))


class Bases(NamedTuple):
    """Monomials of V, sigma, s and of what is left."""

    V: Sequence[Exponents]
    sigma: Sequence[Exponents]
    s: Sequence[Exponents]
    rest: Sequence[Exponents]


class Effort(NamedTuple):
    """Additions to half the least degree of the rest, and half the degree of sigma."""

    more: int = 0
    sigma: int = 0


def bases(
    W: Collection[Exponents], E: Collection[Exponents], effort: Effort, everywhere: bool = False
) -> Bases:
    """Return the monomials for supports of V and dV/dt; `everywhere`: for all levels, without s."""
    (more, sigma), n = effort, len(next(iter(W)))
    c = half_polytope([*W, *_corners(n, max(map(sum, W)))])
    if everywhere:
        raised = [sum_exponents(k, corner) for k in E for corner in _corners(n, 2 * sigma)]
        m = half_polytope([*E, *raised])
    else:
        half = max(-(-max(map(sum, E)) // 2), max(map(sum, c)) + min(map(sum, E)) // 2)
        m = half_polytope([*E, *_corners(n, 2 * (half + more + sigma))])
    inside = set(m)
    s = [k for k in m if all(sum_exponents(k, other) in inside for other in c)]
    a = half_polytope([(0,) * n, *_corners(n, 2 * sigma)]) if sigma else [(0,) * n]
    return Bases(c, a, s, m)


def _corners(n: int, degree: int) -> list[Exponents]:
    return [tuple(row) for row in (degree * np.eye(n, dtype=int)).tolist()]


class RegionSearch:
    """Proofs for levels of one V in one set of coordinates x = T z.

    `unit` is the level that counts as one, `pace` the size of dV/dt there, over that level.
    """

    def __init__(
        self,
        V: SparsePolynomial,
        E: SparsePolynomial,
        T: Array,
        unit: float,
        solver: Solver,
    ):
        x = linear_substitution(T)
        self.T, self.unit, self.solver = T, unit, solver
        self.W = _floats(V.composed(x), 1 / unit)
        E = E.composed(x)
        self.pace = max(abs(float(c)) for c in E.terms.values()) / unit
        self.E = _floats(E, 1 / (unit * self.pace))
        self.V = self._positive()

    def _positive(self) -> Gram | None:
        """Return the sum of squares that is V; None: V is not shown to be positive definite."""
        n = len(self.T)
        degree = max(map(sum, self.W))
        basis = half_polytope([*self.W, *_corners(n, degree + degree % 2)])
        program = SumsOfSquares()
        program.known(0, {k: -c for k, c in self.W.items()})
        program.times(0, program.sum(basis), _one(n))
        found = program.largest_margin(self.solver)
        if found is None or not found[0] > LEAST:
            return None
        return Gram(tuple(basis), self.unit * found[1][0])

    def at(self, share: float, effort: Effort) -> RegionProof | None:
        """Return a candidate for the level `unit` times share, inf: for all levels."""
        everywhere, n, sigma = math.isinf(share), len(self.T), effort.sigma
        own = bases(self.W, self.E, effort, everywhere)
        program = SumsOfSquares()
        program.times(0, program.sum(own.rest), _one(n))
        if not everywhere:
            room = {(0,) * n: share, **{k: -c for k, c in self.W.items()}}
            program.times(0, program.sum(own.s), room)
        if sigma:
            number = program.sum(own.sigma)
            program.times(0, number, self.E)
            program.unit_trace(number)
        else:
            program.known(0, self.E)
        found = program.largest_margin(self.solver)
        if found is None or not found[0] > LEAST or self.V is None:
            return None
        Q = found[1]
        sigma_Q = Q[-1] if sigma else np.ones((1, 1))
        s = Gram((), np.zeros((0, 0)))
        if not everywhere:
            s = Gram(tuple(own.s), _rounded(Q[1] * self.pace))
        return RegionProof(
            self.T,
            self.V,
            Gram(tuple(own.sigma), _rounded(sigma_Q)),
            s,
            Gram(tuple(own.rest), Q[0] * self.unit * self.pace),
        )


def _floats(p: SparsePolynomial, factor: float) -> Terms:
    return {k: float(c) * factor for k, c in p.terms.items()}


def _one(n: int) -> Terms:
    return {(0,) * n: 1.0}


def _rounded(Q: Array) -> Array:
    """Return a symmetric matrix with few bits."""
    size = np.abs(Q).max(initial=0.0)
    unit = math.ldexp(1.0, math.frexp(size)[1] - MULTIPLIER_BITS)
    return np.round(Q / unit) * unit
