"""User-supplied functions of the scheduling parameter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import qr

from symheli.errors import InputError
from symheli.lpv.bases.basis import Basis, check_range
from symheli.lpv.bases.function_space import Piece
from symheli.values.arrays import Array

if TYPE_CHECKING:
    from symheli.lpv.scheduling import Scheduling

Function = Callable[[Array], Array]

DEPENDENT = 1e-12
"""A function is left out of a basis where others give it to this share of its size: a few times the
rounding of what is fitted in that basis.
"""


@dataclass(frozen=True)
class UserFunctions(Basis):
    """A basis of one's own is any list of callables, f_j(p) = functions[j](p), that take an array
    of p and return one of the same shape.

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

    See Also
    --------
    symheli.lpv.Polynomial : orthonormal polynomials
    symheli.lpv.BSpline : piecewise polynomials of any degree

    Examples
    --------
    >>> from symheli.lpv import UserFunctions
    >>> basis = UserFunctions((np.ones_like, np.sqrt), low=0.0, high=13.0, names=("1", "root"))
    >>> basis([4.0, 9.0])
    array([[1., 2.],
           [1., 3.]])
    """

    functions: tuple[Function, ...] = field(repr=False)
    low: float
    high: float
    names: tuple[str, ...] = ()
    derivatives: tuple[Function, ...] = field(default=(), repr=False)

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
        >>> from symheli import Scheduling
        >>> from symheli.lpv import UserFunctions
        >>> angle = Scheduling("angle", "rad", low=0.0, high=1.5)
        >>> basis = UserFunctions.from_expressions([1, sympy.cos(angle.symbol)], angle)
        >>> basis(0.0), basis(0.0, 1) + 0.0
        (array([1., 1.]), array([0., 0.]))
        """
        from symheli.lpv.expressions import functions_of_one

        return functions_of_one(expressions, scheduling)

    @classmethod
    def of_both(cls, f: Basis, g: Basis, products: bool) -> UserFunctions:
        """Return a basis of the functions of both, or of their `products`: as many as are
        independent on the range that they share, to `DEPENDENT`.
        """
        (low, high), (low_g, high_g) = f.ranges[0], g.ranges[0]
        low, high = max(low, low_g), min(high, high_g)
        one, other = _members(f), _members(g)
        each = [a * b for a in one for b in other] if products else [*one, *other]
        turn = np.cos(np.linspace(0.0, np.pi, 8 * len(each)))
        p = 0.5 * (low + high) - 0.5 * (high - low) * turn
        values = np.stack([np.broadcast_to(m.value(p), p.shape) for m in each], axis=-1)
        sizes = np.linalg.norm(values, axis=0)
        scaled = values / np.where(sizes > 0, sizes, 1.0)
        _, R, order = qr(scaled, mode="economic", pivoting=True)  # type: ignore[assignment]
        rank = int(np.sum(np.abs(np.diag(R)) > DEPENDENT))
        kept = [each[j] for j in sorted(order[:rank])]
        slopes = [m.slope for m in kept if m.slope is not None]
        return cls(
            tuple(m.value for m in kept),
            low,
            high,
            tuple(m.name for m in kept),
            tuple(slopes) if len(slopes) == len(kept) else (),
        )

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.functions)

    @property
    def distinct_values(self) -> int:
        """The number of functions."""
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


@dataclass(frozen=True)
class _Member:
    """A function of p, its slope if that is known, and what it is called."""

    value: Function
    slope: Function | None
    name: str

    def __mul__(self, other: _Member) -> _Member:
        slope = None
        if self.slope is not None and other.slope is not None:
            slope = _Slope(self.value, self.slope, other.value, other.slope)
        return _Member(_Product(self.value, other.value), slope, f"({self.name})*({other.name})")


@dataclass(frozen=True)
class _Product:
    """f g."""

    f: Function
    g: Function

    def __call__(self, p: Array) -> Array:
        return self.f(p) * self.g(p)


@dataclass(frozen=True)
class _Slope:
    """f' g + f g'."""

    f: Function
    df: Function
    g: Function
    dg: Function

    def __call__(self, p: Array) -> Array:
        return self.df(p) * self.g(p) + self.f(p) * self.dg(p)


@dataclass(frozen=True)
class _Column:
    """A function of a basis, or its slope."""

    basis: Basis
    j: int
    derivative: int = 0

    def __call__(self, p: Array) -> Array:
        return self.basis(p, self.derivative)[..., self.j]


def _members(basis: Basis) -> list[_Member]:
    if isinstance(basis, UserFunctions):
        slopes = basis.derivatives or (None,) * basis.size
        return [_Member(*each) for each in zip(basis.functions, slopes, basis.names, strict=True)]
    names = [f"{type(basis).__name__} {j}" for j in range(basis.size)]
    return [_Member(_Column(basis, j), _Column(basis, j, 1), name) for j, name in enumerate(names)]
