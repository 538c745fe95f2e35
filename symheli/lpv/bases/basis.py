"""Interface of every basis over the range of one scheduling parameter."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.function_space import FunctionSpace, Piece, Range
from symheli.values.arrays import Array


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

    def samples(self, ranges: Sequence[Range] | None = None) -> Array:
        """Sample points of p: one more than coefficients on every piece; for user-supplied
        functions four times their number, since no finite number of points determines them.
        """
        ((low, high),) = self.ranges if ranges is None else ranges
        try:
            pieces = self.pieces()
        except InputError:
            return np.linspace(low, high, 4 * self.size + 1)
        edges = [
            (max(piece.low, low), min(piece.high, high), piece.bernstein.shape[1] + 1)
            for piece in pieces
        ]
        return np.concatenate([np.linspace(a, b, count) for a, b, count in edges if a < b])

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """The polynomial pieces of the functions, in order of p; `InputError` where they are not
        piecewise polynomial.
        """


def check_range(low: float, high: float) -> None:
    """Raises `InputError` unless low < high, both finite."""
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"a basis needs finite low < high, got [{low}, {high}]")
