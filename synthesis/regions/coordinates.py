"""Coordinates in which a level set is nearly the unit ball, and points where V stops falling."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.multivariate import SparsePolynomial

SEED = 20
DIRECTIONS = 400
"""Random directions in which a level set is sampled."""
ROUNDS = 4
"""Changes of coordinates until the level set is nearly round."""
ROUND_ENOUGH = 30.0
"""Condition of the ellipsoid about a level set that is left as it is."""
BITS = 8
"""Bits to which the coordinates are rounded, a row: exact products of them stay short."""
REFINED, FEWER = 14, 60
"""Rounds of directions about the best one, each half as wide, and their number."""
RISING = 1e-9
"""Share of the largest size from which the terms of least degree count as positive."""
LARGEST = 1e6
"""Distance from 0, in coordinates of the level set, beyond which nothing is looked for."""


def directions(n: int, count: int = DIRECTIONS, seed: int = SEED) -> Array:
    """Return unit vectors (K, n), the same for the same numbers, each beside its negative."""
    if n == 1:
        return np.array([[1.0], [-1.0]])
    u = np.random.default_rng(seed).standard_normal((count, n))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return np.concatenate([u, -u])


def first_root(p: SparsePolynomial, T: Array, u: Array, level: float = 0.0) -> Array:
    """Return the least r > 0 with p(T u r) = level in each direction u (K, n); inf without one.

    With level 0 the lowest power of r is divided out.
    """
    powers = p.exponents.sum(axis=1)
    first = 0 if level else p.order
    x, c = u @ T.T, p.coefficients
    parts = np.zeros((len(u), p.degree - first + 1))
    values = np.prod(x[:, None, :] ** p.exponents, axis=-1) * c
    for k, each in zip(powers, values.T, strict=True):
        parts[:, k - first] += each
    parts[:, 0] -= level
    return _least_positive(parts)


def _least_positive(c: Array) -> Array:
    """Return the least positive root of each polynomial, coefficients (K, d + 1) ascending."""
    d = c.shape[1] - 1
    if d == 0:
        return np.full(len(c), np.inf)
    first = np.where(c[:, 0] == 0, np.finfo(float).tiny, c[:, 0])
    companion = np.zeros((len(c), d, d))
    with np.errstate(all="ignore"):
        companion[:, 0] = np.nan_to_num(-c[:, 1:] / first[:, None])
    companion[:, range(1, d), range(d - 1)] = 1.0
    inverse = np.linalg.eigvals(companion)
    real = np.abs(inverse.imag) <= 1e-7 * np.abs(inverse)
    largest = np.where(real, inverse.real, 0.0).max(axis=1, initial=0.0)
    with np.errstate(divide="ignore"):
        r = 1.0 / largest
    return np.where(r < LARGEST, r, np.inf)


def round_coordinates(V: SparsePolynomial, level: float, T: Array | None = None) -> Array:
    """Return T (n, n), x = T z, in which the set V <= level is nearly the unit ball.

    T is diagonal where that does: equations keep the terms that they lack.
    """
    n = V.size
    if T is None:
        r = first_root(V, np.eye(n), np.eye(n), level)
        T = np.diag(np.where(np.isfinite(r), r, 1.0))
    for _ in range(ROUNDS):
        u = directions(n)
        r = first_root(V, T, u, level)
        z = u[np.isfinite(r)] * r[np.isfinite(r), None]
        if len(z) < 2 * n:
            break
        P = _fitted(z)
        if P is None:
            break
        if np.linalg.cond(P) < ROUND_ENOUGH:
            return T * np.sqrt((z * z).sum(axis=1).mean())
        T = T @ np.linalg.inv(np.linalg.cholesky(P)).T
    return T


def _fitted(z: Array) -> Array | None:
    """Return P > 0 of an ellipsoid z'P z = 1 through points (K, n), by the mean of their outer
    products; None: there is none.
    """
    n = z.shape[1]
    mean = z.T @ z / len(z)
    P = np.linalg.inv(mean) / n if np.linalg.matrix_rank(mean) == n else None
    return P if P is not None and np.linalg.eigvalsh(P)[0] > 0 else None


def short(T: Array) -> Array:
    """Return T with few bits in each row."""
    _, e = np.frexp(np.abs(T).max(axis=1))
    unit = np.ldexp(1.0, e - BITS)[:, None]
    return np.round(T / unit) * unit


def rises_near_zero(E: SparsePolynomial, T: Array) -> bool:
    """Whether the terms of least degree of E are positive in some direction."""
    lowest = SparsePolynomial(E.size, {k: c for k, c in E.terms.items() if sum(k) == E.order})
    found = lowest.values(directions(E.size) @ T.T)
    return bool(found.max() > RISING * np.abs(found).max())


def ceiling(V: SparsePolynomial, E: SparsePolynomial, T: Array) -> tuple[float, Array | None]:
    """Return the least V found where dV/dt = E changes its sign, and the z there; (inf, None)
    where it does not.
    """
    n = V.size
    u = directions(n, 6 * DIRECTIONS)
    best, where = _least(V, E, T, u)
    rng, width = np.random.default_rng(SEED), 0.2
    for _ in range(REFINED):
        if where is None or n == 1:
            break
        about = where / np.linalg.norm(where) + width * rng.standard_normal((FEWER, n))
        about /= np.linalg.norm(about, axis=1, keepdims=True)
        level, z = _least(V, E, T, about)
        if level < best:
            best, where = level, z
        width *= 0.5
    return best, where


def _least(
    V: SparsePolynomial, E: SparsePolynomial, T: Array, u: Array
) -> tuple[float, Array | None]:
    r = first_root(E, T, u)
    z = np.where(np.isfinite(r), r, 0.0)[:, None] * u
    levels = np.where(np.isfinite(r), V.values(z @ T.T), np.inf)
    k = int(np.argmin(levels))
    return (float(levels[k]), z[k]) if np.isfinite(levels[k]) else (np.inf, None)


def rising_point(E: SparsePolynomial, x: Array) -> Array | None:
    """Return a point near x, outwards, where dV/dt >= 0 exactly; None without one."""
    tries = (x * (1.0 + 2.0**-k) for k in range(50, 6, -2))
    return next((tried for tried in tries if rises_at(E, tried)), None)


def rises_at(E: SparsePolynomial, x: Array) -> bool:
    """Whether x is not 0 and E(x) >= 0, in exact arithmetic."""
    return bool(np.any(x)) and E.value([Fraction(float(v)) for v in x]) >= 0
