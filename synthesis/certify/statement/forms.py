"""The forms of the Lyapunov function V that a user can request for a proof."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError

MAX_SEGMENTS = 1024
"""Largest number of segments: each has inequalities of its own, and larger programs take hours to
assemble.
"""


@dataclass(frozen=True, kw_only=True)
class _InP:
    """How P depends on p: see `Spline`."""

    degree: int | tuple[int, ...] | None = None
    segments: int | tuple[int | tuple[int, ...], ...] | None = None
    grading: float | None = None
    accept: float | None = None

    def __post_init__(self) -> None:
        degrees = self.degree if isinstance(self.degree, tuple) else (self.degree,)
        if self.degree is not None and not all(d in (0, 1, 2, 3, 4) for d in degrees):
            raise InputError(f"degree of P must be 0 .. 4, got {self.degree!r}")
        segments: Any = self.segments
        segments = (segments,) if isinstance(segments, int | np.integer) else segments
        if segments is not None and not (
            isinstance(segments, tuple | list)
            and segments
            and all(
                isinstance(k, int | np.integer) and 1 <= k <= MAX_SEGMENTS
                for each in segments
                for k in (each if isinstance(each, tuple) else (each,))
            )
        ):
            raise InputError(
                f"segments must be an integer from 1 to {MAX_SEGMENTS}, or a tuple of them to try"
                f" in turn, got {self.segments!r:.80}; each segment adds inequalities, and a larger"
                " program is not solved in reasonable time: grade the knots (grading=2) towards"
                " where P changes most, or narrow the range"
            )
        object.__setattr__(self, "segments", None if segments is None else tuple(segments))
        if self.grading is not None and not self.grading >= 1:
            raise InputError(f"grading must be >= 1, got {self.grading!r}")
        if self.accept is not None and not self.accept >= 1:
            raise InputError(f"accept must be >= 1, got {self.accept!r}")

    def degrees(self, parameters: int) -> list[int | None]:
        """Return the degree in each of so many parameters, None for the default."""
        return _each(self.degree, parameters, "degree")

    def segments_tried(self, parameters: int) -> list[list[Any]] | None:
        """Return the numbers of segments of each parameter to try in turn; None for the default."""
        segments: Any = self.segments
        tried = segments and [_each(k, parameters, "segments") for k in segments]
        for each in tried or ():
            if math.prod(each) > MAX_SEGMENTS:
                raise InputError(
                    f"segments: {' x '.join(map(str, each))} of {parameters} parameters are"
                    f" {math.prod(each)}, each with inequalities of its own; expected"
                    f" {MAX_SEGMENTS} at most"
                )
        return tried

    @property
    def near(self) -> float:
        """`accept`, or its default."""
        return 2.0 if self.accept is None else self.accept


def _each(given: Any, parameters: int, name: str) -> list[Any]:
    if not isinstance(given, tuple):
        return [given] * parameters
    if len(given) != parameters:
        raise InputError(f"{name}: expected one for each of {parameters} parameter(s), got {given}")
    return list(given)


@dataclass(frozen=True, kw_only=True)
class Spline(_InP):
    """V = x' P(p) x with P a continuous spline in each parameter.

    Parameters
    ----------
    degree : int or tuple of int, optional
        Of P in every parameter, or one each, 0 to 4; 0 is a constant P. By default for `l2_gain`
        and `stability` of one parameter 3 in continuous and 2 in discrete time (more than 12
        states: 2 and 1), for several 2 and 1, but as for one in a parameter whose rate is another.
        A gain of several that is far above the worst frozen one is computed with degree 4 too.
        Where p may jump P is constant in continuous time, whatever the degree; sampled, a constant
        P is tried first.
    segments : int or tuple, optional
        Of P in every parameter; several numbers are tried in turn until the bound is good enough,
        each an integer or a tuple of one a parameter. By default 16 and 32, in discrete time 8 and
        16; 4 and 8 with more than 12 states, in the general analysis of one parameter and of one
        whose rate is another, 1 of several. A constant P has no knots, but its LMIs are cut there
        (8). Where not a single number is given, P linear between storage functions of frozen models
        is tried too for a gain over one slow parameter: at first with more than 12 states, else
        where the others prove no bound within `accept`.
    grading : float, optional
        Knots at low + (high - low)(k/K)^grading; by default 2 for one parameter and for one whose
        rate is another, 1 for several.
    total_degree : int, optional
        Limits the sum of the degrees in several parameters; needs one segment.
    accept : float, optional
        A bound within this factor of the worst frozen one is good enough (2).

    Raises
    ------
    InputError
        For a number out of range.

    Examples
    --------
    >>> Spline(degree=2, segments=(8, 16)).segments
    (8, 16)
    """

    total_degree: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.total_degree is not None and not self.total_degree >= 0:
            raise InputError(f"total_degree must be >= 0 or None, got {self.total_degree!r}")
        counts: Any = (1,) if self.segments is None else self.segments
        if self.total_degree is not None and any(np.any(np.ravel(k) != 1) for k in counts):
            raise InputError("a total degree of P needs one segment in each parameter")


@dataclass(frozen=True)
class LaggedParameter(_InP):
    """V = x' P(p, p - q) x with q a first-order lag of p: P depends on the recent history of p.

    For `l2_gain` and `stability` of one parameter in continuous time. A finite memory of the
    parameter makes a quadratic V exact in the limit.

    Parameters
    ----------
    seconds : float
        Time constant of the lag, s; about the time in which the worst p turns round.
    degree, segments, grading, accept
        Of P in p, as in `Spline`; by default degree 3 on 12 segments.
    across_segments, across_degree : int
        Of P in p - q.

    Raises
    ------
    InputError
        For a number out of range.

    References
    ----------
    Lee and Dullerud, "Uniform stabilization of discrete-time switched and Markovian jump linear
    systems", Automatica 42 (2006), for the idea in discrete time.

    Examples
    --------
    >>> LaggedParameter(0.6, across_segments=3).seconds
    0.6
    """

    seconds: float
    across_segments: int = 3
    across_degree: int = 2

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (
            self.seconds > 0
            and 1 <= self.across_segments <= MAX_SEGMENTS
            and self.across_degree in (1, 2, 3, 4)
        ):
            raise InputError(
                f"expected seconds > 0, across_segments from 1 to {MAX_SEGMENTS} and across_degree"
                f" 1 .. 4, got {self.seconds!r}, {self.across_segments!r} and"
                f" {self.across_degree!r}"
            )


@dataclass(frozen=True)
class HigherOrder(_InP):
    """V of degree 2 `order` in the states: V = z' P(p) z, z the monomials of degree `order`.

    For `stability` of one parameter in continuous time; costs grow with the sixth power of the
    number of monomials.

    Parameters
    ----------
    order : int
        2 or 3; 1 is `Spline`.
    degree, segments, grading
        Of P in p, as in `Spline`; by default degree 2 on 4, then 8 segments.

    Raises
    ------
    InputError
        For a number out of range.

    References
    ----------
    Chesi, Garulli, Tesi and Vicino, "Homogeneous Lyapunov functions for systems with structured
    uncertainties", Automatica 39 (2003).

    Examples
    --------
    >>> HigherOrder(2, segments=4).order
    2
    """

    order: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.order not in (2, 3):
            raise InputError(f"expected order 2 or 3 (1 is a Spline), got {self.order!r}")


LyapunovForm = Spline | LaggedParameter | HigherOrder
"""Type of `form`."""
