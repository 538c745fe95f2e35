"""User-supplied functions of the scheduling parameter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis, check_range
from symheli.lpv.bases.function_space import Piece
from symheli.values.arrays import Array

if TYPE_CHECKING:
    from symheli.lpv.scheduling import Scheduling


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
    derivatives : tuple of callable
        df_j/dp, one a function; without them what needs a slope is refused. `from_expressions`
        finds them.

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
    derivatives: tuple[Callable[[Array], Array], ...] = ()

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
        object.__setattr__(self, "derivatives", tuple(self.derivatives))
        if self.derivatives and len(self.derivatives) != len(self.functions):
            raise InputError(
                f"derivatives: expected {len(self.functions)}, one a function, got"
                f" {len(self.derivatives)}"
            )
        for derivative in range(1 + bool(self.derivatives)):
            self(np.linspace(self.low, self.high, 33), derivative)

    @classmethod
    def from_expressions(cls, expressions: Sequence[Any], scheduling: Scheduling) -> UserFunctions:
        """Return a basis of SymPy expressions, or numbers, in the symbol of the parameter, with
        their derivatives.

        Examples
        --------
        >>> import sympy
        >>> from symheli.lpv import Scheduling, UserFunctions
        >>> angle = Scheduling("angle", "rad", low=0.0, high=1.5)
        >>> basis = UserFunctions.from_expressions([1, sympy.cos(angle.symbol)], angle)
        >>> basis(0.0), basis(0.0, 1) + 0.0
        (array([1., 1.]), array([0., 0.]))
        """
        from symheli.lpv.expressions import functions_of_one

        return functions_of_one(expressions, scheduling)

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.functions)

    @property
    def distinct_values(self) -> int:
        """As many as there are functions."""
        return self.size

    def _values(self, p: Array, derivative: Any) -> Array:
        if derivative > bool(self.derivatives):
            raise InputError(
                "user-supplied functions have no known derivative of this order: give"
                " `derivatives`, write them by UserFunctions.from_expressions, or use a polynomial"
                " or spline basis"
            )
        functions = self.derivatives if derivative else self.functions
        out = np.empty((*p.shape, self.size))
        with np.errstate(all="ignore"):
            for j, (function, name) in enumerate(zip(functions, self.names, strict=True)):
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
            " polynomial or spline basis, or fit the model, lpv.fitted(Polynomial(8, low, high))"
        )
