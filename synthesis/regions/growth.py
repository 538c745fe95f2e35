"""Lyapunov functions where none is given: the quadratic one, and one that grows from it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from symheli.lpv.riccati import lyapunov
from symheli.progress import task
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.multivariate import (
    Exponents,
    SparsePolynomial,
    linear_substitution,
    monomials,
)
from synthesis.numerics.polynomial.symmetric import symmetrized
from synthesis.numerics.program.cone_program import Solver
from synthesis.regions.coordinates import (
    ceiling,
    directions,
    first_root,
    rises_near_zero,
    round_coordinates,
    short,
)
from synthesis.regions.proof import Gram, RegionProof
from synthesis.regions.search import Effort, RegionSearch, SumsOfSquares, Terms

ROUNDS = 40
"""Most alternations between the multipliers and V."""
SETTLED = 0.002
"""Relative growth of the volume below which V has settled, twice."""
SHARES = (0.999, 0.99, 0.97, 0.9, 0.8, 0.6, 0.4, 0.2, 0.1)
"""Shares of the ceiling at which multipliers are sought."""
KEPT = 0.99
"""Level, of one, of the former region that the next one holds: room for its inequalities."""
EFFORT = Effort(1, 0)
"""Degrees of the multipliers while V grows."""
LEAST_MARGIN = 1e-9
"""Least eigenvalue of the sums of squares that counts while V is sought."""
SPARES = (0.1, 0.5)
"""Parts of the largest margin that are left while V is made small, tried in turn."""


def linearization(f: Sequence[SparsePolynomial]) -> Array:
    """Return the matrix of the linear terms, a row for each polynomial."""
    units = np.eye(f[0].size, dtype=int).tolist()
    return np.array([[float(p.terms.get(tuple(u), 0)) for u in units] for p in f])


def quadratic(f: Sequence[SparsePolynomial]) -> SparsePolynomial:
    """Return x'P x with A'P + PA = -I of the linearization where it is stable, else x'x."""
    A, n = linearization(f), len(f)
    stable = np.linalg.eigvals(A).real.max() < 0
    P = symmetrized(lyapunov(A.T, np.eye(n), None)) if stable else np.eye(n)
    x = SparsePolynomial.variables(n)
    every = [x[i] * x[j] * Fraction(float(P[i, j])) for i in range(n) for j in range(n)]
    return sum(every, SparsePolynomial(n, {}))


def grown(
    f: Sequence[SparsePolynomial], V: SparsePolynomial, degree: int, solver: Solver
) -> SparsePolynomial:
    """Return a V of this degree whose region grew, by its volume, from that of V.

    Multipliers for V and V for multipliers in turn; each region holds nearly all of the former one.
    Source: Jarvis-Wloszek (2003), Lyapunov based analysis and controller synthesis for polynomial
    systems using sum-of-squares optimization.
    """
    for each in range(4, degree + 1, 2):
        V = _grown_once(f, V, each, solver)
    return V


def _grown_once(
    f: Sequence[SparsePolynomial], V: SparsePolynomial, degree: int, solver: Solver
) -> SparsePolynomial:
    best, size, still = V, -math.inf, 0
    with task(f"growing V of degree {degree}", ROUNDS) as progress:
        for _ in range(ROUNDS):
            found = _with_multipliers(f, V, solver)
            if found is None:
                break
            proof, level = found
            now = _log_volume(V, level, proof.T)
            progress.step(f"logarithm of the volume {now:.3f}")
            still = still + 1 if now < size + SETTLED else 0
            if now > size:
                best, size = V, now
            after = None if still > 1 else _next(f, V, level, proof, degree, solver)
            if after is None:
                break
            V = after
    return best


def _with_multipliers(
    f: Sequence[SparsePolynomial], V: SparsePolynomial, solver: Solver
) -> tuple[RegionProof, float] | None:
    """Return multipliers near the largest level of V, and that level."""
    E, T = V.along(f), round_coordinates(V, 1.0)
    if not E.terms or rises_near_zero(E, T):
        return None
    level, z = ceiling(V, E, T)
    if z is None:
        return None
    T = short(round_coordinates(V, level, T))
    search = RegionSearch(V, E, T, level, solver)
    for share in SHARES:
        proof = search.at(share, EFFORT)
        if proof is not None:
            return proof, share * level
    return None


