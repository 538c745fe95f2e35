"""A scheduling parameter that is learnt: the input behind a filter, where a static nonlinearity
stands between two filters of third order (Wiener-Hammerstein).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import norm

from identification import StateSpace, fit
from symheli import FlightRecord
from symheli.errors import InputError
from symheli.lpv import BSpline
from symheli.values.arrays import Array

SAMPLES = 20000
"""Of a record that the filter is learnt from, at most."""

TAPS, SETTLED, STABLE = 4, 200, 0.995
"""Coefficients of a numerator; samples until the start is forgotten; largest radius of a pole."""

EXTREME = 7.0
"""End of the splines, in standard deviations of the learnt parameter."""


@dataclass(frozen=True, eq=False)
class FilteredInput:
    """The input `u` behind a filter, over its spread in the record it was learnt from."""

    numerator: Array
    denominator: Array

    def __call__(self, record: FlightRecord) -> FlightRecord:
        """The record with this parameter as its signal `v`."""
        v = lfilter(self.numerator, self.denominator, record["u"])
        return record.with_signals({"v": "1"}, v=v)


def splines(count: int) -> BSpline:
    """Quadratic splines with about as many samples of a normal v between any two of `count`
    breakpoints.
    """
    inner = norm.ppf(np.linspace(0.0, 1.0, count)[1:-1])
    return BSpline(2, (-EXTREME, *map(float, inner), EXTREME))


def filtered_input(record: FlightRecord, basis: BSpline) -> FilteredInput:
    """The filter of `u` with which splines of its output, behind another filter, come closest to
    `y`: the least output error over poles and numerator, all other coefficients by linear least
    squares. It starts from the poles of a constant model, either pair of them in front.

    Raises `InputError` where that model does not have two pairs of complex poles.
    """
    u, y = (record[name][:SAMPLES] for name in "uy")
    short = record.rows(np.arange(len(record)) < SAMPLES)
    poles = fit(StateSpace("y", "u", order=6), short).at().poles()
    turning = np.imag(poles)
    pairs = sorted(poles[turning > 1e-6], key=lambda pole: -abs(pole))[:2]
    if len(pairs) < 2:
        raise InputError("the constant model of order 6 needs two pairs of complex poles")
    real = max([*np.real(poles[np.abs(turning) <= 1e-6]), 0.5])

    def left(z: Array) -> Array:
        if np.abs(z[[0, 1, 3, 4]]).max() > STABLE:
            return np.full(len(y) - SETTLED, np.std(y))
        one = _normal(z, u)
        values = np.asarray(lfilter(one.numerator, one.denominator, u))
        through = basis(np.clip(values, -EXTREME, EXTREME)) * values[:, None]
        through = lfilter([1.0], _denominator(z[3:6]), through, axis=0)
        columns = [through[SETTLED - lag : len(y) - lag] for lag in range(TAPS)]
        q, _ = np.linalg.qr(np.hstack(columns))
        return np.asarray(y[SETTLED:] - q @ (q.T @ y[SETTLED:]))

    starts = []
    for front, back in permutations(pairs):
        poles_of = [f(pole) for pole in (front, back) for f in (lambda _: real, abs, np.angle)]
        start = np.array([*poles_of, 0.3, 1.0, 0.3, 0.0])
        starts.append(least_squares(left, start, x_scale="jac", max_nfev=40))
    return _normal(min(starts, key=lambda found: float(found.cost)).x, u)


def _denominator(z: Array) -> Array:
    """Of a real pole, and of a pair by radius and angle."""
    real, radius, angle = z
    return np.convolve([1.0, -real], [1.0, -2.0 * radius * np.cos(angle), radius**2])


def _normal(z: Array, u: Array) -> FilteredInput:
    """The front filter, its output of spread 1."""
    denominator = _denominator(z[:3])
    spread = float(np.std(lfilter(z[6:], denominator, u)))
    return FilteredInput(z[6:] / max(spread, 1e-12), denominator)
