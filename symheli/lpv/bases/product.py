"""Products of one-parameter bases: functions of several scheduling parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import product

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis
from symheli.lpv.bases.function_space import FunctionSpace, Range
from symheli.lpv.bases.polynomial import Polynomial
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Product(FunctionSpace):
    """f_j(p) = f_{j1}(p_1) f_{j2}(p_2) ...: every product of functions of the factors, the last
    factor running fastest.

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
        limit = np.inf if self.total_degree is None else self.total_degree
        return tuple(
            i
            for i in product(*(range(f.size) for f in self.factors))
            if sum(i) <= limit or self.total_degree is None
        )

    @property
    def size(self) -> int:
        """Number of products."""
        return len(self.indices)

    @property
    def distinct_values(self) -> int:
        """As many points as functions (in general position)."""
        return self.size

    def _values(self, p: Array, derivative: int) -> Array:
        if derivative:
            raise InputError(
                "products of bases have no derivative by one number; differentiate the factors"
            )
        values = [f(p[..., i]) for i, f in enumerate(self.factors)]
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
        forms = [f.form(name) for f in self.factors]
        full = reduce(np.kron, forms)
        if self.total_degree is None:
            return full
        if name not in Polynomial.GRADED:
            raise InputError(
                f"the {name!r} form mixes degrees: with a total degree choose from"
                f" {', '.join(Polynomial.GRADED)}"
            )
        every = list(product(*(range(f.size) for f in self.factors)))
        kept = [every.index(i) for i in self.indices]
        return full[np.ix_(kept, kept)]
