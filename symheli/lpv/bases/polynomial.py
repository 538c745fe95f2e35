"""Polynomials in the scheduling parameter, orthonormal inside, monomial on request."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import ClassVar

import numpy as np
from numpy.polynomial import chebyshev, legendre

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.arrays import Array, frozen
from symheli.lpv.bases.basis import Basis, Piece, check_range


@dataclass(frozen=True)
class Polynomial(Basis):
    """Polynomials of degree 0 .. `degree` in p, as Legendre polynomials orthonormal over [low, high].

    f_j(p) = sqrt(2 j + 1) P_j(x), x = (2 p - low - high)/(high - low): condition number of the Gramian over
    the range is 1, where raw monomials p^j on 0-13 m/s have 1e6 at degree 5.
    """

    degree: int
    low: float
    high: float

    GRADED: ClassVar = ("orthonormal", "legendre", "chebyshev", "scaled", "monomial")
    """Forms whose j-th function is of degree j: these polynomials, P_j(x), T_j(x), x^j with x in [-1, 1], and p^j in physical units."""

    def __post_init__(self) -> None:
        check_range(self.low, self.high)
        if int(self.degree) != self.degree or self.degree < 0:
            raise InputError(f"degree must be an integer >= 0, got {self.degree}")

    @property
    def size(self) -> int:
        """degree + 1."""
        return self.degree + 1

    @property
    def distinct_values(self) -> int:
        """degree + 1 values of p determine a polynomial."""
        return self.degree + 1

    @cached_property
    def _norms(self) -> Array:
        return np.sqrt(2.0 * np.arange(self.size) + 1.0)

    def _values(self, p: Array, derivative: int) -> Array:
        x = (2.0 * p - self.low - self.high) / (self.high - self.low)
        if derivative == 0:
            return (legendre.legvander(x, self.degree) * self._norms).reshape(*p.shape, self.size)
        scale = (2.0 / (self.high - self.low)) ** derivative
        rows = legendre.legder(np.diag(self._norms), m=derivative, axis=0) * scale
        if rows.shape[0] == 0:
            return np.zeros((*p.shape, self.size))
        return np.moveaxis(legendre.legval(x, rows), 0, -1)

    @cached_property
    def monomial(self) -> Array:
        """Matrix T (n, n): f_j(p) = sum_i T[j, i] p^i, p in physical units."""
        rows = np.zeros((self.size, self.size))
        shift = np.polynomial.Polynomial([-(self.low + self.high) / (self.high - self.low), 2.0 / (self.high - self.low)])
        for j in range(self.size):
            power = legendre.leg2poly(np.eye(self.size)[j]) * self._norms[j]
            coefficients = np.polynomial.Polynomial(power)(shift).coef
            rows[j, : len(coefficients)] = coefficients
        return frozen(rows, "monomial")

    def form(self, name: str) -> Array:
        """Matrix T (n, n): f_j = sum_i T[j, i] g_i for the forms in `GRADED` and "bernstein" (over [low, high])."""
        match name:
            case "orthonormal":
                return np.eye(self.size)
            case "legendre":
                return np.diag(self._norms)
            case "chebyshev" | "scaled":
                power = [legendre.leg2poly(row) for row in np.diag(self._norms)]
                rows = [chebyshev.poly2cheb(r) for r in power] if name == "chebyshev" else power
                return np.stack([np.pad(r, (0, self.size - len(r))) for r in rows])
            case "monomial":
                return self.monomial
            case "bernstein":
                return self.pieces()[0].bernstein
        raise UnknownNameError("form", name, (*self.GRADED, "bernstein"))

    def from_monomial(self, coefficients: object) -> Array:
        """Coefficients in this basis (n, ...) of sum_i p^i M_i with M = `coefficients` (at most n, ...), p in physical units."""
        given = frozen(coefficients, "monomial coefficients")
        if given.shape[0] > self.size:
            raise InputError(f"degree {given.shape[0] - 1} does not fit in a basis of degree {self.degree}")
        padded = np.zeros((self.size, *given.shape[1:]))
        padded[: given.shape[0]] = given
        return np.linalg.solve(self.monomial.T, padded.reshape(self.size, -1)).reshape(padded.shape)

    def to_monomial(self, coefficients: object) -> Array:
        """Monomial coefficients M_i (n, ...) in physical units of p from coefficients in this basis (n, ...)."""
        return np.tensordot(self.monomial.T, frozen(coefficients, "coefficients"), axes=1)

    def pieces(self) -> tuple[Piece, ...]:
        """One piece: the Bernstein coefficients of each function over [low, high]."""
        d = self.degree
        x_power = np.stack([np.pad(legendre.leg2poly(row), (0, d + 1))[: d + 1] for row in np.diag(self._norms)])
        shift = np.zeros((d + 1, d + 1))  # x = 2 s - 1
        for i in range(d + 1):
            for k in range(i + 1):
                shift[i, k] = comb(i, k) * 2.0**k * (-1.0) ** (i - k)
        power_to_bernstein = np.array([[comb(i, k) / comb(d, k) if k <= i else 0.0 for i in range(d + 1)] for k in range(d + 1)])
        return (Piece(self.low, self.high, x_power @ shift @ power_to_bernstein),)
