"""Matrices whose entries are polynomials in the parameters of a box, in tensor-product Bernstein
form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import comb, prod
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.numerics.polynomial.bernstein import blossom, elevation_matrix, restriction
from synthesis.numerics.polynomial.exact import matmul, quotient, whole

Box = tuple[tuple[Any, Any], ...]


@dataclass(frozen=True, eq=False)
class PolynomialMatrix:
    """A polynomial matrix F(p) for p in `box`, by its coefficients in tensor-product Bernstein
    form.

    On the whole box F(p) lies in the convex hull of its coefficients; those at the corners are its
    values there. Operands must share the box.

    Parameters
    ----------
    box : sequence of (low, high)
        One a parameter, in its units.
    coefficients : ndarray (d_1 + 1, ..., d_m + 1, ..., rows, columns)
        Of degree d_i in parameter i; axes between the m first and the two last are a stack of
        matrices, which broadcast. Floats, or exact rationals in object arrays (the box in the same
        arithmetic).

    Raises
    ------
    InputError
        For fewer than m + 2 axes, or a box without width.

    References
    ----------
    Farouki, "The Bernstein polynomial basis: a centennial retrospective", Computer Aided Geometric
    Design 29 (2012).

    Examples
    --------
    >>> F = PolynomialMatrix.from_monomials({(0,): [[1.0]], (2,): [[1.0]]}, [(0.0, 2.0)])
    >>> (F @ F)([1.0]).item()  # (1 + p^2)^2 at p = 1
    4.0
    >>> print(*F.restrict(((0.0, 1.0),)).extremes())  # bounds of every entry
    1.0 2.0
    """

    box: Box
    coefficients: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "box", tuple((low, high) for low, high in self.box))
        if (
            self.coefficients.ndim < len(self.box) + 2
            or 0 in self.coefficients.shape[: len(self.box)]
        ):
            raise InputError(
                f"expected {len(self.box)} axes of coefficients and a matrix, got shape"
                f" {self.coefficients.shape}"
            )
        if not all(low < high for low, high in self.box):
            raise InputError(f"expected low < high for every parameter, got {self.box}")

    @classmethod
    def constant(cls, M: Any, box: Box) -> PolynomialMatrix:
        """Return the constant matrix M (..., rows, columns)."""
        M = np.asarray(M)
        return cls(box, M.reshape((1,) * len(box) + M.shape))

    @classmethod
    def from_monomials(cls, terms: Mapping[tuple[int, ...], Any], box: Box) -> PolynomialMatrix:
        """Return the sum of p_1^e1 p_2^e2 ... M over {(e1, e2, ...): M}, p in the units of
        the box.
        """
        if not terms:
            raise InputError("expected at least one term {exponents: matrix}")
        m = len(box)
        for e in terms:
            if len(e) != m or not all(isinstance(i, int | np.integer) and i >= 0 for i in e):
                raise InputError(f"expected {m} exponents >= 0 a term, got {e}")
        degrees = [max(int(e[i]) for e in terms) for i in range(m)]
        power = [_power_to_bernstein(d, *bounds) for d, bounds in zip(degrees, box, strict=True)]
        out: Any = 0
        for exponents, M in terms.items():
            weights = reduce(
                np.multiply.outer, [power[i][:, e] for i, e in enumerate(exponents)], np.ones(())
            )
            out = out + np.multiply.outer(weights, np.asarray(M, dtype=float))
        return cls(box, out)

    @property
    def degrees(self) -> tuple[int, ...]:
        """Degree in each parameter."""
        return tuple(n - 1 for n in self.coefficients.shape[: len(self.box)])

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.coefficients.shape[-2], self.coefficients.shape[-1]

    @property
    def T(self) -> PolynomialMatrix:
        """F(p)'."""
        return replace(self, coefficients=np.swapaxes(self.coefficients, -1, -2))

    def __call__(self, p: object) -> Array:
        """F at p (..., m), shape (..., rows, columns); floats."""
        p = np.asarray(p, dtype=float)
        if p.shape[-1:] != (len(self.box),):
            raise InputError(
                f"expected {len(self.box)} parameter(s) along the last axis, got shape {p.shape}"
            )
        points = p.reshape(-1, len(self.box))
        value = np.broadcast_to(self.coefficients, (len(points), *self.coefficients.shape))
        for i, (d, (low, high)) in enumerate(zip(self.degrees, self.box, strict=True)):
            weights = np.stack(
                [
                    w * np.ones(len(points))
                    for w in blossom([(points[:, i] - low) / (high - low)] * d)
                ]
            )
            value = np.einsum("jk,kj...->k...", weights, value)
        return value.reshape(*p.shape[:-1], *value.shape[1:])

    def __add__(self, other: PolynomialMatrix) -> PolynomialMatrix:
        """Sum; the lower degrees are raised."""
        degrees = self._common(other)
        F, G = _stacked(
            self.elevate(degrees).coefficients, other.elevate(degrees).coefficients, len(self.box)
        )
        return replace(self, coefficients=F + G)

    def __neg__(self) -> PolynomialMatrix:
        """-F."""
        return replace(self, coefficients=-self.coefficients)

    def __sub__(self, other: PolynomialMatrix) -> PolynomialMatrix:
        """Difference."""
        return self + (-other)

    def __mul__(self, factor: Any) -> PolynomialMatrix:
        """Times a number."""
        return replace(self, coefficients=self.coefficients * factor)

    __rmul__ = __mul__

    def __matmul__(self, other: PolynomialMatrix) -> PolynomialMatrix:
        """The product F(p) G(p); degrees add."""
        self._common(other)
        m = len(self.box)
        (F, first), (G, second) = self._weighted(), other._weighted()
        F, G = _stacked(F, G, m)
        shape = tuple(a + b - 1 for a, b in zip(F.shape[:m], G.shape[:m], strict=True))
        out: Any = None
        few, many, left = (F, G, True) if prod(F.shape[:m]) <= prod(G.shape[:m]) else (G, F, False)
        for index in np.ndindex(*few.shape[:m]):
            part = few[index] @ many if left else many @ few[index]
            if out is None:
                out = np.zeros((*shape, *part.shape[m:]), dtype=part.dtype)
            out[tuple(slice(i, i + n) for i, n in zip(index, many.shape[:m], strict=True))] += part
        return _unweighted(self.box, out, first * second)

    def congruence(self, T: PolynomialMatrix) -> PolynomialMatrix:
        """T(p)' F(p) T(p)."""
        return T.T @ self @ T

    def derivative(self, axis: int) -> PolynomialMatrix:
        """dF/dp_axis, per unit of the parameter."""
        d, (low, high) = self.degrees[axis], self.box[axis]
        if d == 0:
            return self * 0
        return replace(self, coefficients=d * np.diff(self.coefficients, axis=axis) / (high - low))

    def elevate(self, degrees: Sequence[int]) -> PolynomialMatrix:
        """Return the same polynomial with coefficients of these higher degrees."""
        extra = tuple(b - a for a, b in zip(self.degrees, degrees, strict=True))
        if not any(extra):
            return self
        (F, common), m = self._weighted(), len(self.box)
        out = np.zeros((*(d + 1 for d in degrees), *F.shape[m:]), dtype=F.dtype)
        for index in np.ndindex(*(e + 1 for e in extra)):
            factor = prod(comb(e, i) for e, i in zip(extra, index, strict=True))
            out[tuple(slice(i, i + n) for i, n in zip(index, F.shape[:m], strict=True))] += (
                factor * F
            )
        return _unweighted(self.box, out, common)

    def restrict(self, box: Box) -> PolynomialMatrix:
        """Return the same polynomial over another box."""
        c = self.coefficients
        for i, ((low, high), (a, b)) in enumerate(zip(self.box, box, strict=True)):
            if (low, high) != (a, b):
                c = _along(
                    restriction(
                        self.degrees[i], (a - low) / (high - low), (b - low) / (high - low)
                    ),
                    c,
                    i,
                )
        return replace(self, box=box, coefficients=c)

    def split(self, axis: int) -> tuple[PolynomialMatrix, PolynomialMatrix]:
        """Return the two halves of the box along a parameter."""
        low, high = self.box[axis]
        middle = (low + high) / 2
        return tuple(
            self.restrict((*self.box[:axis], part, *self.box[axis + 1 :]))
            for part in ((low, middle), (middle, high))
        )  # type: ignore[return-value]

    def extremes(self) -> tuple[Any, Any]:
        """Return (lowest, highest) coefficient: bounds of every entry on the whole box."""
        return self.coefficients.min(), self.coefficients.max()

    def extend(self, box: Box) -> PolynomialMatrix:
        """Return the same matrix with further parameters, those of `box`, on which it does not
        depend.
        """
        m = len(self.box)
        shape = (*self.coefficients.shape[:m], *(1,) * len(box), *self.coefficients.shape[m:])
        return PolynomialMatrix((*self.box, *box), self.coefficients.reshape(shape))

    def _common(self, other: PolynomialMatrix) -> tuple[int, ...]:
        if self.box != other.box:
            raise InputError(f"the boxes differ: {self.box} and {other.box}")
        return tuple(map(max, self.degrees, other.degrees))

    def _weighted(self) -> tuple[Array, int]:
        """Return the coefficients times their binomials, of rationals as integers over one
        denominator.
        """
        exact = self.coefficients.dtype == object
        c, common = whole(self.coefficients) if exact else (self.coefficients, 1)
        return c * _binomials(c, len(self.box)), common


