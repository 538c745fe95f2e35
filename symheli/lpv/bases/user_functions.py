"""User-supplied functions of the scheduling parameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis, check_range
from symheli.lpv.bases.function_space import Piece
from symheli.values.arrays import Array


@dataclass(frozen=True)
class UserFunctions(Basis):
    """f_j(p) = functions[j](p): any callables that take an array of p and return one of the same
    shape.

    Columns are scaled where they are fitted, so the size of the functions does not matter; their
    independence does.

    Parameters
    ----------
    functions : tuple of callable
        Independent on the range.
    low, high : float
        The range, in the unit of p.
    names : tuple of str
        Label them (default f0, f1, ...).

    Raises
    ------
    InputError
        A function does not return finite numbers over the range.

    Examples
    --------
    >>> from symheli.lpv import UserFunctions
    >>> basis = UserFunctions((np.ones_like, np.sqrt), low=0.0, high=13.0, names=("1", "root"))
    >>> basis([4.0, 9.0])
    array([[1., 2.],
           [1., 3.]])
    """

    functions: tuple[Callable[[Array], Array], ...]
    low: float
    high: float
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "functions", tuple(self.functions))
        object.__setattr__(
            self, "names", tuple(self.names) or tuple(f"f{j}" for j in range(len(self.functions)))
        )
        check_range(self.low, self.high)
        if not self.functions or not all(callable(f) for f in self.functions):
            raise InputError(
                f"functions: expected at least one callable of p, got {self.functions!r:.120}"
            )
        if len(self.names) != len(self.functions):
            raise InputError(
                f"expected {len(self.functions)} names, one a function, got {len(self.names)}"
            )
        self(np.linspace(self.low, self.high, 33))

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.functions)

    @property
    def distinct_values(self) -> int:
        """As many as there are functions."""
        return self.size

    def _values(self, p: Array, derivative: Any) -> Array:
        if derivative:
            raise InputError(
                "user-supplied functions have no known derivative; use a polynomial or spline basis"
            )
        out = np.empty((*p.shape, self.size))
        with np.errstate(all="ignore"):
            for j, (function, name) in enumerate(zip(self.functions, self.names, strict=True)):
                values = np.asarray(function(p), dtype=float)
                if values.shape not in (p.shape, ()) or not np.isfinite(values).all():
                    raise InputError(
                        f"function {name}: expected finite numbers of shape {p.shape} on"
                        f" [{self.low:g}, {self.high:g}], got shape {values.shape}"
                        + ("" if np.isfinite(values).all() else " with entries that are not finite")
                    )
                out[..., j] = values
        return out

    def pieces(self) -> tuple[Piece, ...]:
        """Raises `InputError`: these functions are not known to be polynomials."""
        raise InputError(
            "user-supplied functions are not known to be piecewise polynomial; identify with a"
            " polynomial or spline basis"
        )
