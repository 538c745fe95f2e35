"""Polynomials of several variables with rational coefficients: few terms of many."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement

import numpy as np

from symheli.values.arrays import Array

Exponents = tuple[int, ...]
Terms = Mapping[Exponents, Fraction]


@dataclass(frozen=True)
class SparsePolynomial:
    """A polynomial of `size` variables: {exponents: coefficient}, no coefficient zero.

    Examples
    --------
    >>> x, y = SparsePolynomial.variables(2)
    >>> (x + y) * (x - y) == x * x - y * y
    True
    """

    size: int
    terms: Terms

    def __post_init__(self) -> None:
        kept = {k: Fraction(c) for k, c in self.terms.items() if c != 0}
        object.__setattr__(self, "terms", kept)

    @classmethod
    def constant(cls, value: Fraction | int, size: int) -> SparsePolynomial:
        """Return a constant."""
        return cls(size, {(0,) * size: Fraction(value)})

    @classmethod
    def variables(cls, size: int) -> tuple[SparsePolynomial, ...]:
        """Return every variable as a polynomial."""
        units = np.eye(size, dtype=int).tolist()
        return tuple(cls(size, {tuple(unit): Fraction(1)}) for unit in units)

    @property
    def degree(self) -> int:
        """Largest sum of exponents; 0 of the zero polynomial."""
        return max(map(sum, self.terms), default=0)

    @property
    def order(self) -> int:
        """Smallest sum of exponents; 0 of the zero polynomial."""
        return min(map(sum, self.terms), default=0)

    def __add__(self, other: SparsePolynomial) -> SparsePolynomial:
        terms = dict(self.terms)
        for k, c in other.terms.items():
            terms[k] = terms.get(k, Fraction(0)) + c
        return SparsePolynomial(self.size, terms)

    def __neg__(self) -> SparsePolynomial:
        return self * -1

    def __sub__(self, other: SparsePolynomial) -> SparsePolynomial:
        return self + other * -1

    def __mul__(self, other: SparsePolynomial | Fraction | int) -> SparsePolynomial:
        if not isinstance(other, SparsePolynomial):
            own = Fraction(other)
            return SparsePolynomial(self.size, {k: own * c for k, c in self.terms.items()})
        out: dict[Exponents, Fraction] = {}
        for a, x in self.terms.items():
            for b, y in other.terms.items():
                k = tuple(i + j for i, j in zip(a, b, strict=True))
                out[k] = out.get(k, Fraction(0)) + x * y
        return SparsePolynomial(self.size, out)

    def derivative(self, axis: int) -> SparsePolynomial:
        """Return the derivative by one variable."""
        terms = {
            (*k[:axis], k[axis] - 1, *k[axis + 1 :]): k[axis] * c
            for k, c in self.terms.items()
            if k[axis]
        }
        return SparsePolynomial(self.size, terms)

    def along(self, f: Sequence[SparsePolynomial]) -> SparsePolynomial:
        """Return the derivative along dx/dt = f(x)."""
        zero = SparsePolynomial(self.size, {})
        return sum((self.derivative(i) * each for i, each in enumerate(f)), zero)

    def composed(self, inner: Sequence[SparsePolynomial]) -> SparsePolynomial:
        """Return the polynomial of these polynomials in place of its variables."""
        size = inner[0].size
        powers = [[SparsePolynomial.constant(1, size)] for _ in inner]
        total = SparsePolynomial(size, {})
        for k, c in self.terms.items():
            term = SparsePolynomial.constant(c, size)
            for e, own, each in zip(k, powers, inner, strict=True):
                while len(own) <= e:
                    own.append(own[-1] * each)
                term = term * own[e] if e else term
            total = total + term
        return total

    def value(self, x: Sequence[Fraction]) -> Fraction:
        """Return the value at a point of rationals."""
        return sum(
            (c * math.prod(v**e for v, e in zip(x, k, strict=True)) for k, c in self.terms.items()),
            Fraction(0),
        )

    def values(self, x: Array) -> Array:
        """Return the values at points (..., n) in floating point."""
        return evaluated(self.exponents, self.coefficients, x)

    @property
    def exponents(self) -> Array:
        """Exponents of the terms (K, n)."""
        return np.array(list(self.terms), dtype=int).reshape(-1, self.size)

    @property
    def coefficients(self) -> Array:
        """Coefficients of the terms (K,) as doubles."""
        return np.array([float(c) for c in self.terms.values()])

    def text(self, names: Sequence[str]) -> str:
        """Return the polynomial in words that Python reads, with six digits."""
        return " + ".join(_term(k, c, names) for k, c in self.terms.items()) or "0"


def _term(k: Exponents, c: Fraction, names: Sequence[str]) -> str:
    powers = [f"{n}**{e}" if e > 1 else n for n, e in zip(names, k, strict=True) if e]
    return "*".join([f"{float(c):.6g}", *powers])


def evaluated(exponents: Array, coefficients: Array, x: Array) -> Array:
    """Return the sums of c_k x^k at points (..., n), exponents (K, n)."""
    return np.prod(x[..., None, :] ** exponents, axis=-1) @ coefficients


def linear_substitution(T: Array) -> tuple[SparsePolynomial, ...]:
    """Return x = T z as polynomials of z; the doubles are the rationals that they are."""
    m = T.shape[1]
    z = SparsePolynomial.variables(m)
    zero = SparsePolynomial(m, {})
    return tuple(
        sum((v * Fraction(float(t)) for t, v in zip(row, z, strict=True)), zero) for row in T
    )


def monomials(size: int, least: int, most: int) -> Iterator[Exponents]:
    """Yield the exponents of all monomials of degrees from least to most."""
    for degree in range(least, most + 1):
        for chosen in combinations_with_replacement(range(size), degree):
            yield tuple(chosen.count(i) for i in range(size))
