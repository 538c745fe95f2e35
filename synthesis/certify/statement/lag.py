"""A first-order lag of the scheduling parameter: a known second parameter that depends on the
history of p.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.numerics.polynomial import structure

CORNER_OFFSET = 2.0**-20
"""The region begins this fraction of the range away from e = 0, so that it stays invariant with
rounded corners.
"""
INVARIANCE_MARGIN = 1e-3
"""Relative margin of the invariance condition at the corners, for the same reason."""


@dataclass(frozen=True, eq=False)
class LagRegion:
    """The region that the lag error e = p - q cannot leave while |dp/dt| <= rate, q the lag `time`
    dq/dt = p - q from q(0) = p(0).

    lower(p) <= e <= upper(p), straight lines between the `knots` (K + 1,) of p; e in units of p,
    `time` in s.
    """

    knots: Array
    lower: Array
    upper: Array
    time: float

    def __post_init__(self) -> None:
        for name in ("knots", "lower", "upper"):
            object.__setattr__(self, name, structure.numbers(getattr(self, name), name))
        if self.fault:
            raise InputError(self.fault)

    @property
    def fault(self) -> str | None:
        """Reason why the form is invalid, None where it is valid."""
        found = structure.ascending(self.knots)
        if found:
            return found
        if not self.knots.shape == self.lower.shape == self.upper.shape or not np.all(
            np.isfinite([self.lower, self.upper])
        ):
            return "expected one finite lower and upper at every knot"
        if not np.all(self.lower < self.upper) or not (
            isinstance(self.time, float | int) and 0 < self.time < math.inf
        ):
            return "expected lower < upper at every knot and a finite lag time > 0 s"
        return None

    @classmethod
    def reached(cls, knots: Array, rate: float, time: float) -> LagRegion:
        """Return a polygon around all reachable (p, e): e grows no faster than by 1 - e/(rate time)
        per unit of p.
        """
        up = _polygon(np.diff(knots), rate * time, CORNER_OFFSET * (knots[-1] - knots[0]))
        down = _polygon(np.diff(knots)[::-1], rate * time, CORNER_OFFSET * (knots[-1] - knots[0]))
        return cls(knots, -down[::-1], up, time)

    def invariant(self, rate: float, number: Callable[[float], Any]) -> bool:
        """Whether no trajectory can leave the region, in the arithmetic of `number`; e = 0 lies
        inside.

        With de/dt = dp/dt - e/time, D = e - upper(p) > 0 has dD/dt <= |1 - upper'| rate - e/time <=
        0 if
        |1 - upper'| rate time <= upper on each segment; in the same way below.
        """
        reach = number(rate) * number(self.time)
        p, lower, upper = (
            [number(float(v)) for v in values] for values in (self.knots, self.lower, self.upper)
        )
        if not all(low <= 0 <= high for low, high in zip(lower, upper, strict=True)):
            return False
        for k in range(len(p) - 1):
            width = p[k + 1] - p[k]
            rise, fall = (upper[k + 1] - upper[k]) / width, (lower[k + 1] - lower[k]) / width
            if (
                rise < 0
                or fall < 0
                or abs(1 - rise) * reach > upper[k]
                or abs(1 - fall) * reach > -lower[k + 1]
            ):
                return False
        return True

    def locate(self, p: Array) -> tuple[Array, Array, Array, Array]:
        """Return lower(p), upper(p) - lower(p) and their slopes (right-hand ones at a knot)."""
        k = np.clip(np.searchsorted(self.knots, p, side="right") - 1, 0, len(self.knots) - 2)
        height = self.upper - self.lower
        slopes = [np.diff(values) / np.diff(self.knots) for values in (self.lower, height)]
        return (
            np.interp(p, self.knots, self.lower),
            np.interp(p, self.knots, height),
            slopes[0][k],
            slopes[1][k],
        )


def _polygon(widths: Array, reach: float, start: float) -> Array:
    out = [start]
    for width in widths:
        out.append(out[-1] + width * max(0.0, 1.0 - (1.0 - INVARIANCE_MARGIN) * out[-1] / reach))
    assert all(a <= b for a, b in pairwise(out))  # noqa: S101 - never falls
    return np.array(out)
