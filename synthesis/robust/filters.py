"""Scalings as filters: stable, with stable inverses, fitted to magnitudes over frequency."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import optimize

from symheli import LinearModel
from symheli.lpv import series
from symheli.values.arrays import Array
from synthesis.robust.covers import rational

LIMIT, FITS = 30.0, 400
"""Largest logarithm of a coefficient of a filter, evaluations of a fit."""


class Filter(NamedTuple):
    """d(s) = gain times the product of (s^2 + a s + b)/(s^2 + c s + e), all > 0, s in units of
    `pace`: stable, with a stable inverse.
    """

    gain: float
    quadratics: Array
    pace: float

    @classmethod
    def one(cls, order: int, pace: float) -> Filter:
        """Return the filter 1 with poles and zeros spread over four decades about the pace."""
        at = np.logspace(-2, 2, order // 2 + 2)[1:-1]
        return cls(1.0, np.column_stack([2 * at, at**2, 2 * at, at**2]), pace)

    @property
    def order(self) -> int:
        """Number of states."""
        return 2 * len(self.quadratics)

    def fitted(self, omega: Array, x: Array, count: Array) -> Filter:
        """Return the filter with |d| closest to exp(x) at these frequencies, weighed by `count`."""
        if not len(self.quadratics):
            return self._replace(gain=math.exp(np.average(x, weights=count)))
        level, root = np.average(x, weights=count), np.sqrt(count)
        spread = self.one(2 * len(self.quadratics), self.pace).quadratics
        starts = (
            np.r_[math.log(self.gain), np.log(self.quadratics).ravel()],
            np.r_[level, np.log(spread).ravel()],
        )

        def misfit(own: Array) -> Array:
            return root * (self._of(own).logarithm(omega) - x)

        def slope(own: Array) -> Array:
            return root[:, None] * self._of(own).slopes(omega)

        found = [
            optimize.least_squares(misfit, own, slope, (-LIMIT, LIMIT), max_nfev=FITS)  # type: ignore[arg-type]
            for own in starts
        ]
        return self._of(min(found, key=lambda f: f.cost).x)

    def _of(self, own: Array) -> Filter:
        return self._replace(gain=math.exp(own[0]), quadratics=np.exp(own[1:]).reshape(-1, 4))

    def logarithm(self, omega: Array) -> Array:
        """Return log |d(j omega)|."""
        s = 1j * omega[:, None] / self.pace
        a, b, c, e = self.quadratics.T
        each = np.log(np.abs(s * s + a * s + b)) - np.log(np.abs(s * s + c * s + e))
        return math.log(self.gain) + each.sum(axis=1)

    def slopes(self, omega: Array) -> Array:
        """Return the derivatives (K, 1 + coefficients) of that by the logarithms of the gain and
        the coefficients.
        """
        s = 1j * omega[:, None] / self.pace
        a, b, c, e = self.quadratics.T
        above, below = s * s + a * s + b, s * s + c * s + e
        each = np.real(np.stack([a * s / above, b / above, -c * s / below, -e / below], axis=2))
        return np.column_stack([np.ones(len(omega)), each.reshape(len(omega), -1)])

    def model(self) -> LinearModel:
        """Return the filter as a linear model of one input and output."""
        found = LinearModel.gain([[self.gain]], ["in"], ["out"])
        for a, b, c, e in self.quadratics:
            found = series(found, rational(np.array([1.0, a, b]), np.array([1.0, c, e]), self.pace))
        return found

    def inverse(self) -> LinearModel:
        """Return 1/d as a linear model."""
        return self._replace(
            gain=1 / self.gain, quadratics=self.quadratics[:, [2, 3, 0, 1]]
        ).model()
