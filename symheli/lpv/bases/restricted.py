"""A basis of several parameters on a straight line through its box."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.function_space import FunctionSpace, Piece
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.polynomials import factors_of, interpolation_points
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Restricted(Basis):
    """The functions of `basis` at start + (s + 1)/2 (end - start), of one parameter s in [-1, 1].

    Polynomial where those are, between the crossings of their breakpoints.
    """

    basis: FunctionSpace
    start: tuple[float, ...]
    end: tuple[float, ...]

    low = -1.0
    high = 1.0

    @property
    def size(self) -> int:
        """Size of the basis."""
        return self.basis.size

    @property
    def distinct_values(self) -> int:
        """The number of functions."""
        return self.size

    def constant(self) -> Array:
        """Coefficients of the basis, which is 1 on every line."""
        return self.basis.constant()

    def points(self, s: Array) -> Array:
        """Where on the line s is: (...) or (..., d) as the basis takes them."""
        first, last = np.array(self.start), np.array(self.end)
        p = 0.5 * (first + last) + 0.5 * np.multiply.outer(s, last - first)
        p = np.clip(p, np.minimum(first, last), np.maximum(first, last))
        return p[..., 0] if self.basis.dimension == 1 else p

    def _values(self, p: Array, derivative: Any) -> Array:
        if derivative == 0:
            return self.basis(self.points(p))
        if derivative != 1:
            raise InputError("functions on a line are differentiated once")
        along = 0.5 * (np.array(self.end) - np.array(self.start))
        return np.einsum("d,...dn->...n", along, self.basis.gradient(self.points(p)))

    def pieces(self) -> tuple[Piece, ...]:
        """One piece between every two breakpoints that the line crosses."""
        return self._pieces

    @cached_property
    def _pieces(self) -> tuple[Piece, ...]:
        cuts, degree = {-1.0, 1.0}, 0
        for a, b, factor in zip(self.start, self.end, factors_of(self.basis), strict=True):
            if a == b:
                continue
            found = factor.pieces()
            degree += max(piece.bernstein.shape[1] - 1 for piece in found)
            crossings = [2 * (piece.low - a) / (b - a) - 1 for piece in found[1:]]
            cuts |= {s for s in crossings if -1 < s < 1}
        out = []
        for low, high in pairwise(sorted(cuts)):
            inner = Polynomial(degree, low, high)
            nodes = interpolation_points((degree,), ((low, high),))
            values = inner.fit(nodes, self(nodes))
            out.append(Piece(low, high, values.T @ inner.form("bernstein")))
        return tuple(out)
