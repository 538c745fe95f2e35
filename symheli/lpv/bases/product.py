"""Products of one-parameter bases: functions of several scheduling parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import product
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.function_space import FunctionSpace, Range, tensor_grid
from symheli.lpv.bases.polynomial import Polynomial
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Product(FunctionSpace):
    """A product basis holds every product of functions of its factors, f_j(p) = f_{j1}(p_1)
    f_{j2}(p_2) ..., the last factor running fastest.

    Products of bases orthonormal over their ranges are orthonormal over the box.

    Parameters
    ----------
    factors : tuple of Basis
        One a parameter, at least two.
    total_degree : int, optional
        Polynomial factors only: just the products whose degrees add up to that at most.

    Raises
    ------
    InputError
        Fewer than two factors, or a total degree that does not suit them.

    See Also
    --------
    symheli.lpv.Polynomial, symheli.Scheduling

    Examples
    --------
    >>> from symheli.lpv import Polynomial, Product
    >>> speed, acceleration = Polynomial(2, 0.0, 13.0), Polynomial(2, -3.0, 3.0)
    >>> Product((speed, acceleration)).size, Product((speed, acceleration), total_degree=2).size
    (9, 6)
    """

    factors: tuple[Basis, ...]
    total_degree: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "factors", tuple(self.factors))
        if len(self.factors) < 2 or not all(isinstance(f, Basis) for f in self.factors):
            raise InputError(
                f"a product needs at least two one-parameter bases, got {self.factors!r:.120}"
            )
        if self.total_degree is None:
            return
        if not all(isinstance(f, Polynomial) for f in self.factors):
            raise InputError(
                "total_degree is for polynomial factors; leave it out for all products"
            )
        if not isinstance(self.total_degree, int) or self.total_degree < 0:
            raise InputError(f"total_degree must be an integer >= 0, got {self.total_degree!r}")

    @property
    def ranges(self) -> tuple[Range, ...]:
        """(low, high) of each factor."""
        return tuple((f.low, f.high) for f in self.factors)

    @cached_property
    def indices(self) -> tuple[tuple[int, ...], ...]:
        """Which function of each factor makes up each product."""
        if self.total_degree is None:
            return tuple(product(*(range(f.size) for f in self.factors)))
        found: list[tuple[int, ...]] = [()]
        for f in self.factors:  # never the full product, which is 2^d long for d affine parameters
            found = [
                (*i, k) for i in found for k in range(min(f.size, self.total_degree - sum(i) + 1))
            ]
        return tuple(found)

    @property
    def size(self) -> int:
        """Number of products."""
        return len(self.indices)

    @property
    def distinct_values(self) -> int:
        """The number of functions (in general position)."""
        return self.size

    @property
    def degrees(self) -> tuple[int, ...] | None:
        """Degree in each parameter where all factors are polynomials, else None."""
        degrees = [f.degrees for f in self.factors]
        return None if None in degrees else tuple(d for (d,) in degrees)  # type: ignore[misc]

    def constant(self) -> Array:
        """The product of the constants of the factors."""
        own = zip([f.constant() for f in self.factors], np.array(self.indices).T, strict=True)
        return reduce(np.multiply, (constant[places] for constant, places in own))

    def samples(self, ranges: Sequence[Range] | None = None) -> Array:
        """Every combination of the samples of the factors."""
        wanted = self.ranges if ranges is None else ranges
        return tensor_grid([f.samples([r]) for f, r in zip(self.factors, wanted, strict=True)])

    def tensor(self, coefficients: Array) -> Array:
        """Coefficients (n, ...) as (n_1, n_2, ..., ...), one axis a factor, 0 for products left
        out.
        """
        out = np.zeros((*(f.size for f in self.factors), *coefficients.shape[1:]))
        out[tuple(np.array(self.indices).T)] = coefficients
        return out

    def _values(self, p: Array, derivative: Any) -> Array:
        orders = (0,) * self.dimension if derivative == 0 else derivative
        if not isinstance(orders, tuple) or len(orders) != self.dimension:
            raise InputError(
                f"derivative: expected {self.dimension} numbers, one a parameter, got"
                f" {derivative!r}"
            )
        values = [
            f(p[..., i], k) for i, (f, k) in enumerate(zip(self.factors, orders, strict=True))
        ]
        return reduce(
            np.multiply,
            (
                v[..., list(column)]
                for v, column in zip(values, zip(*self.indices, strict=True), strict=True)
            ),
        )

    def form(self, name: str) -> Array:
        """Products of the forms of the factors, in the same order; a total degree keeps the forms
        graded by degree.
        """
        if self.total_degree is not None and name not in Polynomial.GRADED:
            raise InputError(
                f"the {name!r} form mixes degrees: with a total degree choose from"
                f" {', '.join(Polynomial.GRADED)}"
            )
        own = zip([f.form(name) for f in self.factors], np.array(self.indices).T, strict=True)
        return reduce(np.multiply, (form[places[:, None], places] for form, places in own))
