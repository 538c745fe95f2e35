"""B-splines: local functions of chosen degree and smoothness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline as ScipyBSpline
from scipy.interpolate import PPoly

from symheli.errors import InputError
from symheli.lpv.bases.piecewise import PiecewisePolynomial
from symheli.values.arrays import frozen


@dataclass(frozen=True)
class BSpline(PiecewisePolynomial):
    """B-splines are piecewise polynomials between breakpoints, degree - 1 times continuously
    differentiable; their sum is 1.

    Each differs from zero over at most degree + 1 intervals: what the data say of one speed stays
    there. Degree 1 is `PiecewiseLinear`; the end knots are repeated, so that the first and last
    coefficient are the values at the ends.

    Parameters
    ----------
    degree : int
        At least 1.
    breakpoints : tuple of float
        Increasing, in the unit of p.

    Raises
    ------
    InputError
        Another degree, or breakpoints that do not increase.

    See Also
    --------
    symheli.lpv.CubicSpline, symheli.lpv.Polynomial

    References
    ----------
    de Boor (2001), A Practical Guide to Splines, ch. 9.

    Examples
    --------
    >>> from symheli.lpv import BSpline
    >>> BSpline(2, (0.0, 6.0, 13.0))([0.0, 6.0, 13.0]).round(2) + 0.0
    array([[1.  , 0.  , 0.  , 0.  ],
           [0.  , 0.54, 0.46, 0.  ],
           [0.  , 0.  , 0.  , 1.  ]])
    """

    degree: int
    breakpoints: tuple[float, ...]

    def __post_init__(self) -> None:
        points = frozen(self.breakpoints, "breakpoints", (None,))
        if len(points) < 2 or np.any(np.diff(points) <= 0):
            raise InputError(
                f"BSpline needs at least 2 strictly increasing breakpoints, got {self.breakpoints}"
            )
        if not isinstance(self.degree, int) or self.degree < 1:
            raise InputError(f"degree must be an integer >= 1, got {self.degree!r}")
        object.__setattr__(self, "breakpoints", tuple(float(b) for b in points))

    @property
    def low(self) -> float:  # type: ignore[override]
        """First breakpoint."""
        return self.breakpoints[0]

    @property
    def high(self) -> float:  # type: ignore[override]
        """Last breakpoint."""
        return self.breakpoints[-1]

    @property
    def size(self) -> int:
        """Number of intervals + degree."""
        return len(self.breakpoints) - 1 + self.degree

    @property
    def distinct_values(self) -> int:
        """Number of distinct p needed: as many as there are functions (and one in the support of
        each).
        """
        return self.size

    def _piecewise(self) -> PPoly:
        knots = np.concatenate(
            [[self.low] * self.degree, self.breakpoints, [self.high] * self.degree]
        )
        inside = slice(
            self.degree, len(knots) - 1 - self.degree
        )  # without the empty intervals of the repeated ends
        parts = [
            PPoly.from_spline(ScipyBSpline(knots, unit, self.degree)).c[:, inside]
            for unit in np.eye(self.size)
        ]
        return PPoly(np.stack(parts, axis=-1), np.array(self.breakpoints))
