"""Interface of every family of functions of the scheduling, of one parameter or several."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.summary import summarized

Range = tuple[float, float]
Order = int | tuple[int, ...]
"""How often a function is differentiated: a number, or one for each of several parameters."""


class Piece(NamedTuple):
    """One polynomial piece of a basis: on [low, high], f_j(p) = sum_i bernstein[j, i] B_i(x), x =
    (p-low)/(high-low).
    """

    low: float
    high: float
    bernstein: Array

    __repr__ = summarized


class FunctionSpace(ABC):
    """Functions f_1 .. f_n of the scheduling parameters p on a box; a coefficient is M(p) = sum_j
    f_j(p) M_j.

    With one parameter p may have any shape and values have shape p.shape + (n,); with d > 1
    parameters the last axis of p holds them, p (..., d), and values have shape (..., n).
    """

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of functions n."""

    @property
    @abstractmethod
    def ranges(self) -> tuple[Range, ...]:
        """(low, high) of each parameter, in its unit."""

    @property
    @abstractmethod
    def distinct_values(self) -> int:
        """Number of distinct p needed to distinguish the functions."""

    @abstractmethod
    def _values(self, p: Array, derivative: Any) -> Array: ...

    @property
    def dimension(self) -> int:
        """Number of scheduling parameters d."""
        return len(self.ranges)

    @property
    def degrees(self) -> tuple[int, ...] | None:
        """Highest degree in each parameter where all functions are polynomials, else None."""
        return None

    def constant(self) -> Array:
        """Coefficients (n,) of the function 1; raises `InputError` where the space lacks it."""
        p = self.samples()
        one = self.fit(p, np.ones(len(p)))
        if np.abs(self(p) @ one - 1).max() > 1e-9:
            raise InputError(f"{self} does not contain the constants; add the function 1")
        return one

    @abstractmethod
    def samples(self, ranges: Sequence[Range] | None = None) -> Array:
        """Return points (K,) or (K, d) of the box, or of smaller `ranges`, at which different
        combinations of the functions differ.
        """

    def pieces(self) -> tuple[Piece, ...]:
        """The polynomial pieces of the functions of one parameter, in order of p; `InputError`
        where they are not piecewise polynomial, or of several parameters.
        """
        raise InputError(f"{type(self).__name__} has no pieces over one parameter")

    def gradient(self, p: object) -> Array:
        """Slopes of the functions by each parameter, (..., d, n), per unit of it."""
        if self.dimension == 1:
            return self(p, 1)[..., None, :]
        along = np.eye(self.dimension, dtype=int).tolist()
        return np.stack([self(p, tuple(order)) for order in along], axis=-2)

    def form(self, name: str) -> Array:
        """Matrix T (n, m) with f_j = sum_i T[j, i] g_i for the functions g of the named form;
        `InputError` where there is none.

        Coefficients M_j of f become sum_j T[j, i] M_j of g.
        """
        raise InputError(
            f"{type(self).__name__} has no {name!r} form; its coefficients are those of its own"
            " functions"
        )

    def __call__(self, p: object, derivative: Order = 0) -> Array:
        """Values of the functions, or derivatives per unit of p, at p.

        Raises `InputError` outside the ranges and for a wrong number of parameters.
        """
        orders = (
            tuple(whole(order, "derivative") for order in derivative)
            if isinstance(derivative, tuple)
            else whole(derivative, "derivative")
        )
        return self._values(self._inside(p), orders)

    def fit(self, p: object, values: object) -> Array:
        """Least-squares coefficients (n, ...) of `values` (K, ...) sampled at `p` (K,), or (K, d)
        with several parameters.
        """
        p = frozen(p, "nodes", (None,) if self.dimension == 1 else (None, self.dimension))
        values = frozen(values, "values")
        distinct = len(np.unique(p, axis=0))
        if distinct < self.distinct_values:
            raise InputError(
                f"{self} needs {self.distinct_values} distinct nodes, got {distinct}; add nodes or"
                " lower the degree"
            )
        flat = values.reshape(len(p), -1)
        coefficients = np.linalg.lstsq(self(p), flat, rcond=None)[0]
        return coefficients.reshape(self.size, *values.shape[1:])

    def _inside(self, p: object) -> Array:
        p = frozen(p, "scheduling parameter")
        if self.dimension > 1 and p.shape[-1:] != (self.dimension,):
            raise InputError(
                f"scheduling parameters: expected {self.dimension} along the last axis, got shape"
                f" {p.shape}"
            )
        columns = p.reshape(-1, self.dimension).T
        for i, ((low, high), column) in enumerate(zip(self.ranges, columns, strict=True)):
            slack = 1e-9 * (high - low)
            if column.size and (column.min() < low - slack or column.max() > high + slack):
                which = (
                    "the scheduling parameter"
                    if self.dimension == 1
                    else f"scheduling parameter {i + 1} of {self.dimension}"
                )
                raise InputError(
                    f"{which} spans [{column.min():.4g}, {column.max():.4g}] but the basis is"
                    f" declared on [{low:.4g}, {high:.4g}]; declare the basis over the whole range"
                    " of the data"
                )
        return p


def tensor_grid(axes: Sequence[Array]) -> Array:
    """Every combination (K, d) of the values along d `axes`, the last running fastest."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
