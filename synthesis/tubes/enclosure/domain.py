"""Boxes, ellipsoids and products of them: the sets over which functions are enclosed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Domain:
    """The points `centre + generators z`, one set or many at once.

    The symbols z fall into `groups`: of each group the Euclidean norm is at most 1. Groups of one
    symbol are intervals [-1, 1].

    Parameters
    ----------
    centre : array (n,) or (N, n)
        In the units of the function's input.
    generators : array (n, m) or (N, n, m)
    groups : tuple of int
        Number of symbols of each group, m together.

    Raises
    ------
    InputError
        Shapes that do not fit, or a number that is not finite.
    """

    centre: Array
    generators: Array
    groups: tuple[int, ...]

    def __post_init__(self) -> None:
        centre, generators = np.asarray(self.centre, float), np.asarray(self.generators, float)
        if centre.ndim not in (1, 2) or generators.shape[-2:] != (
            centre.shape[-1],
            sum(self.groups),
        ):
            raise InputError(
                f"a domain needs centre (n,) or (N, n) and generators (n, m) or (N, n, m) with m ="
                f" {sum(self.groups)}, the sum of its groups; got {centre.shape} and"
                f" {generators.shape}"
            )
        if not (np.all(np.isfinite(centre)) and np.all(np.isfinite(generators))):
            raise InputError("centre and generators of a domain must be finite")
        object.__setattr__(self, "centre", centre)
        object.__setattr__(self, "generators", generators)

    @classmethod
    def box(cls, lower: Any, upper: Any) -> Domain:
        """All points between `lower` and `upper`, (n,) or (N, n); the box is widened by rounding.

        Raises `InputError` where an entry of `upper` is below that of `lower`.
        """
        lower, upper = np.broadcast_arrays(np.asarray(lower, float), np.asarray(upper, float))
        if not np.all(lower <= upper):
            raise InputError("a box needs lower <= upper in every entry")
        centre = 0.5 * lower + 0.5 * upper
        radius = np.maximum(upper - centre, centre - lower)
        radius = np.where(radius > 0, np.nextafter(radius, np.inf), 0.0)
        n = centre.shape[-1]
        return cls(centre, radius[..., None] * np.eye(n), (1,) * n)

    @classmethod
    def ellipsoid(cls, centre: Any, factor: Any) -> Domain:
        """All points `centre + factor z` with |z| <= 1; `factor` (n, m) or (N, n, m).

        For {x: (x - c)' P (x - c) <= 1} take the inverse of the Cholesky factor: P = L L', factor =
        inverse of L'. What counts is the factor as it is stored.
        """
        factor = np.asarray(factor, float)
        return cls(centre, factor, (factor.shape[-1],))

    @classmethod
    def point(cls, values: Any) -> Domain:
        """One point, (n,), or N of them, (N, n)."""
        values = np.asarray(values, float)
        return cls(values, np.zeros((values.shape[-1], 0)), ())

    @property
    def size(self) -> int:
        """Number of variables."""
        return self.centre.shape[-1]

    def sample(self, rng: np.random.Generator, count: int) -> tuple[Array, Array]:
        """`count` random points of each set with their symbols, (count, ..., n) and (count, ...,
        m): a third of the groups on their border.
        """
        leading = np.broadcast_shapes(self.centre.shape[:-1], self.generators.shape[:-2])
        parts = [np.zeros((count, *leading, 0))]
        for group in self.groups:
            z = rng.standard_normal((count, *leading, group))
            norm = np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-300)
            radius = rng.uniform(size=norm.shape) ** (1 / group)
            radius = np.where(rng.uniform(size=norm.shape) < 1 / 3, 1.0, radius)
            parts.append(z / norm * radius * (1 - 1e-15))
        symbols = np.concatenate(parts, axis=-1)
        return self.centre + (self.generators @ symbols[..., None])[..., 0], symbols
