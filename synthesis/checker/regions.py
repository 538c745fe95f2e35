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
from .reading import INFINITE, Unreadable, array, number, whole

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


def read(given: Any, n: int) -> Polynomial:
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


def composed(p: Polynomial, inner: Sequence[Polynomial], n: int) -> Polynomial:
    """Return p with these polynomials of n variables in place of its own."""
    m = len(inner)
    for i, x in enumerate(inner):
        for j in reversed(range(n)):
            x = x.at(j, variable(m + j))
        p = p.at(i, x)
    for j in range(n):
        p = p.at(m + j, variable(j))
    return p.reduced()


def linear(T: Sequence[Sequence[Fraction]]) -> list[Polynomial]:
    """Return the rows of T z as polynomials."""
    return [combined([variable(j) for j in range(len(row))], [scalar(t) for t in row]) for row in T]


def substituted(p: Polynomial, T: Sequence[Sequence[Fraction]]) -> Polynomial:
    """Return p at x = T z."""
    return composed(p, linear(T), len(T[0]))


def decrease(
    content: Any, V: Polynomial, E: Polynomial, level: Fraction | None
) -> tuple[list[Demand], str]:
    """Return what proves V > 0, and E < 0 where V <= level (None: everywhere), but at 0; and why
    nothing can.
    """
    n = len(content["states"])
    T = array(content["T"], "T", n, n)
    R, A, B, Q = (_gram(content[f"sum_{name}"], n) for name in ("V", "sigma", "s", "rest"))
    if level is not None and level <= 0:
        return [], "the level is not above zero"
    if not (R.vanishes_at_zero_only(n) and Q.vanishes_at_zero_only(n) and A.monomials):
        return [], "monomials are missing, or one is constant"
    if level is None and B.monomials:
        return [], "a multiplier of no level"
    W, p = substituted(V, T), -(A.polynomial() @ substituted(E, T))
    if level is not None and B.monomials:
        p = p - B.polynomial() @ (scalar(level) - W)
    own = matrix(T, n)
    demands = [Demand("x = T z for every x", own.T @ own)]
    for name, form in (("V > 0", R.made_equal(W)), ("V falls", Q.made_equal(p))):
        if form is None:
            return [], f"{name}: a polynomial has monomials that no sum of squares here has"
        demands.append(Demand(name, form))
    demands += [Demand("a multiplier", even(each.Q)) for each in (A, B) if each.monomials]
    return demands, ""


def claimed(content: Any) -> Claim:
    """Return what a file of a region claims; the fields of the file are named here and above."""
    n = named(content["states"])
    f, V = [read(each, n) for each in content["f"]], read(content["V"], n)
    if len(f) != n:
        raise Unreadable("the file is damaged: states and equations do not fit")
    level = None if content["level"] == INFINITE else number(content["level"], "the level")
    E = combined([V.derivative(i) for i in range(n)], f)
    demands, refused = decrease(content, V, E, level)
    claim = "the motion from every start tends to 0"
    if level is not None:
        where = f"every start with V(x) <= {float(level)!r}"
        claim = f"the motion from {where} tends to 0 and keeps V at most at that level"
    said = [f"dx/dt = f(x) of {n} states, polynomials of degree {degree(f)}, V of {degree([V])}"]
    return Claim(claim, said, demands, refused=refused)


def named(states: Any) -> int:
    """Return how many different names these are, at least one."""
    if len({str(name) for name in states}) < len(states):
        raise Unreadable("the file is damaged: a name twice")
    return whole(len(states), "the number of states", 1)


def degree(polynomials: Sequence[Polynomial]) -> int:
    """Return the largest degree."""
    return max((sum(k) for p in polynomials for k in p.terms), default=0)
