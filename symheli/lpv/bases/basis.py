"""What every basis over the range of one scheduling parameter can answer."""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.function_space import FunctionSpace, Range
from symheli.values.arrays import Array


class Piece(NamedTuple):
    """One polynomial piece of a basis: on [low, high], f_j(p) = sum_i bernstein[j, i] B_i(x), x =
    (p-low)/(high-low).
    """

    low: float
    high: float
    bernstein: Array


class Basis(FunctionSpace):
    """A family of functions f_1 .. f_n of one scheduling parameter p in [low, high]; M(p) = sum_j
    f_j(p) M_j.
    """

    low: float
    high: float

    @property
    def ranges(self) -> tuple[Range, ...]:
        """((low, high),)."""
        return ((self.low, self.high),)

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """The polynomial pieces of the functions, in order of p; `InputError` where they are not
        piecewise polynomial.
        """

    def __call__(self, p: object, derivative: int = 0) -> Array:
        """Values (or derivatives, per unit of p) of the functions at p, shape p.shape + (n,).
        Raises `InputError` outside the range.
        """
        return self._values(self._inside(p), derivative)


def check_range(low: float, high: float) -> None:
    """Raises `InputError` unless low < high, both finite."""
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"a basis needs finite low < high, got [{low}, {high}]")
