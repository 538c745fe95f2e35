"""Common part of the piecewise polynomial bases."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np
from scipy.interpolate import PPoly

from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.function_space import Piece
from symheli.values.arrays import Array, frozen


class PiecewisePolynomial(Basis):
    """A basis whose functions are polynomials between breakpoints."""

    @abstractmethod
    def _piecewise(self) -> PPoly:
        """All functions side by side."""

    def constant(self) -> Array:
        """Ones: the functions of such a basis add up to 1."""
        return np.ones(self.size)

    @cached_property
    def _functions(self) -> PPoly:
        return self._piecewise()

    def _values(self, p: Array, derivative: Any) -> Array:
        f = self._functions
        # beyond the ends, where rounding may take p, the end pieces go on
        return np.asarray(f(p, nu=min(derivative, len(f.c))))

    def pieces(self) -> tuple[Piece, ...]:
        """One piece between every two breakpoints."""
        return self._pieces

    @cached_property
    def _pieces(self) -> tuple[Piece, ...]:
        power = self._functions.c[
            ::-1
        ]  # (degree + 1, segments, functions), ascending powers of p - breakpoint
        d = power.shape[0] - 1
        out = []
        for s, (low, high) in enumerate(pairwise(self._functions.x.tolist())):
            scaled = power[:, s, :] * ((high - low) ** np.arange(d + 1))[:, None]
            bernstein = np.array(
                [
                    sum(comb(k, i) / comb(d, i) * scaled[i] for i in range(k + 1))
                    for k in range(d + 1)
                ]
            )
            out.append(Piece(low, high, frozen(bernstein.T, "pieces")))
        return tuple(out)
