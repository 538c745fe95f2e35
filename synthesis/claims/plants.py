"""Plants of a claim: listed vertices, a grid of one parameter, polynomials, models with limits.

Every double is the rational that it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive
from symheli.values.summary import summarized
from synthesis.claims.monomials import Monomials, monomials, written
from synthesis.numerics.polynomial.exact import exact, rational


def rationals(M: Any) -> Array:
    """Return the doubles as rationals, in an object array."""
    return exact(M, rational())


def stack(value: Any, name: str, count: int | None, rows: int | None, columns: int | None) -> Array:
    """Return matrices (count, rows, columns), of one matrix or a stack; one matrix is repeated."""
    array = np.asarray(value, dtype=object)
    own = frozen(value, name, (None,) * 3 if array.ndim == 3 else (None, None))
    own = own if own.ndim == 3 else np.broadcast_to(own, (count or 1, *own.shape))
    return frozen(own, name, (count, rows, columns))


def _matrices(own: Any, names: Sequence[str]) -> None:
    """Check A, B, C, D of a plant, and fill in those that it does not have."""
    A = stack(own.A, "A", None, None, None)
    count, n, other = A.shape
    if n != other or not n or not count:
        raise InputError(f"A: expected one or more square matrices (N, n, n), got shape {A.shape}")
    object.__setattr__(own, "A", A)
    if "C" not in names:
        object.__setattr__(own, "B", stack(own.B, "B", count, n, None))
        return
    B = stack(np.zeros((n, 0)) if own.B is None else own.B, "B", count, n, None)
    C = stack(np.zeros((0, n)) if own.C is None else own.C, "C", count, None, n)
    shape = C.shape[1], B.shape[2]
    D = stack(np.zeros(shape) if own.D is None else own.D, "D", count, *shape)
    for name, M in (("B", B), ("C", C), ("D", D)):
        object.__setattr__(own, name, M)
    if own.dt is not None:
        object.__setattr__(own, "dt", positive(own.dt, "dt"))


def _time(dt: float | None) -> str:
    return "in continuous time" if dt is None else f"sampled every {dt!r} s"


@dataclass(frozen=True, eq=False)
class VertexPlant:
    """Listed models: the plant is at any time any of them, or any convex combination of them.

    Parameters
    ----------
    A : array (N, n, n)
        dx/dt = A x + B u; sampled x(k + 1). One matrix (n, n) is one model.
    B, C, D : array (N, n, m), (N, q, n), (N, q, m), optional
        y = C x + D u; one matrix is that of every model.
    dt : float, optional
        Sample period, s; None: continuous time.

    Raises
    ------
    InputError
        For shapes that do not fit.

    Examples
    --------
    >>> VertexPlant([[[-1.0, 0.0], [0.0, -2.0]], [[-1.0, 1.0], [0.0, -2.0]]]).states
    2
    """

    A: Array
    B: Any = None
    C: Any = None
    D: Any = None
    dt: float | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        _matrices(self, "ABCD")

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[1]

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """The plant in sentences."""
        count = len(self.A)
        if count == 1:
            return (f"one linear model of {self.states} states, {_time(self.dt)}",)
        return (
            f"{count} listed models of {self.states} states, {_time(self.dt)}",
            "the plant is at any time any of them or any convex combination, and changes in any"
            " way",
        )


@dataclass(frozen=True, eq=False)
class GridPlant:
    """Models at points of one parameter, with straight lines between the points.

    Parameters
    ----------
    p : array (N,)
        Points of the parameter, ascending.
    A, B, C, D : array
        As of a `VertexPlant`, one a point.
    rate : float
        Largest |dp/dt|, units of p per second; inf: p may jump.
    dt : float, optional
        Sample period, s; None: continuous time.

    Raises
    ------
    InputError
        For shapes that do not fit, or points that do not ascend.

    Examples
    --------
    >>> GridPlant([0.0, 1.0], [[[-1.0]], [[-2.0]]], rate=0.5).hypotheses[1]
    'between the 2 points of p in [0, 1] the matrices are straight lines; nothing else is known'
    """

    p: Array
    A: Array
    B: Any = None
    C: Any = None
    D: Any = None
    rate: float = math.inf
    dt: float | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        _matrices(self, "ABCD")
        p = frozen(self.p, "p", (len(self.A),))
        if len(p) < 2 or not np.all(np.diff(p) > 0):
            raise InputError(f"p: expected two or more ascending points, got {p}")
        object.__setattr__(self, "p", p)
        rate = float(self.rate)
        if not rate >= 0:
            raise InputError(f"rate: expected a number >= 0 or inf, got {self.rate!r:.60}")
        object.__setattr__(self, "rate", rate)

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[1]

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """The plant in sentences."""
        moving = "p may jump" if math.isinf(self.rate) else f"|dp/dt| <= {self.rate:g} per second"
        low, high = self.p[0], self.p[-1]
        return (
            f"models of {self.states} states, {_time(self.dt)}",
            f"between the {len(self.p)} points of p in [{low:g}, {high:g}] the matrices are"
            " straight lines; nothing else is known",
            moving,
        )

    def at(self, p: Any, M: Array) -> Array:
        """Return matrices M (N, ...) of the points at p (...), in doubles."""
        own = np.asarray(p, dtype=float)
        k = np.clip(np.searchsorted(self.p, own, side="right") - 1, 0, len(self.p) - 2)
        t = ((own - self.p[k]) / (self.p[k + 1] - self.p[k]))[..., None, None]
        return (1 - t) * M[k] + t * M[k + 1]


@dataclass(frozen=True, eq=False)
class PolynomialPlant:
    """A vector field x' = f(x) of polynomials, with an equilibrium at x = 0.

    Parameters
    ----------
    states : sequence of str
        Names of the states.
    f : sequence of str or {exponents: number}
        One polynomial a state. A decimal in a text is the rational that it writes.

    Raises
    ------
    InputError
        For a text that is no polynomial, or f(0) other than 0.

    Examples
    --------
    >>> print(*PolynomialPlant(["x"], ["-x + x^3"]).hypotheses)
    x' = 1*x^3 - 1*x
    """

    states: tuple[str, ...]
    f: Any

    __repr__ = summarized

    def __post_init__(self) -> None:
        names = (self.states,) if isinstance(self.states, str) else tuple(map(str, self.states))
        if not all(n.isidentifier() for n in names) or len(set(names)) < len(names) or not names:
            raise InputError(f"states: expected different names, got {names}")
        given = [self.f] if isinstance(self.f, str | Mapping) else list(self.f)
        if len(given) != len(names):
            raise InputError(f"f: expected {len(names)} polynomials, got {len(given)}")
        f = tuple(monomials(each, names) for each in given)
        if any((0,) * len(names) in each for each in f):
            raise InputError("f(0) is not 0: shift the states so that the equilibrium is 0")
        object.__setattr__(self, "states", names)
        object.__setattr__(self, "f", f)

    @property
    def fields(self) -> tuple[Monomials, ...]:
        """The polynomials, one a state."""
        return self.f

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """The plant in sentences."""
        return tuple(
            f"{name}' = {_short(written(each, self.states))}"
            for name, each in zip(self.states, self.f, strict=True)
        )


def _short(text: str) -> str:
    return text if len(text) <= 200 else f"{text[:160]} ... ({text.count('*')} products)"


@dataclass(frozen=True, eq=False)
class LimitedPlant:
    """A sampled model x(k + 1) = A x + B u with limits of states and inputs, as an MPC has it.

    Parameters
    ----------
    A : array (N, n, n)
        One model or several: the plant is any convex combination of them.
    B : array (N, n, m)
        Inputs, all of them controls.
    H_x, h_x : array (k, n), (k,), optional
        H_x x <= h_x.
    H_u, h_u : array (l, m), (l,), optional
        H_u u <= h_u.

    Raises
    ------
    InputError
        For shapes that do not fit, or a limit below zero: x = 0 has to be allowed.

    Examples
    --------
    >>> LimitedPlant([[1.0, 1.0], [0.0, 1.0]], [[0.5], [1.0]], **box_limits([5, 5], [1])).states
    2
    """

    A: Array
    B: Array
    H_x: Any = None
    h_x: Any = None
    H_u: Any = None
    h_u: Any = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        _matrices(self, "AB")
        for name, size in (("x", self.A.shape[1]), ("u", self.B.shape[2])):
            H, h = getattr(self, f"H_{name}"), getattr(self, f"h_{name}")
            if (H is None) != (h is None):
                raise InputError(f"give both H_{name} and h_{name}, or none of them")
            H = frozen(np.zeros((0, size)) if H is None else H, f"H_{name}", (None, size))
            h = frozen(np.zeros(0) if h is None else h, f"h_{name}", (len(H),))
            if np.any(h < 0):
                raise InputError(f"h_{name}: {name} = 0 is not allowed by these limits")
            object.__setattr__(self, f"H_{name}", H)
            object.__setattr__(self, f"h_{name}", h)

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[1]

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """The plant in sentences."""
        count = len(self.A)
        models = "one model" if count == 1 else f"any convex combination of {count} models"
        return (
            f"{models} of {self.states} states and {self.B.shape[2]} inputs, sampled",
            f"{len(self.h_x)} limits of the states, {len(self.h_u)} of the inputs",
        )


def box_limits(x_max: Any, u_max: Any) -> dict[str, Array]:
    """Return H_x, h_x, H_u, h_u of |x_i| <= x_max_i, |u_j| <= u_max_j.

    Parameters
    ----------
    x_max, u_max : float or array
        Limits of each state and each input, in their units; inf: no limit.

    Returns
    -------
    dict
        Rows `H_x` and `H_u`, and what they are at most, `h_x` and `h_u`.

    Raises
    ------
    InputError
        For a limit below zero.

    Examples
    --------
    >>> box_limits([5, float("inf")], 1)["h_x"]
    array([5., 5.])
    """
    found = {}
    for name, most in (("x", x_max), ("u", u_max)):
        size = frozen(np.atleast_1d(most), f"{name}_max", (None,), finite=False)
        if not np.all(size >= 0):
            raise InputError(f"{name}_max: expected limits >= 0, got {size}")
        own = np.eye(len(size))[np.isfinite(size)]
        limits = size[np.isfinite(size)]
        found |= {f"H_{name}": np.vstack([own, -own]), f"h_{name}": np.r_[limits, limits]}
    return found


def as_fraction(number: float) -> Fraction:
    """Return the rational that a double is."""
    return Fraction(float(number))
