"""The inequalities of V = x'Px for listed vertices and for a grid, in exact arithmetic.

With u = K x + w, A + BK for A and C + DK for C, these are positive definite: P, and

    stability    -(A'P + PA + dP/dt)
    decay rate   -(A'P + PA + dP/dt + 2 alpha P)
    gain         -[A'P + PA + dP/dt + C'C   PB + C'D; .   D'D - gamma^2 I]

sampled, with P+ after the step: P - A'P+A;  P - exp(2 alpha dt) A'P+A;  -[A'P+A - P + C'C   A'P+B +
C'D; .   B'P+B + D'D - gamma^2 I]. They are convex in the plant, so that vertices are enough. On a
grid the matrices are straight lines of p: the forms are polynomials of degree 4 at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.claims.lyapunov_claim import LyapunovClaim
from synthesis.claims.plants import GridPlant, VertexPlant, as_fraction, rationals
from synthesis.numerics.polynomial.bernstein import blossom
from synthesis.numerics.polynomial.exact import growth_of
from synthesis.numerics.polynomial.matrix import PolynomialMatrix, block

POSITIVE = "P > 0"
"""Name of the inequality of P itself."""
UNIT = ((Fraction(0), Fraction(1)),)
"""The box of a vertex, on which nothing depends."""


class Required(NamedTuple):
    """A demand of positive definiteness: its name, the polynomial matrix, and where in words: of a
    vertex, whose number `vertex` is; on a grid None.
    """

    name: str
    form: PolynomialMatrix
    words: str
    vertex: int | None


class Closed(NamedTuple):
    """A + BK, B, C + DK, D and P on a box."""

    A: PolynomialMatrix
    B: PolynomialMatrix
    C: PolynomialMatrix
    D: PolynomialMatrix
    P: PolynomialMatrix


def parts(plant: VertexPlant | GridPlant, claim: LyapunovClaim) -> Iterator[Required]:
    """Yield everything that must be positive definite."""
    yield from (_of_vertices if isinstance(plant, VertexPlant) else _of_grid)(plant, claim)  # type: ignore[operator]


def value_at(F: PolynomialMatrix, point: tuple[Any, ...]) -> Array:
    """Return the rational matrix at a point of the box."""
    c = F.coefficients
    for t, (low, high) in zip(point, F.box, strict=True):
        u = (Fraction(t) - low) / (high - low)
        c = np.tensordot(blossom([u] * (len(c) - 1)), c, axes=(0, 0))
    return c


def _of_vertices(plant: VertexPlant, claim: LyapunovClaim) -> Iterator[Required]:
    P, K = (rationals(M) for M in claim.fitting(plant))
    count = len(plant.A)
    loops = []
    for i in range(count):
        system = (rationals(M[i]) for M in (plant.A, plant.B, plant.C, plant.D))
        own = P[min(i, len(P) - 1)], K[min(i, len(K) - 1)]
        loops.append(_loop(*(PolynomialMatrix.constant(M, UNIT) for M in (*system, *own))))
    for i, loop in enumerate(loops[: len(P)]):
        yield Required(POSITIVE, loop.P, f"vertex {i + 1}" if len(P) > 1 else "every vertex", i)
    for i, loop in enumerate(loops):
        for j in range(len(P)):
            after = f", followed by vertex {j + 1}" if len(P) > 1 else ""
            where = f"vertex {i + 1} of {count}{after}"
            form = _form(claim, loop, loops[j].P, None, plant.dt)
            yield Required("V falls", form, where, i)


def _of_grid(plant: GridPlant, claim: LyapunovClaim) -> Iterator[Required]:
    P, K = (rationals(M) for M in claim.fitting(plant))
    p = rationals(plant.p)
    system = [rationals(M) for M in (plant.A, plant.B, plant.C, plant.D)]
    for k in range(len(p) - 1):
        box = ((p[k], p[k + 1]),)
        loop = _loop(*(_straight(M, k, box) for M in (*system, P, K)))
        yield Required(POSITIVE, loop.P, "", None)
        if plant.dt is None:
            for slope in _slopes(loop.P, plant.rate):
                yield Required("V falls", _form(claim, loop, loop.P, slope, None), "", None)
            continue
        for own, after in _successors(plant, p, P, loop):
            yield Required("V falls", _form(claim, own, after, None, plant.dt), "", None)


def _straight(M: Array, k: int, box: Any) -> PolynomialMatrix:
    if len(M) == 1:
        return PolynomialMatrix.constant(M[0], box)
    return PolynomialMatrix(box, np.stack([M[k], M[k + 1]]))


def _loop(*matrices: PolynomialMatrix) -> Closed:
    A, B, C, D, P, K = matrices
    return Closed(A + B @ K, B, C + D @ K, D, P) if K.shape[0] else Closed(A, B, C, D, P)


def _slopes(P: PolynomialMatrix, rate: float) -> list[PolynomialMatrix | None]:
    if P.degrees == (0,) or rate == 0:
        return [None]
    own = P.derivative(0)
    return [own * as_fraction(rate), own * -as_fraction(rate)]


def _successors(
    plant: GridPlant, p: Array, P: Array, loop: Closed
) -> Iterator[tuple[Closed, PolynomialMatrix]]:
    """Yield the loop on parts of its cell with P(p(k + 1)) at every corner of where p may be then:
    at the limits of the step, straight lines of p, and at points of the grid between them.
    """
    (a, b), low, high = loop.P.box[0], p[0], p[-1]
    if len(P) == 1 or plant.rate == 0:
        yield loop, loop.P
        return
    assert plant.dt is not None  # noqa: S101
    step = high - low
    if not math.isinf(plant.rate):
        step = min(step, as_fraction(plant.rate) * as_fraction(plant.dt))
    cuts = {a, b, *(c for q in p for c in (q - step, q + step) if a < c < b)}
    ends = sorted(cuts)
    for c, d in pairwise(ends):
        box = ((c, d),)
        own = Closed(*(M.restrict(box) for M in loop))
        for side in (-step, step):
            q = [min(max(v + side, low), high) for v in (c, d)]
            yield own, PolynomialMatrix(box, np.stack([_at(p, P, v) for v in q]))
        for k, q in enumerate(p):
            if d - step <= q <= c + step:
                yield own, PolynomialMatrix.constant(P[k], box)


def _at(p: Array, P: Array, q: Any) -> Array:
    k = max(i for i in range(len(p) - 1) if p[i] <= q)
    t = (q - p[k]) / (p[k + 1] - p[k])
    return (1 - t) * P[k] + t * P[k + 1]


def _form(
    claim: LyapunovClaim,
    loop: Closed,
    after: PolynomialMatrix,
    slope: PolynomialMatrix | None,
    dt: float | None,
) -> PolynomialMatrix:
    """Return what must be positive definite besides P."""
    A, B, C, D, P = loop
    if dt is None:
        top = (P @ A) + (P @ A).T
        top = top if slope is None else top + slope
        side = P @ B
    else:
        moved = after @ A
        top, side = A.T @ moved, A.T @ (after @ B)
    if claim.kind == "decay rate":
        if dt is None:
            return -(top + P * (2 * as_fraction(claim.bound)))
        return P - top * as_fraction(growth_of(claim.bound, dt))
    top = top if dt is None else top - P
    if claim.kind == "stability":
        return -top
    corner = D.T @ D if dt is None else D.T @ D + B.T @ (after @ B)
    level = _identity(B.shape[1], B.box) * as_fraction(claim.bound) ** 2
    cross = side + C.T @ D
    return -block([[top + C.T @ C, cross], [cross.T, corner - level]])


def _identity(n: int, box: Any) -> PolynomialMatrix:
    return PolynomialMatrix.constant(rationals(np.eye(n)), box)
