"""Forms of degree 2m as quadratic forms in the monomials of degree m, and the null space of that
representation.

z(x) holds the monomials x^a, |a| = m, of n variables, N = C(n + m - 1, m) of them. A form z' M z
does not determine M: the symmetric matrices with z' L z = 0 are added at will (the Gram method,
Choi, Lam and Reznick 1995). All arrays here are of integers, so that every identity is exact in any
arithmetic.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from symheli.values.arrays import Array


@lru_cache(maxsize=16)
def monomials(n: int, m: int) -> tuple[tuple[int, ...], ...]:
    """The N monomials, each as m indices of variables in ascending order."""
    return tuple(combinations_with_replacement(range(n), m))


def power(T: Array, m: int) -> Array:
    """Matrix (N, N) of z(T x) = power z(x)."""
    z = monomials(len(T), m)
    place = {a: i for i, a in enumerate(z)}
    out = np.zeros((len(z), len(z)))
    for row, factors in enumerate(z):
        products: dict[tuple[int, ...], float] = {(): 1.0}
        for i in factors:
            grown: dict[tuple[int, ...], float] = {}
            for a, value in products.items():
                for j in np.flatnonzero(T[i]):
                    key = tuple(sorted((*a, int(j))))
                    grown[key] = grown.get(key, 0.0) + value * T[i, j]
            products = grown
        for a, value in products.items():
            out[row, place[a]] = value
    return out


@lru_cache(maxsize=16)
def _derivation(n: int, m: int) -> tuple[tuple[int, int, int, int, int], ...]:
    """(row, column, i, j, times): z_row' contains times A_ij z_column."""
    z = monomials(n, m)
    place = {a: i for i, a in enumerate(z)}
    out = []
    for row, factors in enumerate(z):
        for i in sorted(set(factors)):
            rest = list(factors)
            rest.remove(i)
            for j in range(n):
                out.append((row, place[tuple(sorted((*rest, j)))], i, j, factors.count(i)))
    return tuple(out)


def generator(A: Array, m: int) -> Array:
    """Matrices (..., N, N) of dz/dt = generator z where dx/dt = A x, A (..., n, n) in any
    arithmetic.
    """
    if m == 1:
        return A
    N = len(monomials(A.shape[-1], m))
    out = np.zeros((*A.shape[:-2], N, N), dtype=A.dtype)
    for row, column, i, j, times in _derivation(A.shape[-1], m):
        out[..., row, column] += times * A[..., i, j]
    return out


@lru_cache(maxsize=16)
def _pairs(n: int, m: int) -> tuple[tuple[tuple[int, int], tuple[int, int]], ...]:
    """For every matrix of the null space, its own entry and the entry that cancels it."""
    z = monomials(n, m)
    first: dict[tuple[int, ...], tuple[int, int]] = {}
    out = []
    for b in range(len(z)):
        for a in range(b + 1):
            key = tuple(sorted(z[a] + z[b]))
            if key in first:
                out.append(((a, b), first[key]))
            else:
                first[key] = (a, b)
    return tuple(out)


def null_size(n: int, m: int) -> int:
    """Return the dimension of the symmetric matrices L with z' L z = 0."""
    return len(_pairs(n, m)) if m > 1 else 0


def null_matrix(weights: Array, n: int, m: int) -> Array:
    """The matrix L (..., N, N) with z' L z = 0 of these weights (..., null_size), in any
    arithmetic.
    """
    N = len(monomials(n, m))
    out = np.zeros((*weights.shape[:-1], N, N), dtype=weights.dtype)
    for k, entries in enumerate(_pairs(n, m)):
        for sign, (a, b) in zip((1, -1), entries, strict=True):
            # the entry and its mirror image; on the diagonal both are one
            out[..., a, b] += sign * weights[..., k]
            out[..., b, a] += sign * weights[..., k]
    return out


def null_weights(L: Array, n: int, m: int) -> Array:
    """The inverse of `null_matrix`, for matrices (..., N, N) with z' L z = 0."""
    own = np.array([entry for entry, _ in _pairs(n, m)])
    return L[..., own[:, 0], own[:, 1]] * np.where(own[:, 0] == own[:, 1], 0.5, 1.0)
