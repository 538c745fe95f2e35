"""The scheduling parameters: what they are called, where they live and how fast they may move."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from symheli.errors import InputError, UnknownNameError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import finite
from symheli.values.units import per_second, ratio

if TYPE_CHECKING:
    import sympy

RANGE_SLACK = 1e-9
"""Fraction of a range by which p may leave it: rounding."""

Limit = float | str
"""Rate bound of a parameter: a number in its unit per second (math.inf: arbitrarily fast), or the
name of the parameter that is its rate.
"""
Rates = Limit | Sequence[Limit] | Mapping[str, Limit]
"""One limit for all parameters, one for each in order, or {name: limit}."""


@dataclass(frozen=True)
class Scheduling:
    """A scheduling parameter p stays within [low, high] with |dp/dt| <= rate, or dp/dt is another
    parameter.

    Parameters
    ----------
    name, unit : str
        Its name and unit.
    low, high : float
        Its range, in `unit`.
    rate : float or str
        Bound on |dp/dt| in `unit` per second (math.inf: arbitrarily fast), or the name of another
        parameter of the same model, which is then dp/dt: with rate="acceleration" the rate of an
        airspeed equals the acceleration.

    Raises
    ------
    InputError
        A range that is empty or not finite, a rate that is not >= 0.

    See Also
    --------
    symheli.LPVStateSpace, symheli.lpv.Polynomial

    Examples
    --------
    >>> import symheli
    >>> airspeed = symheli.Scheduling("airspeed", "m/s", low=0.0, high=13.0, rate="acceleration")
    >>> acceleration = symheli.Scheduling("acceleration", "m/s^2", low=-3.0, high=3.0, rate=5.0)
    >>> airspeed.middle, airspeed.radius
    (6.5, 6.5)
    """

    name: str
    unit: str
    low: float
    high: float
    rate: Limit = math.inf

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and isinstance(self.unit, str)):
            raise InputError(
                "scheduling: expected a name and a unit before the range, as"
                f" Scheduling('airspeed', 'm/s', 0.0, 13.0), got {self.name!r:.40} and"
                f" {self.unit!r:.40}"
            )
        for end in ("low", "high"):
            finite(getattr(self, end), f"scheduling {self.name}: {end}")
        if not self.low < self.high:
            raise InputError(
                f"scheduling {self.name}: expected finite low < high, got [{self.low}, {self.high}]"
            )
        if isinstance(self.rate, str):
            if not self.rate or self.rate == self.name:
                raise InputError(
                    f"scheduling {self.name}: rate must be a number or the name of another"
                    f" parameter, got {self.rate!r}"
                )
        elif isinstance(self.rate, bool) or not float(self.rate) >= 0:
            raise InputError(
                f"scheduling {self.name}: rate must be >= 0 {self.unit}/s, got {self.rate}"
            )

    @property
    def limit(self) -> float:
        """The rate as a number; raises `InputError` where it is another parameter."""
        if isinstance(self.rate, str):
            raise InputError(
                f"the rate of {self.name} is the parameter {self.rate}, not a number: give a rate"
            )
        return self.rate

    @property
    def middle(self) -> float:
        """Centre of the range, in `unit`."""
        return 0.5 * (self.low + self.high)

    @property
    def radius(self) -> float:
        """Half the width of the range, in `unit`."""
        return 0.5 * (self.high - self.low)

    @property
    def symbol(self) -> sympy.Symbol:
        """The parameter in SymPy expressions, in `unit`: a real symbol of its name."""
        import sympy

        return sympy.Symbol(self.name, real=True)

    def normalised(self, p: Array) -> Array:
        """Return p as a number from -1 at `low` to 1 at `high`; no digit of p is lost far from
        zero.
        """
        return ((p - self.low) - (self.high - p)) / (self.high - self.low)

    def with_rate(self, rate: Limit) -> Scheduling:
        """Return the same parameter with another rate limit."""
        return replace(self, rate=rate)

    def check(self, p: object) -> Array:
        """`p` as an array; raises `InputError` where it leaves [low, high] by more than
        rounding.
        """
        p = frozen(p, self.name)
        slack = RANGE_SLACK * (self.high - self.low)
        if p.size and (p.min() < self.low - slack or p.max() > self.high + slack):
            raise InputError(
                f"{self.name} spans [{p.min():.4g}, {p.max():.4g}] {self.unit} but the model holds"
                f" on [{self.low:.4g}, {self.high:.4g}]; clip the data or identify and sweep over a"
                " wider range"
            )
        return p


UNSCHEDULED = Scheduling("constant", "1", 0.0, 1.0)
"""The parameter of a model on which nothing depends."""


def parameters(given: Scheduling | Sequence[Scheduling]) -> tuple[Scheduling, ...]:
    """Return one or several parameters as a tuple; raise `InputError` for repeated names, and for a
    rate that is not one of them or has the wrong unit.
    """
    out = (given,) if isinstance(given, Scheduling) else tuple(given)
    if not out or not all(isinstance(s, Scheduling) for s in out):
        raise InputError(f"expected a Scheduling or several, got {given!r:.120}")
    names = [s.name for s in out]
    if len(set(names)) < len(names):
        raise InputError(f"scheduling parameters must have different names, got {', '.join(names)}")
    for s in out:
        if not isinstance(s.rate, str):
            continue
        if s.rate not in names:
            raise UnknownNameError(f"scheduling parameter (the rate of {s.name})", s.rate, names)
        other = out[names.index(s.rate)]
        if isinstance(other.rate, str):
            raise InputError(
                f"the rate of {s.name} is {other.name}, whose own rate must then be a number"
                f" ({other.unit}/s), got {other.rate!r}"
            )
        expected = per_second(s.unit)
        if not math.isclose(ratio(other.unit, expected) or 0.0, 1.0):  # not another size either
            raise InputError(
                f"{other.name} ({other.unit}) cannot be the rate of {s.name} ({s.unit}): expected"
                f" {expected}"
            )
    return out


def check_all(given: Sequence[Scheduling], p: object) -> Array:
    """p (..., d) as an array, p of any shape with one parameter; raises `InputError` outside the
    ranges and for a wrong number of parameters.
    """
    if len(given) == 1:
        return given[0].check(p)
    p = frozen(p, "scheduling parameters")
    if p.shape[-1:] != (len(given),):
        raise InputError(
            f"expected the {len(given)} parameters {', '.join(s.name for s in given)} along the"
            f" last axis, got shape {p.shape}"
        )
    for i, s in enumerate(given):
        s.check(p[..., i])
    return p