def block(rows: Sequence[Sequence[PolynomialMatrix]]) -> PolynomialMatrix:
    """Return the matrix of these blocks; degrees are raised and stacks broadcast to the largest."""
    every = [F for row in rows for F in row]
    box, m = every[0].box, len(every[0].box)
    degrees = reduce(lambda a, b: tuple(map(max, a, b)), (F.degrees for F in every))
    stack = np.broadcast_shapes(*(F.coefficients.shape[m:-2] for F in every))

    def full(F: PolynomialMatrix) -> Array:
        c = _padded(F.elevate(degrees).coefficients, m, m + len(stack) + 2)
        return np.broadcast_to(c, (*c.shape[:m], *stack, *c.shape[-2:]))

    return PolynomialMatrix(
        box,
        np.concatenate([np.concatenate([full(F) for F in row], axis=-1) for row in rows], axis=-2),
    )


def _padded(c: Array, m: int, ndim: int) -> Array:
    return c.reshape(*c.shape[:m], *(1,) * (ndim - c.ndim), *c.shape[m:])


def _stacked(F: Array, G: Array, m: int) -> tuple[Array, Array]:
    """Return both with the same number of stack axes, so that these broadcast and not the axes of
    the coefficients.
    """
    ndim = max(F.ndim, G.ndim)
    return _padded(F, m, ndim), _padded(G, m, ndim)


