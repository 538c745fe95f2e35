"""What every basis over the scheduling range can answer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.arrays import Array, frozen


class Piece(NamedTuple):
    """One polynomial piece of a basis: on [low, high], f_j(p) = sum_i bernstein[j, i] B_i(x), x = (p-low)/(high-low)."""

    low: float
    high: float
    bernstein: Array


class Basis(ABC):
    """A family of functions f_1 .. f_n of one scheduling parameter p in [low, high]; M(p) = sum_j f_j(p) M_j."""

    low: float
    high: float

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of functions n."""

    @property
    @abstractmethod
    def distinct_values(self) -> int:
        """How many distinct p are needed before the functions can be told apart."""

    @abstractmethod
    def _values(self, p: Array, derivative: int) -> Array: ...

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """The polynomial pieces of the functions, in order of p."""

    def __call__(self, p: object, derivative: int = 0) -> Array:
        """Values (or derivatives, per unit of p) of the functions at p, shape p.shape + (n,). Raises `InputError` outside the range."""
        p = frozen(p, "scheduling parameter")
        slack = 1e-9 * (self.high - self.low)
        if p.size and (p.min() < self.low - slack or p.max() > self.high + slack):
            raise InputError(
                f"the scheduling parameter spans [{p.min():.4g}, {p.max():.4g}] but the basis is declared on "
                f"[{self.low:.4g}, {self.high:.4g}]; declare the basis over the whole range of the data"
            )
        return self._values(p, derivative)

    def fit(self, p: object, values: object) -> Array:
        """Least-squares coefficients (n, ...) of `values` (K, ...) sampled at `p` (K,)."""
        p = frozen(p, "nodes", (None,))
        values = frozen(values, "values")
        distinct = len(np.unique(p))
        if distinct < self.distinct_values:
            raise InputError(f"{self} needs {self.distinct_values} distinct nodes, got {distinct}; add nodes or lower the degree")
        flat = values.reshape(len(p), -1)
        coefficients = np.linalg.lstsq(self(p), flat, rcond=None)[0]
        return coefficients.reshape(self.size, *values.shape[1:])


def check_range(low: float, high: float) -> None:
    """Raises `InputError` unless low < high, both finite."""
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"a basis needs finite low < high, got [{low}, {high}]")
