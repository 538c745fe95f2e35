"""Matrices that depend on the scheduling parameters, with exact sums and products."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.lpv.bases.function_space import FunctionSpace, Range
from symheli.lpv.bases.polynomials import polynomials
from symheli.lpv.bases.product import Product
from symheli.lpv.bases.spaces import coefficients_in, product_space, sum_space
from symheli.values.arrays import Array

if TYPE_CHECKING:
    from symheli.lpv.lpv_state_space import LPVStateSpace

ROUNDING = 64 * np.finfo(float).eps
"""An entry that changes over the range by less than this fraction of its own size is constant: its
units play no part.
"""

Box = tuple[Range, ...]


@dataclass(frozen=True, eq=False)
class MatrixFunction:
    """M(p) = sum_j f_j(p) M_j with the functions of `basis` and `coefficients` (n, rows, columns),
    for p in `box`; without a basis the constant matrix of `coefficients` (1, rows, columns).

    `+` and `@` are exact: a constant factor keeps the basis, polynomials give polynomials,
    piecewise polynomials `Patches`. What has no such basis raises `InputError`.
    """

    basis: FunctionSpace | None
    coefficients: Array
    box: Box

    __array_ufunc__ = None  # a NumPy array on the left leaves the operation to this class

    @classmethod
    def constant(cls, matrix: Array, box: Box) -> MatrixFunction:
        """The same `matrix` (rows, columns) at every p."""
        return cls(None, matrix[None], box)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.coefficients.shape[1], self.coefficients.shape[2]

    @cached_property
    def varies(self) -> Array:
        """Mask of the entries (rows, columns) that depend on p, each relative to its own size."""
        if self.basis is None:
            return np.zeros(self.shape, dtype=bool)
        values = np.tensordot(_samples(self.basis, self.box), self.coefficients, axes=1)
        return np.ptp(values, axis=0) > ROUNDING * np.abs(values).max(axis=0, initial=0.0)

    @cached_property
    def value(self) -> Array:
        """The matrix (rows, columns) at one p: everywhere, of entries that do not vary."""
        if self.basis is None:
            return self.coefficients[0]
        return np.tensordot(_samples(self.basis, self.box)[0], self.coefficients, axes=1)

    @property
    def is_constant(self) -> bool:
        """Whether no entry depends on p."""
        return not np.any(self.varies)

    def __call__(self, p: Array) -> Array:
        """Values (K, rows, columns) at p (K,), or (K, d)."""
        if self.basis is None:
            return np.repeat(self.coefficients, len(p), axis=0)
        return np.tensordot(self.basis(p), self.coefficients, axes=1)

    def __getitem__(self, at: tuple[Any, Any]) -> MatrixFunction:
        """These rows and columns, each a list, a mask or a slice."""
        rows, columns = at
        return MatrixFunction(self.basis, self.coefficients[:, rows][:, :, columns], self.box)

    def __add__(self, other: MatrixFunction | Array) -> MatrixFunction:
        """The sum; an array is a constant."""
        other = self._like(other)
        space = _common([self, other])
        return MatrixFunction(space, self.written_in(space) + other.written_in(space), self.box)

    __radd__ = __add__

    def __matmul__(self, other: MatrixFunction | Array) -> MatrixFunction:
        """The product. Where of a column of the left and the row of the right that it meets only
        one varies, neither space nor degree grows.
        """
        other = self._like(other)
        left, right = self.varies.any(axis=0), other.varies.any(axis=1)
        every = slice(None)
        kept = MatrixFunction(
            other.basis, self.value[:, ~left] @ other.coefficients[:, ~left], self.box
        )
        once, both = left & ~right, left & right
        parts = [
            kept,
            MatrixFunction(self.basis, self.coefficients[:, :, once] @ other.value[once], self.box),
        ]
        if np.any(both):
            parts.append(_multiplied(self[every, both], other[both, every]))
        return reduce(MatrixFunction.__add__, [part.simplest for part in parts])

    def __rmatmul__(self, other: Array) -> MatrixFunction:
        """A constant times this."""
        return self._like(other) @ self

    def written_in(self, space: FunctionSpace | None) -> Array:
        """Coefficients (n, rows, columns) in a `space` that holds every entry."""
        if self.basis == space:
            return self.coefficients
        assert space is not None  # noqa: S101  (only constants are written without functions)
        if self.basis is None:
            return np.multiply.outer(space.constant(), self.coefficients[0])
        return coefficients_in(space, self)

    @property
    def simplest(self) -> MatrixFunction:
        """The same, without a basis where it is constant."""
        return MatrixFunction.constant(self.value, self.box) if self.is_constant else self

    def _like(self, other: MatrixFunction | Array) -> MatrixFunction:
        return other if isinstance(other, MatrixFunction) else self.constant(other, self.box)


def functions_of(lpv: LPVStateSpace) -> list[MatrixFunction]:
    """A, B, C, D of a model."""
    every = (lpv.A, lpv.B, lpv.C, lpv.D)
    return [MatrixFunction(lpv.basis, M, lpv.box).simplest for M in every]


def block(rows: Sequence[Sequence[MatrixFunction]]) -> MatrixFunction:
    """One matrix of blocks, as `numpy.block`."""
    every = [M for row in rows for M in row]
    space = _common(every)
    return MatrixFunction(
        space, np.block([[M.written_in(space) for M in row] for row in rows]), every[0].box
    )


def in_one_basis(
    matrices: Sequence[MatrixFunction], ranges: Box
) -> tuple[FunctionSpace, list[Array]]:
    """A basis for all `matrices` and their coefficients in it; the constants over `ranges` where
    nothing varies.
    """
    space = _common(matrices) or polynomials([0] * len(ranges), ranges)
    return space, [M.written_in(space) for M in matrices]


@lru_cache(maxsize=8)
def _samples(basis: FunctionSpace, box: Box) -> Array:
    """Return values (K, n) of the functions at points where those that differ in the box are
    distinguished.
    """
    return basis(basis.samples(box))


def _common(matrices: Sequence[MatrixFunction]) -> FunctionSpace | None:
    spaces = [M.basis for M in matrices if M.basis is not None]
    return reduce(sum_space, spaces) if spaces else None


def _multiplied(left: MatrixFunction, right: MatrixFunction) -> MatrixFunction:
    """The product by its values, in no higher degree than it has."""
    assert left.basis is not None  # noqa: S101
    assert right.basis is not None  # noqa: S101
    space = product_space(left.basis, right.basis)
    coefficients = coefficients_in(space, lambda p: left(p) @ right(p))
    if space.degrees is None:
        return MatrixFunction(space, coefficients, left.box)
    found = np.any(np.abs(coefficients) > ROUNDING * np.abs(coefficients).max(axis=0), axis=(1, 2))
    exponents = (
        np.array(space.indices) if isinstance(space, Product) else np.arange(space.size)[:, None]
    )
    degrees = [int(d) for d in exponents[found].max(axis=0, initial=0)]
    lower = np.all(exponents <= degrees, axis=1)
    return MatrixFunction(polynomials(degrees, space.ranges), coefficients[lower], left.box)
