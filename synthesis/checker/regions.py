"""Level sets V <= level from which all motions of dx/dt = f(x) tend to 0, f and V polynomials.

With x = T z, W(z) = V(x), E(z) = grad V . f, and monomials a, b, c, m of z:

    W = c'Rc,  -(a'Aa) E - (b'Bb)(level - W) = m'Qm,  R, Q, A, B > 0

R and Q as stored, after the coefficients that are missing were spread over the entries with that
product. c and m hold a power of each variable and no constant: so V > 0 and dV/dt < 0 but at 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product as pairs
from typing import Any, NamedTuple

from .demands import Claim, Demand
from .polynomials import Exponents, Polynomial, combined, even, matrix, scalar, variable, zero
from .reading import HIGHEST_DEGREE, INFINITE, Unreadable, array, number, whole

Terms = dict[Exponents, Fraction]
KIND = "region of attraction"


class Gram(NamedTuple):
    """m'Qm of monomials m by their exponents."""

    monomials: Sequence[Exponents]
    Q: Sequence[Sequence[Fraction]]

    def places(self) -> Iterator[tuple[Exponents, int, int]]:
        """Yield the product of every two monomials, and the entry of Q at which it stands."""
        for (i, a), (j, b) in pairs(enumerate(self.monomials), repeat=2):
            yield tuple(x + y for x, y in zip(a, b, strict=True)), i, j

    def polynomial(self) -> Polynomial:
        """Return it as a scalar polynomial."""
        terms: Terms = {}
        for k, i, j in self.places():
            terms[k] = terms.get(k, Fraction(0)) + self.Q[i][j]
        return _polynomial(terms)

    def made_equal(self, p: Polynomial) -> Polynomial | None:
        """Return Q with p = m'Qm exactly; None: a monomial of p is none of the products."""
        rest, own = _terms(p - self.polynomial(), len(self.monomials[0])), {}
        for k, i, j in self.places():
            own.setdefault(k, []).append((i, j))
        Q = [list(row) for row in self.Q]
        for k, c in rest.items():
            for i, j in own.get(k, ()):
                Q[i][j] += c / len(own[k])
        return even(Q) if rest.keys() <= own.keys() else None

    def vanishes_at_zero_only(self, n: int) -> bool:
        """Whether a power of every variable is among the monomials, and no constant."""
        alone = {k.index(max(k)) for k in self.monomials if sum(k) == max(k) > 0}
        return alone == set(range(n)) and all(map(any, self.monomials))


def _polynomial(terms: Terms) -> Polynomial:
    return (
        combined([_power(k) for k in terms], [scalar(c) for c in terms.values()])
        if terms
        else (zero(1, 1))
    )


def _power(k: Exponents) -> Polynomial:
    last = max((i + 1 for i, e in enumerate(k) if e), default=0)
    return Polynomial((1, 1), {k[:last]: [[1]]})


def _terms(p: Polynomial, n: int) -> Terms:
    own = p.reduced()
    return {
        (*k, *(0,) * (n - len(k))): Fraction(rows[0][0], own.below) for k, rows in own.terms.items()
    }


def _exponents(given: Any, n: int) -> Exponents:
    if len(given) != n:
        raise Unreadable("the file is damaged: exponents that are not one for each state")
    return tuple(whole(e, "an exponent", 0) for e in given)


def _read(given: Any, n: int) -> Polynomial:
    """Return a polynomial without a constant of a list of terms."""
    terms = {_exponents(k, n): Fraction(str(c)) for k, c in given}
    if len(terms) < len(given) or any(not any(k) for k in terms):
        raise Unreadable("the file is damaged: a term twice, or f or V that is not 0 at 0")
    return _polynomial(terms)


def _gram(given: Any, n: int) -> Gram:
    own = [_exponents(k, n) for k in given["monomials"]]
    if len(set(own)) < len(own):
        raise Unreadable("the file is damaged: a monomial twice")
    Q = array(given["Q"], "a sum of squares", len(own), len(own))
    even(Q)
    return Gram(own, Q)


def _substituted(p: Polynomial, T: Sequence[Sequence[Fraction]]) -> Polynomial:
    """Return p at x = T z."""
    n = len(T)
    for i, row in enumerate(T):
        x = combined([variable(n + j) for j in range(n)], [scalar(t) for t in row])
        p = p.at(i, x)
    for j in range(n):
        p = p.at(n + j, variable(j))
    return p.reduced()


def claimed(content: Any) -> Claim:
    """Return what a file of a region claims; the fields of the file are named here alone."""
    states = [str(name) for name in content["states"]]
    n = whole(len(states), "the number of states", 1, HIGHEST_DEGREE)
    f, V = [_read(each, n) for each in content["f"]], _read(content["V"], n)
    level = None if content["level"] == INFINITE else number(content["level"], "the level")
    T = array(content["T"], "T", n, n)
    R, A, B, Q = (_gram(content[f"sum_{name}"], n) for name in ("V", "sigma", "s", "rest"))
    if len(f) != n or len(set(states)) < n:
        raise Unreadable("the file is damaged: states and equations do not fit")
    refused = "the level is not above zero" if level is not None and level <= 0 else ""
    if not (R.vanishes_at_zero_only(n) and Q.vanishes_at_zero_only(n)) or not A.monomials:
        refused = "monomials are missing, or one is constant"
    if level is None and B.monomials:
        refused = "a multiplier of no level"
    E = combined([V.derivative(i) for i in range(n)], f) if f else zero(1, 1)
    W, E = _substituted(V, T), _substituted(E, T)
    p = -(A.polynomial() @ E)
    if level is not None and B.monomials:
        p = p - B.polynomial() @ (scalar(level) - W)
    forms = [("V > 0", R.made_equal(W)), ("dV/dt < 0", Q.made_equal(p))] if not refused else []
    if any(form is None for _, form in forms):
        refused = "a polynomial has monomials that no sum of squares here has"
    own = matrix(T, n)
    demands = [Demand("x = T z for every x", own.T @ own)]
    demands += [Demand(name, form) for name, form in forms if form is not None]
    demands += [Demand("a multiplier", even(each.Q)) for each in (A, B) if each.monomials]
    where = "every start" if level is None else f"every start with V(x) <= {float(level)!r}"
    claim = f"the motion from {where} tends to 0 and keeps V at most at that level"
    if level is None:
        claim = f"the motion from {where} tends to 0"
    said = [f"dx/dt = f(x) of {n} states, polynomials of degree {_degree(f)}, V of {_degree([V])}"]
    return Claim(claim, said, demands, refused=refused)


def _degree(polynomials: Sequence[Polynomial]) -> int:
    return max((sum(k) for p in polynomials for k in p.terms), default=0)
