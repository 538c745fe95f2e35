"""Polynomials in the scheduling parameter, orthonormal inside, monomial on request."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from math import comb, log10
from typing import Any, ClassVar

import numpy as np
from numpy.polynomial import chebyshev, legendre

from symheli.errors import InputError, PrecisionWarning, UnknownNameError
from symheli.lpv.bases.basis import Basis, check_range
from symheli.lpv.bases.function_space import Piece
from symheli.lpv.recentred import centre, recentred
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole

MAX_LOST_DIGITS = 8.0
"""Number of lost decimal digits, half of a double's, above which a warning is given."""


@dataclass(frozen=True)
class Polynomial(Basis):
    """Legendre polynomials, orthonormal over a range, span the polynomials in p of degree 0 ..
    `degree`.

    f_j(p) = sqrt(2 j + 1) P_j(x), x = (2 p - low - high)/(high - low): condition number of the
    Gramian over the range is 1, where raw monomials p^j on 0-13 m/s have 1e6 at degree 5.

    Parameters
    ----------
    degree : int
        At least 0.
    low, high : float
        The range, in the unit of p.

    Raises
    ------
    InputError
        A negative degree, or an empty range.

    See Also
    --------
    symheli.lpv.BSpline, symheli.lpv.Product, symheli.lpv.UserFunctions

    Examples
    --------
    >>> from symheli.lpv import Polynomial
    >>> Polynomial(2, low=0.0, high=13.0)([0.0, 6.5, 13.0]).round(2)
    array([[ 1.  , -1.73,  2.24],
           [ 1.  ,  0.  , -1.12],
           [ 1.  ,  1.73,  2.24]])
    """

    degree: int
    low: float
    high: float

    GRADED: ClassVar = ("orthonormal", "legendre", "chebyshev", "scaled", "monomial")
    """Forms whose j-th function is of degree j: these polynomials, P_j(x), T_j(x), x^j with x in
    [-1, 1], and p^j in physical units.
    """

    def __post_init__(self) -> None:
        check_range(self.low, self.high)
        object.__setattr__(self, "degree", whole(self.degree, "degree"))

    @property
    def size(self) -> int:
        """degree + 1."""
        return self.degree + 1

    @property
    def distinct_values(self) -> int:
        """degree + 1 values of p determine a polynomial."""
        return self.degree + 1

    @property
    def degrees(self) -> tuple[int]:
        """(degree,)."""
        return (self.degree,)

    def constant(self) -> Array:
        """(1, 0, ..., 0)."""
        return np.eye(self.size)[0]

    @cached_property
    def _norms(self) -> Array:
        return np.sqrt(2.0 * np.arange(self.size) + 1.0)

    def _values(self, p: Array, derivative: Any) -> Array:
        x = ((p - self.low) - (self.high - p)) / (
            self.high - self.low
        )  # no digit of p is lost far from zero
        if derivative == 0:
            return (legendre.legvander(x, self.degree) * self._norms).reshape(*p.shape, self.size)
        scale = (2.0 / (self.high - self.low)) ** derivative
        rows = legendre.legder(np.diag(self._norms), m=derivative, axis=0) * scale
        if rows.shape[0] == 0:
            return np.zeros((*p.shape, self.size))
        return np.moveaxis(legendre.legval(x, rows), 0, -1)

    @cached_property
    def monomial(self) -> Array:
        """Matrix T (n, n): f_j(p) = sum_i T[j, i] p^i, p in physical units; each entry exact before
        it is rounded.
        """
        middle, radius = centre(self.low, self.high)
        power = {(i,): column for i, column in enumerate(self._powers.T)}
        physical = recentred(power, [(-middle / radius, 1 / radius)])
        return frozen(
            np.stack(
                [
                    physical[i,] if (i,) in physical else np.zeros(self.size)
                    for i in range(self.size)
                ],
                axis=1,
            ),
            "monomial",
        )

    @cached_property
    def _powers(self) -> Array:
        """Matrix T (n, n): f_j = sum_i T[j, i] x^i."""
        return np.stack(
            [
                np.pad(legendre.leg2poly(row), (0, self.size))[: self.size]
                for row in np.diag(self._norms)
            ]
        )

    @cached_property
    def digits_lost(self) -> float:
        """Decimal digits that rounding costs where a polynomial is written in powers of p in
        physical units and summed.

        Few near zero, 16 (all of a double's) for degree 3 on [1e5, 1e5 + 1]; this basis itself
        loses none.
        """
        reach = max(abs(self.low), abs(self.high))
        size = np.abs(self.monomial) @ reach ** np.arange(self.size) / self._norms
        return log10(float(size.max()))

    def _physical(self) -> Array:
        """`monomial`, with a warning where it loses too much."""
        if self.digits_lost > MAX_LOST_DIGITS:
            warnings.warn(
                f"powers of p lose about {self.digits_lost:.0f} of 16 digits on [{self.low:g},"
                f" {self.high:g}]; keep the coefficients of the basis, or write the model in powers"
                " of p less the middle of its range",
                PrecisionWarning,
                stacklevel=3,
            )
        return self.monomial

    def form(self, name: str) -> Array:
        """Matrix T (n, n): f_j = sum_i T[j, i] g_i for the forms in `GRADED` and "bernstein" (over
        [low, high]).
        """
        match name:
            case "orthonormal":
                return np.eye(self.size)
            case "legendre":
                return np.diag(self._norms)
            case "chebyshev" | "scaled":
                rows = (
                    [chebyshev.poly2cheb(r) for r in self._powers]
                    if name == "chebyshev"
                    else self._powers
                )
                return np.stack([np.pad(r, (0, self.size - len(r))) for r in rows])
            case "monomial":
                return self._physical()
            case "bernstein":
                return self.pieces()[0].bernstein
        raise UnknownNameError("form", name, (*self.GRADED, "bernstein"))

    def from_monomial(self, coefficients: object) -> Array:
        """Coefficients in this basis (n, ...) of sum_i p^i M_i with M = `coefficients` (at most n,
        ...), p in physical units.

        Exact but for the last rounding: the powers are moved to the middle of the range as the
        rationals they are.
        """
        given = frozen(coefficients, "monomial coefficients")
        if given.shape[0] > self.size:
            raise InputError(
                f"degree {given.shape[0] - 1} does not fit in a basis of degree {self.degree}"
            )
        x = recentred({(i,): M for i, M in enumerate(given)}, [centre(self.low, self.high)])
        padded = np.zeros((self.size, *given.shape[1:]))
        for (i,), M in x.items():
            padded[i] = M
        return self.from_scaled(padded)

    def from_scaled(self, coefficients: Array) -> Array:
        """Return the coefficients in this basis (n, ...) of sum_i x^i M_i, x from -1 at `low` to 1
        at `high`.
        """
        flat = np.reshape(coefficients, (self.size, -1))
        return np.linalg.solve(self._powers.T, flat).reshape(np.shape(coefficients))

    def to_monomial(self, coefficients: object) -> Array:
        """Monomial coefficients M_i (n, ...) in physical units of p from coefficients in this basis
        (n, ...).

        Warns (`PrecisionWarning`) where powers of p lose more than half of the digits; see
        `digits_lost`.
        """
        return np.tensordot(self._physical().T, frozen(coefficients, "coefficients"), axes=1)

    def pieces(self) -> tuple[Piece, ...]:
        """One piece: the Bernstein coefficients of each function over [low, high]."""
        d = self.degree
        shift = np.zeros((d + 1, d + 1))  # x = 2 s - 1
        for i in range(d + 1):
            for k in range(i + 1):
                shift[i, k] = comb(i, k) * 2.0**k * (-1.0) ** (i - k)
        power_to_bernstein = np.array(
            [
                [comb(i, k) / comb(d, k) if k <= i else 0.0 for i in range(d + 1)]
                for k in range(d + 1)
            ]
        )
        return (Piece(self.low, self.high, self._powers @ shift @ power_to_bernstein),)
