"""The inequalities that prove a region of attraction, and their exact check.

With x = T z, W(z) = V(x) and E(z) the derivative of V along f, all polynomials in z:

    W = c' R c,    -sigma E - s (level - W) = m' Q m,    sigma = a' A a,    s = b' B b

with monomials a, b, c, m of z and R, Q, A, B > 0. Neither c nor m vanishes but at 0. So V > 0 but
at 0 and V grows without bound; where V <= level, x not 0: sigma dV/dt <= -m' Q m < 0, and dV/dt < 0
since sigma >= 0. The set V <= level is compact, no motion leaves it, and by Lyapunov's theorem all
motions in it tend to 0 (Khalil, Nonlinear Systems, theorem 4.1). Without s this holds for every
level. Source of the programs: Parrilo (2000); Tan and Packard, IEEE TAC 53 (2008).
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.direction import not_positive
from synthesis.numerics.polynomial.exact import exact, positive_definite, rational
from synthesis.numerics.polynomial.gram import gram_polynomial, has_pure_powers, positive_on_all
from synthesis.numerics.polynomial.multivariate import (
    Exponents,
    SparsePolynomial,
    linear_substitution,
)

POWERS_OF_V, NOT_POSITIVE = (
    "the monomials of V leave a direction out",
    "V is not shown to be positive definite",
)


class Gram(NamedTuple):
    """A sum of squares m' Q m: exponents of the monomials m, and Q (k, k) in doubles."""

    basis: tuple[Exponents, ...]
    Q: Array

    def polynomial(self, size: int) -> SparsePolynomial:
        """Return the sum of squares."""
        return gram_polynomial(self.basis, self.Q, size)

    @property
    def is_sum_of_squares(self) -> bool:
        """Whether Q is positive definite; nothing at all is zero."""
        Q = exact(self.Q, rational())
        return len(Q) == 0 or (np.array_equal(self.Q, self.Q.T) and positive_definite(Q))


class RegionProof(NamedTuple):
    """T (n, n) of x = T z, and the sums of squares: V, sigma, s, and the rest that is positive."""

    T: Array
    V: Gram
    sigma: Gram
    s: Gram
    rest: Gram


def why_not(V: SparsePolynomial, change: SparsePolynomial, level: float, proof: RegionProof) -> str:
    """Return why the proof does not hold; empty where V > 0 grows without bound and its change is
    proven to be negative where V <= level, but at 0.
    """
    n, x = V.size, linear_substitution(proof.T)
    if not _regular(proof.T):
        return "the coordinates are not regular"
    W, E = V.composed(x), change.composed(x)
    if not has_pure_powers(proof.V.basis, n):
        return POWERS_OF_V
    if not positive_on_all(W, *proof.V):
        return NOT_POSITIVE
    if not (proof.sigma.is_sum_of_squares and proof.s.is_sum_of_squares):
        return "a multiplier is not shown to be positive"
    return "" if _falls(W, E, level, proof) else "dV/dt is not shown to be negative in the region"


def _falls(W: SparsePolynomial, E: SparsePolynomial, level: float, proof: RegionProof) -> bool:
    n = W.size
    p = -(proof.sigma.polynomial(n) * E)
    if math.isfinite(level):
        room = SparsePolynomial.constant(Fraction(level), n) - W
        p = p - proof.s.polynomial(n) * room
    elif len(proof.s.basis):
        return False
    fits = level > 0 and has_pure_powers(proof.rest.basis, n)
    return fits and positive_on_all(p, *proof.rest)


def _regular(T: Array) -> bool:
    """Whether T'T is positive definite."""
    own = exact(T, rational())
    return positive_definite(own.T @ own)


def costs(Q: Array, R: Array, K: Array) -> bool:
    """Whether Q + K'R K is positive semidefinite, in rational arithmetic."""
    weights, moves, feedback = (exact(M, rational()) for M in (Q, R, K))
    found = not_positive(weights + feedback.T @ moves @ feedback)
    return found is None or found[0] == 0


def within(P: Array, row: Array, bound: float, alpha: float) -> bool:
    """Whether |row x| < bound for all x'P x <= alpha, in rational arithmetic."""
    number = rational()
    k, own = exact(row[None], number), exact(P, number)
    return positive_definite(own * number(bound) ** 2 - (k.T @ k) * number(alpha))
