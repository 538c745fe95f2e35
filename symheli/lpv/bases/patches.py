"""Piecewise polynomials without continuity at their breaks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PPoly

from symheli.errors import InputError
from symheli.lpv.bases.piecewise import PiecewisePolynomial
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Patches(PiecewisePolynomial):
    """Discontinuous piecewise polynomials: powers up to `degree` on each interval between the
    `breaks`, zero elsewhere, so that a model may jump at a break.
    """

    degree: int
    breaks: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.degree < 0:
            raise InputError(f"degree: expected 0 or more, got {self.degree}")
        if len(self.breaks) < 2 or any(b <= a for a, b in pairwise(self.breaks)):
            raise InputError(f"breaks: expected at least two increasing values, got {self.breaks}")
        object.__setattr__(self, "breaks", tuple(float(b) for b in self.breaks))

    @property
    def low(self) -> float:  # type: ignore[override]
        """First break."""
        return self.breaks[0]

    @property
    def high(self) -> float:  # type: ignore[override]
        """Last break."""
        return self.breaks[-1]

    @property
    def size(self) -> int:
        """degree + 1 functions an interval."""
        return (self.degree + 1) * (len(self.breaks) - 1)

    @property
    def distinct_values(self) -> int:
        """degree + 1 in every interval."""
        return self.size

    def constant(self) -> Array:
        """The power 0 of every interval."""
        return np.tile(np.eye(self.degree + 1)[-1], len(self.breaks) - 1)

    def points(self, count: int) -> Array:
        """`count` Chebyshev points inside every interval, in order."""
        unit = 0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / count)
        return np.concatenate([a + (b - a) * unit for a, b in pairwise(self.breaks)])

    def _piecewise(self) -> PPoly:
        n, widths = self.degree + 1, np.diff(self.breaks)
        c = np.zeros((n, len(widths), self.size))
        for s, width in enumerate(widths):
            c[:, s, s * n : (s + 1) * n] = np.diag(width ** -np.arange(n - 1.0, -1.0, -1.0))
        return PPoly(c, np.array(self.breaks))
