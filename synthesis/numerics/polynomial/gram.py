"""Sums of squares m' Q m of monomials m: which monomials, and an exact Q from a nearby one."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction

import numpy as np
from scipy.optimize import linprog

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import exact, positive_definite, rational
from synthesis.numerics.polynomial.multivariate import Exponents, SparsePolynomial, monomials


def sum_exponents(a: Exponents, b: Exponents) -> Exponents:
    """Return the exponents of a product of two monomials."""
    return tuple(i + j for i, j in zip(a, b, strict=True))


def half_polytope(support: Collection[Exponents]) -> list[Exponents]:
    """Return the monomials m that a sum of squares of this support is made of.

    Their doubles lie in the Newton polytope, the convex hull of the support. Source: Reznick,
    "Extremal PSD forms with few terms", Duke Mathematical Journal 45 (1978).
    """
    points = np.array(sorted(support), dtype=float)
    sums = points.sum(axis=1)
    least, most = int(-(-sums.min() // 2)), int(sums.max() // 2)
    tried = monomials(points.shape[1], least, most)
    return [k for k in tried if _in_hull(2.0 * np.array(k, dtype=float), points)]


def _in_hull(x: Array, points: Array) -> bool:
    if np.any(np.all(points == x, axis=1)):
        return True
    if np.any(x > points.max(axis=0)) or np.any(x < points.min(axis=0)):
        return False
    A = np.vstack([points.T, np.ones(len(points))])
    found = linprog(np.zeros(len(points)), A_eq=A, b_eq=np.append(x, 1.0), method="highs")
    return found.status == 0


def gram_polynomial(basis: Sequence[Exponents], Q: Array, size: int) -> SparsePolynomial:
    """Return m' Q m of the monomials m, Q (k, k) doubles or rationals."""
    terms: dict[Exponents, Fraction] = {}
    for a, row in zip(basis, Q, strict=True):
        for b, value in zip(basis, row, strict=True):
            k = sum_exponents(a, b)
            terms[k] = terms.get(k, Fraction(0)) + Fraction(value)
    return SparsePolynomial(size, terms)


def exact_gram(p: SparsePolynomial, basis: Sequence[Exponents], Q: Array) -> Array | None:
    """Return Q of rationals near a symmetric one with p = m' Q m exactly.

    Each coefficient that is missing is spread evenly over the entries with that product; None:
    there is no such entry.
    """
    places: dict[Exponents, list[tuple[int, int]]] = {}
    for i, a in enumerate(basis):
        for j, b in enumerate(basis):
            places.setdefault(sum_exponents(a, b), []).append((i, j))
    rest = p - gram_polynomial(basis, Q, p.size)
    if any(k not in places for k in rest.terms):
        return None
    out = exact(Q, rational())
    for k, c in rest.terms.items():
        for i, j in places[k]:
            out[i, j] += c / len(places[k])
    return out


def positive_on_all(p: SparsePolynomial, basis: Sequence[Exponents], Q: Array) -> bool:
    """Whether p(x) >= c |m(x)|^2 for some c > 0, with Q that `exact_gram` makes exact."""
    own = exact_gram(p, basis, Q)
    even = np.array_equal(Q, np.asarray(Q).T)
    return own is not None and even and len(basis) > 0 and positive_definite(own)


def has_pure_powers(basis: Collection[Exponents], size: int) -> bool:
    """Whether the monomials vanish together at 0 only, and grow in every direction: none is the
    constant, and each variable has a power of its own among them.
    """
    own = {k.index(max(k)) for k in basis if sum(k) == max(k) > 0}
    return own == set(range(size)) and all(any(k) for k in basis)
