"""Interval arithmetic on arrays of doubles, rounded outwards.

An operation is rounded to nearest, then moved by one double: IEEE 754 arithmetic is off by half of
that at most. sin, cos, ... are computed in ball arithmetic (python-flint) or by mpmath.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from symheli.values.arrays import Array


@dataclass(frozen=True)
class Interval:
    """Real numbers between `lower` and `upper`, arrays of one shape; both may be infinite."""

    lower: Array
    upper: Array

    @classmethod
    def around(cls, values: Any, radius: Any = 0.0) -> Interval:
        """Values with a radius >= 0, rounded outwards."""
        values = np.asarray(values, float)
        radius = np.broadcast_to(np.asarray(radius, float), values.shape)
        exact = radius == 0
        return cls(
            np.where(exact, values, down(values - radius)),
            np.where(exact, values, up(values + radius)),
        )

    @property
    def middle(self) -> Array:
        """A double within the interval, 0 where a side is infinite."""
        middle = 0.5 * self.lower + 0.5 * self.upper
        return np.where(np.isfinite(middle), np.clip(middle, self.lower, self.upper), 0.0)

    def reach(self, centre: Array) -> Array:
        """Upper bound of the distance to `centre`."""
        return up(np.maximum(self.upper - centre, centre - self.lower))

    @property
    def magnitude(self) -> Array:
        """The largest absolute value."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))

    def __neg__(self) -> Interval:
        return Interval(-self.upper, -self.lower)

    def __add__(self, other: Interval) -> Interval:
        lower = _not_below(down(self.lower + other.lower), self, other)
        return Interval(lower, up(self.upper + other.upper))

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        products = [a * b for a in (self.lower, self.upper) for b in (other.lower, other.upper)]
        # 0 times a side at infinity: the numbers themselves are finite
        products = [np.where(np.isnan(p), 0.0, p) for p in products]
        lower = down(np.minimum(np.minimum(*products[:2]), np.minimum(*products[2:])))
        return Interval(
            _not_below(lower, self, other),
            up(np.maximum(np.maximum(*products[:2]), np.maximum(*products[2:]))),
        )

    def square(self) -> Interval:
        """Squares of the numbers."""
        a, b = self.lower**2, self.upper**2
        least = np.where((self.lower <= 0) & (self.upper >= 0), 0.0, np.minimum(a, b))
        return Interval(np.maximum(down(least), 0.0), up(np.maximum(a, b)))

    def inverse(self) -> Interval:
        """1/x; the whole line where 0 lies within."""
        zero = (self.lower <= 0) & (self.upper >= 0)
        return Interval(
            np.where(zero, -np.inf, down(1 / self.upper)),
            np.where(zero, np.inf, up(1 / self.lower)),
        )

    def sqrt(self) -> Interval:
        """Square roots; the whole line where some of the numbers are negative, which have none."""
        none = ~(self.lower >= 0)
        lower = np.maximum(down(np.sqrt(np.maximum(self.lower, 0.0))), 0.0)
        upper = up(np.sqrt(np.maximum(self.upper, 0.0)))
        return Interval(np.where(none, -np.inf, lower), np.where(none, np.inf, upper))

    def absolute(self) -> Interval:
        """Absolute values of the numbers."""
        least = np.where(
            (self.lower <= 0) & (self.upper >= 0),
            0.0,
            np.minimum(np.abs(self.lower), np.abs(self.upper)),
        )
        return Interval(least, self.magnitude)

    def intersect(self, other: Interval) -> Interval:
        """The part that lies in both, which must not be empty."""
        return Interval(np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper))

    def hull(self, other: Interval) -> Interval:
        """The smallest interval that contains both."""
        return Interval(np.minimum(self.lower, other.lower), np.maximum(self.upper, other.upper))

    def apply(self, name: str) -> Interval:
        """The elementary function `name` ("sin", "cos", "exp", "asin", "atan") of the numbers; the
        whole line where it is not defined on all of them.
        """
        bound = _elementary(name)
        pairs = [bound(a, b) for a, b in zip(self.lower.ravel(), self.upper.ravel(), strict=True)]
        found = np.array(pairs, float).reshape(*self.lower.shape, 2)
        return Interval(found[..., 0], found[..., 1])


def _not_below(lower: Array, one: Interval, other: Interval) -> Array:
    """A lower bound of a sum or product, 0 at least where neither factor is negative: rounded
    outwards it would be just below, where a square root is not defined.
    """
    both = (one.lower >= 0) & (other.lower >= 0)
    return np.where(both, np.maximum(lower, 0.0), lower)


def up(values: Any) -> Any:
    """The next double above."""
    return np.nextafter(values, np.inf)


def down(values: Any) -> Any:
    """The next double below."""
    return np.nextafter(values, -np.inf)


@cache
def _elementary(name: str) -> Callable[[float, float], tuple[float, float]]:
    """(lower, upper) of an elementary function on [a, b]."""
    whole = (-np.inf, np.inf)
    try:
        from flint import arb  # type: ignore[import-not-found]
    except ImportError:
        import mpmath

        interval: Any = mpmath.iv.mpf

        def bounds(a: float, b: float) -> tuple[float, float]:
            if name in ("sin", "cos"):
                image: Any = getattr(mpmath.iv, name)(interval([a, b]))
                return float(image.a), float(image.b)
            with mpmath.workprec(120):  # rising functions: the ends decide, far below a double
                y: list[Any] = [getattr(mpmath, name)(mpmath.mpf(t)) for t in (a, b)]
                if any(isinstance(t, mpmath.mpc) for t in y):
                    return whole
                return float(y[0]), float(y[1])

    else:

        def bounds(a: float, b: float) -> tuple[float, float]:
            if name in ("sin", "cos"):
                ball = arb(0.5 * a + 0.5 * b, float(up(0.5 * b - 0.5 * a)) if a < b else 0.0)
                y = getattr(ball, name)()
                return float(y.lower()), float(y.upper())
            # rising functions: the ends decide
            y = [getattr(arb(float(t)), name)() for t in (a, b)]
            return float(y[0].lower()), float(y[1].upper())

    def found(a: float, b: float) -> tuple[float, float]:
        if not (np.isfinite(a) and np.isfinite(b)):
            return whole
        lower, upper = bounds(a, b)
        if not (np.isfinite(lower) and np.isfinite(upper)):
            return whole
        lower, upper = float(down(lower)), float(up(upper))  # conversion to double rounds
        return (max(lower, -1.0), min(upper, 1.0)) if name in ("sin", "cos") else (lower, upper)

    return found
