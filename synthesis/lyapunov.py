"""Parameter-dependent Lyapunov functions V(x, p) = x' P(p) x with P a continuous spline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from synthesis.bernstein import blossom

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class SplineLyapunov:
    """P(p) of `degree` d on the K segments between `knots` (K + 1,), continuous: coefficients (K d + 1, n, n).

    Segment j has the Bernstein coefficients j d .. (j + 1) d; P is in physical units of the states, V in those of the
    squared output times seconds (samples in discrete time). Degree 0 is one constant P.
    """

    knots: Array
    degree: int
    coefficients: Array

    def __post_init__(self) -> None:
        for name in ("knots", "coefficients"):
            array = np.array(getattr(self, name), dtype=float)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        n = self.coefficients.shape[-1]
        expected = (self.segments * self.degree + 1, n, n)
        if self.coefficients.shape != expected:
            raise InputError(f"expected Lyapunov coefficients of shape {expected}, got {self.coefficients.shape}")

    @property
    def segments(self) -> int:
        """Number of segments K."""
        return len(self.knots) - 1

    def segment(self, j: int) -> Array:
        """Bernstein coefficients (d + 1, n, n) on segment j."""
        return self.coefficients[j * self.degree : (j + 1) * self.degree + 1]

    def at(self, p: float | Array) -> Array:
        """P at p, shape p.shape + (n, n). Raises `InputError` outside the knots."""
        j, t = self._locate(p)
        return self._sum(self.coefficients, self.degree, j * self.degree, t)

    def derivative(self, p: float | Array) -> Array:
        """dP/dp at p (per unit of p), the right-hand one at a knot, shape p.shape + (n, n)."""
        j, t = self._locate(p)
        if self.degree == 0:
            return np.zeros((*np.shape(t), *self.coefficients.shape[1:]))
        widths = np.repeat(np.diff(self.knots), self.degree)[:, None, None]
        return self._sum(self.degree * np.diff(self.coefficients, axis=0) / widths, self.degree - 1, j * self.degree, t)

    @staticmethod
    def _sum(coefficients: Array, degree: int, first: Array, t: Array) -> Array:
        weights = blossom([t] * degree)
        return sum(((w * np.ones_like(t))[..., None, None] * coefficients[first + i] for i, w in enumerate(weights)), np.zeros(()))

    def _locate(self, p: float | Array) -> tuple[Array, Array]:
        p = np.asarray(p, dtype=float)
        slack = 1e-9 * (self.knots[-1] - self.knots[0])
        if p.size and (p.min() < self.knots[0] - slack or p.max() > self.knots[-1] + slack):
            raise InputError(f"p spans [{p.min():.4g}, {p.max():.4g}], P is known on [{self.knots[0]:.4g}, {self.knots[-1]:.4g}]")
        j = np.clip(np.searchsorted(self.knots, p, side="right") - 1, 0, self.segments - 1)
        t = (p - self.knots[j]) / (self.knots[j + 1] - self.knots[j])
        return j, np.clip(t, 0.0, 1.0)


def graded_knots(low: float, high: float, segments: int, grading: float, breaks: Sequence[float] = (), shortest: float = 0.0) -> Array:
    """Knots low + (high - low) (k/K)^grading, moved onto a `break` of the model that is near, none closer than `shortest`.

    They are short binary fractions, so that exact arithmetic on them stays short.
    """
    quantum = 2.0 ** np.floor(np.log2((high - low) / (8 * segments**grading)))
    ideal = low + (high - low) * (np.arange(1, segments) / segments) ** grading
    inner = np.round(ideal / quantum) * quantum
    points = np.array([low, *inner, high])
    for k in range(1, segments):
        reach = 0.3 * min(points[k] - points[k - 1], points[k + 1] - points[k])
        near = [b for b in breaks if abs(b - points[k]) <= reach]
        points[k] = min(near, key=lambda b: abs(b - points[k])) if near else points[k]
    kept = [low]
    for point in points[1:-1]:
        if point - kept[-1] >= max(shortest, 0.5 * quantum) and high - point >= max(shortest, 0.5 * quantum):
            kept.append(float(point))
    return np.array([*kept, high])