def _along(T: Array, coefficients: Array, axis: int) -> Array:
    """Apply the matrix T to one axis, in any arithmetic."""
    c = np.moveaxis(coefficients, axis, 0)
    return np.moveaxis(matmul(T, c.reshape(len(c), -1)).reshape(len(T), *c.shape[1:]), 0, axis)


def _binomials(c: Array, m: int) -> Array:
    weights = reduce(
        np.multiply.outer,
        [np.array([comb(n - 1, i) for i in range(n)], dtype=object) for n in c.shape[:m]],
        np.array(1),
    )
    return np.asarray(weights if c.dtype == object else weights.astype(float)).reshape(
        *c.shape[:m], *(1,) * (c.ndim - m)
    )


def _unweighted(box: Box, c: Array, common: int) -> PolynomialMatrix:
    weights = _binomials(c, len(box))
    exact = c.dtype == object
    return PolynomialMatrix(
        box, np.asarray(quotient(c, weights * common), dtype=object) if exact else c / weights
    )


def _power_to_bernstein(degree: int, low: float, high: float) -> Array:
    """Return the matrix (d + 1, d + 1) with the Bernstein coefficients over [low, high] of p^e in
    column e (the blossom of p^e).
    """
    out = np.zeros((degree + 1, degree + 1))
    for e in range(degree + 1):
        # p^e = (low + width t)^e; the blossom at e arguments, (degree of) which k are `high`
        own = np.array([low ** (e - k) * high**k for k in range(e + 1)])
        out[:, e] = elevation_matrix(e, degree) @ own
    return out
