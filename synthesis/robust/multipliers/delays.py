"""Multipliers of a constant delay that keep its phase: |v(t - T)| has the energy of v at every
frequency, and the error of a delay is below a weight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from symheli.values.arrays import Array
from synthesis.robust.multipliers.classes import Lags, Multipliers, symmetric, unit

CORNER, ZEROS, POLES = Fraction(2363, 1000), Fraction(838, 1000), Fraction(685, 1000)
"""Corner frequency, times the delay, and damping of the weight of a delay: Skogestad and
Postlethwaite, Multivariable Feedback Control (2005), eq. 7.27 (published).
"""
SHAPES = "difference", "delay", "window"
"""Forms of a delay: v(t - T) - v(t), v(t - T), or minus the integral of v from t - T to t.
"""
WEIGHT = 3
"""Order of that weight."""
LAG, CORNER_OF_PHASE, KAPPA, PHASE = Fraction(27, 100), Fraction(14, 5), 3, 4
"""Numbers a, q and 3 of `phase`, and its order."""


@dataclass(frozen=True, eq=False)
class DelayMultipliers(Multipliers):
    """A constant delay up to `longest` (s), with e = v(t - T) - v(t): d is e ("difference"), v + e
    ("delay") or the integral of e ("window"); the same T in all channels.

    |v + e| = |v| at every frequency has a multiplier X of any sign. |N v| >= |D e| has Y > 0, of a
    weight N/D as polynomials of s; that a delay lags has W > 0, with `phase`; of a window |d| <=
    longest |v| has Z > 0. One pole a: polynomials over powers of (s + a) are sums of lagged copies.
    """

    channels: int
    longest: float
    shape: str
    lags: Lags
    fields: ClassVar[dict[str, Any]] = {"longest": float, "shape": str}

    def _fault(self) -> str:
        if not (0 < self.longest < math.inf and self.shape in SHAPES):
            return "a delay is not above zero, or of no known form"
        enough = len(self.lags.poles) == 1 and self.lags.order >= WEIGHT + self.first
        return "" if enough else "multipliers of a delay have one pole, and powers of it to 3"

    @property
    def signals(self) -> int:
        """Number of base signals: v, e or the integral of e."""
        return 2 * self.channels

    def nominal(self, number: Any) -> Any:
        """Return what a delay of zero makes of v."""
        return number(float(self.shape == "delay"))

    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return v, and e or its integral."""
        return np.vstack([v, d - self.nominal(number) * v])

    @property
    def first(self) -> int:
        """Least power of the lag at which e is known: 1 where d is its integral."""
        return int(self.shape == "window")

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Sizes of the matrices X, Y, W, and of a window Z."""
        n, top = self.channels, self.lags.order + 1 - self.first
        last = n * (top + 1) if self.first else 0
        return n * top, n * (top - WEIGHT), n * max(top - PHASE, 0), last

    @property
    def count(self) -> int:
        """Number of coefficients."""
        return sum(n * (n + 1) // 2 for n in self.sizes)

    def _copies(self, number: Any) -> tuple[Array, Array]:
        """Return v and e through the powers of the lag from `first` on, as rows on z."""
        n, size = self.channels, self.signals * (1 + self.lags.order)
        whole = unit(size)
        v = [whole[self.at(r) : self.at(r) + n] for r in range(self.lags.order + 1)]
        d = [whole[self.at(r) + n : self.at(r) + 2 * n] for r in range(self.lags.order + 1)]
        if self.first:  # e = s d, and s (a/(s + a))^r = a ((a/(s + a))^(r - 1) - (a/(s + a))^r)
            a = number(self.lags.poles[0])
            d = [a * (before - own) for before, own in pairwise(d)]
            v = v[1:]
        return np.array(v), np.array(d)

    def _weighted(self, rows: Array, polynomial: Sequence[Any], a: Any, degree: int) -> Array:
        """Return p(s)/(s + a)^degree times the copies, from the powers 0, 1, ... of the lag on."""
        out = []
        for start in range(len(rows) - degree):
            total = 0 * rows[0]
            for power, coefficient in enumerate(polynomial):
                # s^q/(s + a)^m = a^(q - m) (1 - E)^q E^(m - q)
                signs = [1]
                for _ in range(power):
                    signs = [x - y for x, y in zip([*signs, 0], [0, *signs], strict=True)]
                size = coefficient * a**power / a**degree
                for k, sign in enumerate(signs):
                    total = total + sign * size * rows[start + degree - power + k]
            out.append(total)
        return np.vstack(out) if out else np.zeros((0, rows.shape[-1]), dtype=object)

    def form(self, c: Array, number: Any) -> Array:
        """Return the matrix of the form in (v, e or its integral) and their lagged copies."""
        ends = np.cumsum([0, *(n * (n + 1) // 2 for n in self.sizes)])
        X, Y, W, Z = (symmetric(c[a:b]) for a, b in pairwise(ends))
        v, e = self._copies(number)
        N, D = weight(number(self.longest), number)
        a = number(self.lags.poles[0])
        up, down = self._weighted(v, N, a, WEIGHT), self._weighted(e, D, a, WEIGHT)
        size, turned, beside = phase(number(self.longest), number)
        large, ahead = self._weighted(v, size, a, PHASE), self._weighted(v, turned, a, PHASE)
        behind = self._weighted(e, beside, a, PHASE)
        v, e = np.concatenate([*v]), np.concatenate([*e])
        cross, tilted = v.T @ X @ e, ahead.T @ W @ behind / 2
        out = -(cross + cross.T + e.T @ X @ e) + up.T @ Y @ up - down.T @ Y @ down
        out = out + KAPPA * large.T @ W @ large + tilted + tilted.T
        if self.first:
            n, T = self.channels, number(self.longest)
            at = [self.at(r) for r in range(self.lags.order + 1)]
            own = np.concatenate([start + np.arange(n) for start in at])
            out = out + 0 * c[0]
            out[np.ix_(own, own)] += T * T * Z
            out[np.ix_(own + n, own + n)] -= Z
        return np.asarray(out, dtype=c.dtype)

    def matrices(self, c: Array) -> Sequence[Array]:
        """Return Y, W, and of a window Z."""
        ends = np.cumsum([0, *(n * (n + 1) // 2 for n in self.sizes)])
        parts = [c[a:b] for a, b in pairwise(ends)]
        return tuple(symmetric(part) for part in parts[1:] if len(part))


def weight(T: Any, number: Any) -> tuple[list[Any], list[Any]]:
    """Return N and D, ascending in s, of a weight above |exp(-s T) - 1| on the axis."""
    c, zeros, poles = (_of(x, number) for x in (CORNER, ZEROS, POLES))
    half = _of(Fraction(1, 2), number)
    N = [0 * T, T, 2 * zeros / c * T * T, T * T * T / (c * c)]
    first, second = 2 * poles / c * T, T * T / (c * c)
    D = [1 + 0 * T, first + half * T, second + half * T * first, half * T * second]
    return N, D


def phase(T: Any, number: Any) -> tuple[list[Any], list[Any], list[Any]]:
    """Return K, L and M, ascending in s, with 3 |K v|^2 + Re (L v)* (M e) >= 0 on the axis for
    every delay from 0 to T.

    With n = (1 - a s T)/(1 + a s T) = exp(-i phi) and e = (exp(-i theta) - 1) v, Re n* e/v =
    cos(phi - theta) - cos phi. In theta from 0 to w T it is least at an end up to w T = 4.9, as w T
    < phi + pi there, and never below -(1 + cos phi) = -2/(1 + (a w T)^2). Times 1 + (a w T)^2 it is
    above -3 t^4/(b + t^4), t = w T, b = 4 q^4 = |M|^2 - t^4: shown for t up to 4.9 in
    synthesis/checker, and beyond as 3 t^4/(b + t^4) > 2 there.
    """
    a, q = _of(LAG, number), _of(CORNER_OF_PHASE, number)
    M = [2 * q * q + 0 * T, 2 * q * T, T * T]
    L = [0 * T] * 5
    for i, left in enumerate(M):
        for j, right in enumerate([1 + 0 * T, -2 * a * T, a * a * T * T]):
            L[i + j] = L[i + j] + left * right
    return [0 * T, 0 * T, T * T], L, M


def _of(x: Fraction, number: Any) -> Any:
    return float(x) if number is float else x
