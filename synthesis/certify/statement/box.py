"""Lyapunov functions V(x, p) = x' P(p) x with P a polynomial, or a continuous spline, in several
parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.numerics.polynomial import structure
from synthesis.numerics.polynomial.matrix import PolynomialMatrix


@dataclass(frozen=True, eq=False)
class BoxLyapunov:
    """P of degree d_i in parameter i on each of the K_i segments between `knots[i]`, continuous.

    `coefficients` (K_1 d_1 + 1, ..., K_m d_m + 1, n, n): segment j of parameter i has the Bernstein
    coefficients j d_i .. (j + 1) d_i along axis i. Physical units of the states. Raises
    `InputError` for other shapes.
    """

    knots: tuple[Array, ...]
    degrees: tuple[int, ...]
    coefficients: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        if not isinstance(self.knots, tuple) or not isinstance(self.degrees, tuple):
            raise InputError(
                f"expected a tuple of knots and one of degrees, got {self.knots!r:.60} and"
                f" {self.degrees!r:.60}"
            )
        object.__setattr__(self, "knots", tuple(structure.numbers(k, "knots") for k in self.knots))
        object.__setattr__(
            self, "coefficients", structure.numbers(self.coefficients, "coefficients")
        )
        if self.fault:
            raise InputError(self.fault)

    @property
    def fault(self) -> str | None:
        """Reason why the form is invalid, None where it is valid."""
        if len(self.knots) != len(self.degrees):
            return f"expected a degree for each of {len(self.knots)} parameters, got {self.degrees}"
        found = structure.first(
            *map(structure.ascending, self.knots),
            *(structure.whole(d, 0, "degree") for d in self.degrees),
        )
        if found:
            return found
        n = self.coefficients.shape[-1] if self.coefficients.ndim else 0
        counts = tuple((len(k) - 1) * d + 1 for k, d in zip(self.knots, self.degrees, strict=True))
        return structure.symmetric(self.coefficients, (*counts, n, n))

    def fault_for(self, box: Sequence[tuple[float, float]], states: int) -> str | None:
        """Return why it is not a function of `states` states for every p in the box; None where it
        is.
        """
        if self.fault:
            return self.fault
        if len(self.knots) != len(box):
            return f"P is of {len(self.knots)} parameters, the model has {len(box)}"
        if self.coefficients.shape[-1] != states:
            return f"P is of {self.coefficients.shape[-1]} variables, the model has {states}"
        return structure.first(
            *(structure.covering(k, *ends) for k, ends in zip(self.knots, box, strict=True))
        )

    @property
    def segments(self) -> tuple[int, ...]:
        """Number of segments in each parameter."""
        return tuple(len(k) - 1 for k in self.knots)

    @property
    def form(self) -> str:
        """The form in words."""
        return f"V = x'P(p)x, P of degrees {self.degrees} on {self.segments} segment(s)"

    def segment(self, index: Sequence[int]) -> PolynomialMatrix:
        """P on one segment of each parameter."""
        box = tuple((float(k[j]), float(k[j + 1])) for k, j in zip(self.knots, index, strict=True))
        return PolynomialMatrix(box, self.coefficients[segment_slices(self.degrees, index)])

    def at(self, p: object) -> Array:
        """P at p (..., m), shape (..., n, n). Raises `InputError` outside the knots."""
        return self._sum(p, None)

    def derivative(self, p: object, axis: int) -> Array:
        """dP/dp_axis at p (..., m), the right-hand one at a knot."""
        return self._sum(p, axis)

    def _sum(self, p: object, axis: int | None) -> Array:
        p = np.asarray(p, dtype=float)
        points = p.reshape(-1, len(self.knots))
        index = np.empty(points.shape, dtype=int)
        for i, knots in enumerate(self.knots):
            value, slack = points[:, i], 1e-9 * (knots[-1] - knots[0])
            if len(value) and (value.min() < knots[0] - slack or value.max() > knots[-1] + slack):
                raise InputError(
                    f"p spans [{value.min():.4g}, {value.max():.4g}], P is known on"
                    f" [{knots[0]:.4g}, {knots[-1]:.4g}]"
                )
            index[:, i] = np.clip(
                np.searchsorted(knots, value, side="right") - 1, 0, len(knots) - 2
            )
        out = np.empty((len(points), *self.coefficients.shape[-2:]))
        for place in np.unique(index, axis=0):
            P, here = self.segment(place), np.all(index == place, axis=1)
            out[here] = (P if axis is None else P.derivative(axis))(points[here])
        return out.reshape(*p.shape[:-1], *out.shape[1:])


def segment_slices(degrees: Sequence[int], index: Sequence[int]) -> tuple[slice, ...]:
    """Return the slices of the coefficients of one segment of each parameter."""
    return tuple(slice(j * d, (j + 1) * d + 1) for d, j in zip(degrees, index, strict=True))