def _log_volume(V: SparsePolynomial, level: float, T: Array) -> float:
    """Return the logarithm of the volume of V <= level, up to a constant."""
    n = V.size
    r = first_root(V, T, directions(n), level)
    volume = np.mean(np.minimum(r, 1e3) ** n)
    return float(np.linalg.slogdet(T)[1] + np.log(volume))


def _next(
    f: Sequence[SparsePolynomial],
    V: SparsePolynomial,
    level: float,
    proof: RegionProof,
    degree: int,
    solver: Solver,
) -> SparsePolynomial | None:
    """Return the V of least integral over the unit ball for given multipliers; None: none."""
    n, T = V.size, proof.T
    x, back = linear_substitution(T), np.linalg.inv(T)
    inner = [p.composed(x) for p in f]
    f_z = [{k: c for k, c in _mixed(row, inner).items() if abs(c) > 0} for row in back]
    W = {k: float(c) / level for k, c in V.composed(x).terms.items()}
    s = {k: float(c) for k, c in proof.s.polynomial(n).terms.items()}
    found = _program(f_z, W, s, degree, solver)
    if found is None:
        return None
    exact = Gram(*found).polynomial(n).composed(linear_substitution(back))
    return SparsePolynomial(n, {k: Fraction(float(c)) for k, c in exact.terms.items()})


def _mixed(row: Array, f: Sequence[SparsePolynomial]) -> Terms:
    total: Terms = {}
    for factor, p in zip(row, f, strict=True):
        for k, c in p.terms.items():
            total[k] = total.get(k, 0.0) + factor * float(c)
    return total


def _program(
    f: Sequence[Terms], W: Terms, s: Terms, degree: int, solver: Solver
) -> tuple[tuple[Exponents, ...], Array] | None:
    """Solve for V: dV/dt + s (1 - V) + rest = 0, and V <= 1 where W <= KEPT by 1 - V = s2 (KEPT -
    W) + rest.
    """
    n, half = len(f), degree // 2
    order = max((min(sum(k) for p in f for k in p) + 1) // 2, 1)
    top = max(degree - 1 + max(sum(k) for p in f for k in p), degree + max(map(sum, s)))
    program = SumsOfSquares()
    V = program.sum(tuple(monomials(n, 1, half)))
    falls = program.sum(tuple(monomials(n, order, -(-top // 2))))
    held = program.sum(tuple(monomials(n, 0, half - max(map(sum, W)) // 2)))
    inside = program.sum(tuple(monomials(n, 0, half)))
    zero = (0,) * n
    program.known(0, s)
    program.image(0, V, lambda k: _difference(_along(k, f), _times(s, k)))
    program.times(0, falls, {zero: 1.0})
    program.known(1, {zero: -1.0})
    program.times(1, V, {zero: 1.0})
    program.times(1, held, _difference({zero: KEPT}, W))
    program.times(1, inside, {zero: 1.0})
    found = _smallest(program, V, solver)
    return None if found is None else (tuple(monomials(n, 1, half)), found[V])


def _smallest(program: SumsOfSquares, V: int, solver: Solver) -> list[Array] | None:
    """Return the sums with the least integral of V that leave a part of the largest margin."""
    widest = program.largest_margin(solver)
    if widest is None or not widest[0] > LEAST_MARGIN:
        return None
    tries = (program.least(V, _moment, part * widest[0], solver) for part in SPARES)
    return next((found for found in tries if found is not None), widest)[1]


def _along(k: Exponents, f: Sequence[Terms]) -> Terms:
    """Return the derivative of a monomial along f."""
    total: Terms = {}
    for i, e in enumerate(k):
        if e:
            lower = (*k[:i], e - 1, *k[i + 1 :])
            for other, c in f[i].items():
                key = tuple(a + b for a, b in zip(lower, other, strict=True))
                total[key] = total.get(key, 0.0) + e * c
    return total


def _times(p: Terms, k: Exponents) -> Terms:
    return {tuple(a + b for a, b in zip(other, k, strict=True)): c for other, c in p.items()}


def _difference(p: Terms, q: Terms) -> Terms:
    return {k: p.get(k, 0.0) - q.get(k, 0.0) for k in {**p, **q}}


def _moment(k: Exponents) -> float:
    """Return the mean of a monomial over the unit ball. Source: Folland (2001)."""
    if any(e % 2 for e in k):
        return 0.0
    n, degree = len(k), sum(k)
    over = math.prod(math.gamma((e + 1) / 2) for e in k) / math.gamma((n + degree) / 2)
    return over * math.gamma(n / 2) / math.pi ** (n / 2) * n / (n + degree)
