"""Matrices that are affine in the unknowns of a program and polynomial in p, written as in cvxpy:
sums, products with known matrices, transposes, derivatives by p, blocks, `F >> 0`.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.matrix import block as known_block

PRODUCT = (
    "the product of two unknown matrices is not affine: give one of them a value, or replace the"
    " product by an unknown of its own"
)


@dataclass(frozen=True, eq=False)
class AffineMatrix(PolynomialMatrix):
    """A matrix that is affine in the unknowns of a program, and polynomial in p on a box.

    The coefficients are a stack of matrices: the known part, then the factor of each unknown.
    """

    __array_ufunc__ = None  # an array on the left leaves the operation to this class

    @property
    def unknowns(self) -> int:
        """Number of unknowns that it knows of: up to the last one in it."""
        return self.coefficients.shape[len(self.box)] - 1

    def at(self, x: Array) -> PolynomialMatrix:
        """Return the matrix where the unknowns of the program have the values x."""
        stack = np.moveaxis(self.coefficients, len(self.box), 0)
        found = stack[0] + np.tensordot(x[: self.unknowns], stack[1:], axes=1)
        return PolynomialMatrix(self.box, found)

    def __add__(self, other: Any) -> AffineMatrix:
        """Sum with an affine or a known matrix."""
        a, b = self._alike(other)
        return _affine(PolynomialMatrix.__add__(a, b))

    def __radd__(self, other: Any) -> AffineMatrix:
        """Sum."""
        return self + other

    def __sub__(self, other: Any) -> AffineMatrix:
        """Difference."""
        return self + (-1.0) * self._operand(other)

    def __rsub__(self, other: Any) -> AffineMatrix:
        """Difference."""
        return -self + other  # type: ignore[operator]

    def __mul__(self, factor: Any) -> AffineMatrix:
        """Times a number."""
        if isinstance(factor, PolynomialMatrix):
            raise InputError(PRODUCT if isinstance(factor, AffineMatrix) else "products: F @ G")
        return _affine(PolynomialMatrix.__mul__(self, factor))

    __rmul__ = __mul__

    def __matmul__(self, other: Any) -> AffineMatrix:
        """Product with a known matrix on the right."""
        if isinstance(other, AffineMatrix):
            raise InputError(PRODUCT)
        return _affine(PolynomialMatrix.__matmul__(self, self._operand(other)))

    def __rmatmul__(self, other: Any) -> AffineMatrix:
        """Product with a known matrix on the left."""
        return _affine(PolynomialMatrix.__matmul__(self._operand(other), self))

    def __rshift__(self, other: Any) -> Inequality:
        """F >> G: F - G shall be positive semidefinite; a number is so many times the identity."""
        return Inequality(self - self._level(other))

    def __lshift__(self, other: Any) -> Inequality:
        """F << G: G - F shall be positive semidefinite."""
        return Inequality(-self + self._level(other))

    def _operand(self, other: Any) -> PolynomialMatrix:
        """A matrix on the same box."""
        if isinstance(other, PolynomialMatrix):
            return other
        return PolynomialMatrix.constant(np.atleast_2d(np.asarray(other, dtype=float)), self.box)

    def _level(self, other: Any) -> Any:
        number = isinstance(other, int | float | np.number)
        return float(other) * np.eye(self.shape[0]) if number else other

    def _alike(self, other: Any) -> tuple[AffineMatrix, AffineMatrix]:
        """Both with the same number of unknowns."""
        there = lifted(self._operand(other))
        if self.shape != there.shape:
            raise InputError(f"expected matrices of one shape, got {self.shape} and {there.shape}")
        count = max(self.unknowns, there.unknowns)
        return self._padded(count), there._padded(count)

    def _padded(self, count: int) -> AffineMatrix:
        """Return the same with further unknowns, up to `count`, which do not occur."""
        m, c = len(self.box), self.coefficients
        width = [(0, 0)] * c.ndim
        width[m] = (0, count - self.unknowns)
        return AffineMatrix(self.box, np.pad(c, width))


@dataclass(frozen=True, eq=False)
class Inequality:
    """`positive` shall be positive semidefinite at every p of its box."""

    positive: AffineMatrix


def block(rows: Sequence[Sequence[PolynomialMatrix]]) -> PolynomialMatrix:
    """Return the matrix of these blocks, affine in the unknowns where one of them is.

    Parameters
    ----------
    rows : sequence of sequences of PolynomialMatrix
        On one box; degrees are raised to the largest.

    Returns
    -------
    PolynomialMatrix or AffineMatrix
        The block matrix.

    Examples
    --------
    >>> F = PolynomialMatrix.constant([[1.0]], ((0.0, 1.0),))
    >>> block([[F, F], [F, F]]).shape
    (2, 2)
    """
    if not any(isinstance(F, AffineMatrix) for row in rows for F in row):
        return known_block(rows)
    every = [[lifted(F) for F in row] for row in rows]
    count = max(F.unknowns for row in every for F in row)
    return _affine(known_block([[F._padded(count) for F in row] for row in every]))


def lifted(F: PolynomialMatrix) -> AffineMatrix:
    """Return a known matrix as one in which no unknown occurs; an affine one as it is."""
    if isinstance(F, AffineMatrix):
        return F
    return AffineMatrix(F.box, np.expand_dims(F.coefficients, len(F.box)))


def _affine(F: PolynomialMatrix) -> AffineMatrix:
    return AffineMatrix(F.box, F.coefficients)


def times_identity(number: AffineMatrix, n: int) -> AffineMatrix:
    """Return an unknown number (1, 1) times the identity (n, n), n > 0."""
    rows = np.eye(n)
    return reduce(operator.add, [rows[:, [i]] @ (number @ rows[[i]]) for i in range(n)])
