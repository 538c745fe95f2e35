"""Search for the sums of squares that prove a region of attraction, in floating point."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
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


class Sum(NamedTuple):
    """An unknown sum of squares of these monomials, times a known polynomial."""

    basis: Sequence[Exponents]
    factor: Terms


def largest_margin(
    known: Terms, sums: Sequence[Sum], solver: Solver, unit_trace: int | None = None
) -> tuple[float, list[Array]] | None:
    """Return the largest t, and Q_i >= t I, with known + sum_i factor_i m_i' Q_i m_i = 0.

    `unit_trace`: the sum whose eigenvalues have the mean one. None: the solver has no point.
    """
    sizes = [len(each.basis) for each in sums]
    starts = np.cumsum([0, *map(length, sizes)])
    count = int(starts[-1]) + 1
    rows: dict[Exponents, int] = {k: i for i, k in enumerate(known)}
    entries: list[tuple[int, int, float]] = []
    for own, start in zip(sums, starts, strict=False):
        entries += _entries(own, int(start), rows)
    b = np.zeros(len(rows) + (unit_trace is not None))
    b[: len(known)] = [-c for c in known.values()]
    if unit_trace is not None:
        n = sizes[unit_trace]
        r, c, _ = indices(n)
        trace = int(starts[unit_trace]) + np.flatnonzero(r == c)
        entries += [(len(rows), int(k), 1.0) for k in trace]
        b[-1] = n
    i, j, v = map(np.array, zip(*entries, strict=True))
    equal = sparse.csr_matrix((v, (i, j)), shape=(len(b), count))
    cones = []
    for n, start in zip(sizes, starts, strict=False):
        r, c, _ = indices(n)
        own = sparse.lil_matrix((length(n), count))
        own[range(length(n)), range(start, start + length(n))] = -1.0
        own[np.flatnonzero(r == c), count - 1] = 1.0
        cones.append(own.tocsr())
    A = sparse.csc_matrix(sparse.vstack([equal, *cones]))
    equalities = len(b)
    b = np.concatenate([b, np.zeros(A.shape[0] - equalities)])
    cost = np.zeros(count)
    cost[-1] = -1.0
    found = solve(ConeProgram(cost, A, b, tuple(sizes), equalities, own_units=True), solver)
    x = found.x
    if x is None:
        return None
    parts = [x[a : a + length(n)] for a, n in zip(starts, sizes, strict=False)]
    return float(x[-1]), [smat(v, n) for v, n in zip(parts, sizes, strict=True)]


def _entries(own: Sum, start: int, rows: dict[Exponents, int]) -> list[tuple[int, int, float]]:
    """Return (row of the monomial, column of the entry, coefficient); new monomials join `rows`."""
    r, c, weight = indices(len(own.basis))
    out = []
    for place, (i, j, w) in enumerate(zip(r, c, weight, strict=True)):
        pair = sum_exponents(own.basis[i], own.basis[j])
        for k, value in own.factor.items():
            row = rows.setdefault(sum_exponents(pair, k), len(rows))
            out.append((row, start + place, value * w))
    return out


class Bases(NamedTuple):
    """Monomials of V, sigma, s and of what is left."""

    V: Sequence[Exponents]
    sigma: Sequence[Exponents]
    s: Sequence[Exponents]
    rest: Sequence[Exponents]


class Effort(NamedTuple):
    """What is added to half the least degree of the rest, and half the degree of sigma."""

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
        found = largest_margin(
            {k: -c for k, c in self.W.items()}, [Sum(basis, _one(n))], self.solver
        )
        if found is None or not found[0] > LEAST:
            return None
        return Gram(tuple(basis), self.unit * found[1][0])

    def at(self, share: float, effort: Effort) -> RegionProof | None:
        """Return a candidate for the level `unit` times share, inf: for all levels."""
        everywhere, n, sigma = math.isinf(share), len(self.T), effort.sigma
        own = bases(self.W, self.E, effort, everywhere)
        known: Terms = {} if sigma else dict(self.E)
        sums = [Sum(own.rest, _one(n))]
        if not everywhere:
            room = {(0,) * n: share, **{k: -c for k, c in self.W.items()}}
            sums.append(Sum(own.s, room))
        if sigma:
            sums.append(Sum(own.sigma, self.E))
        found = largest_margin(known, sums, self.solver, len(sums) - 1 if sigma else None)
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
