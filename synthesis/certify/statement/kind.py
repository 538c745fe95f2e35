"""The kinds of statement about an LPV model: each one object, with all that other files ask of it.

A kind with a supply rate bounds dV/dt < s0(y, u) + g s1(y, u), each of the form q |y|^2 + 2 s y'u
+ r |u|^2, from rest; g is its level, which a proof makes as small as it can. Source: Willems,
"Dissipative dynamical systems", Archive for Rational Mechanics and Analysis 45 (1972).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any, ClassVar, NamedTuple

from symheli.errors import InputError

Number = Callable[[float], Any]
GROUP = "symheli.kinds"


class Supply(NamedTuple):
    """Coefficients of a supply rate: of |y|^2, of 2 y'u, of |u|^2."""

    outputs: Any
    cross: Any
    inputs: Any

    def plus(self, g: Any, other: Supply) -> Supply:
        """This supply rate and g times another."""
        return Supply(*(a + g * b for a, b in zip(self, other, strict=True)))


BY_INPUTS = Supply(0, 0, 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Facets:
    """The properties that decide about a kind.

    Attributes
    ----------
    sense : int
        1: smaller bounds are better; -1: larger ones; 0: there is no bound.
    fields : tuple of str
        Fields of a certificate: the proven bound, and the one that no proof can improve on.
    unit, meaning : str
        Of the bound; of the statement, in words.
    supply : callable or None
        s0 in an arithmetic, for outputs in units of so much.
    rise : Supply
        s1: what the level multiplies.
    level, bound : callable
        The level of a bound, and back.
    powers : (float, float)
        Of the unit of the outputs, in that of V and in that of the bound.
    gramian : bool
        P bounds the inverse of the inputs' Gramian, and a second inequality sees the outputs.
    rows : bool
        That sees them one after the other: their variances add up.
    decays : bool
        The bound is a rate by which V falls.
    """

    sense: int
    fields: tuple[str, ...]
    unit: str
    meaning: str
    supply: Callable[[Number, float], Supply] | None = None
    rise: Supply = BY_INPUTS
    level: Callable[[Any], Any] = lambda bound: bound * bound
    bound: Callable[[float], float] = lambda g: math.sqrt(max(g, 0.0))
    powers: tuple[float, float] = (2.0, 1.0)
    gramian: bool = False
    rows: bool = False
    decays: bool = False


class Kind(str):
    """The name of a property, and its `facets`: a kind is equal to its name."""

    known: ClassVar[dict[str, Kind]] = {}
    _facets: ClassVar[dict[str, Facets]] = {}

    def __new__(cls, name: str, **facets: Any) -> Kind:
        """Make a kind and register it; of one that is known already, that."""
        if name not in cls.known:
            cls.known[name], cls._facets[name] = super().__new__(cls, name), Facets(**facets)
        return cls.known[name]

    @property
    def facets(self) -> Facets:
        """The properties that decide about the kind."""
        return self._facets[Kind.named(str.__str__(self))]

    @classmethod
    def named(cls, name: Any) -> Kind:
        """Return the kind of this name; raise `InputError` for no kind, with those that there are.

        A kind of another file is made by the entry point of its first words: "radius about 2.0" by
        that of `radius`.
        """
        if isinstance(name, str) and name not in cls.known:
            first, _, rest = name.partition(" about ")
            points = {point.name: point for point in entry_points(group=GROUP)}
            with contextlib.suppress(ValueError, TypeError):
                if (point := points.get(first.replace(" ", "-"))) is not None:
                    point.load()(*([float(rest)] if rest else []))
        if not isinstance(name, str) or name not in cls.known:
            raise InputError(f"expected one of the kinds {', '.join(cls.known)}, got {name!r:.60}")
        return cls.known[name]

    @property
    def gains(self) -> bool:
        """Whether smaller bounds, which are not negative, are better."""
        return self.facets.sense == 1

    @property
    def driven(self) -> bool:
        """Whether inputs stand in its inequality."""
        return self.facets.supply is not None or self.facets.gramian

    @property
    def indexed(self) -> bool:
        """Whether it has a supply rate other than that of the L2 gain: a level of any sign."""
        return self.facets.supply is not None and self != L2_GAIN


L2_GAIN = Kind(
    "l2 gain",
    sense=1,
    fields=("gamma", "lower"),
    unit="y per u",
    meaning="|y|_2 < gamma |u|_2 from rest, all inputs to all outputs together",
    supply=lambda number, _: Supply(-number(1.0), 0, 0),
)
ENERGY_TO_PEAK = Kind(
    "energy-to-peak gain",
    sense=1,
    fields=("gamma", "lower"),
    unit="y per u and root second",
    meaning="max_t |y(t)| < gamma |u|_2 from rest, |y| of all outputs together",
    powers=(0.0, 1.0),
    gramian=True,
)
H2_GAIN = Kind(
    "h2 gain",
    sense=1,
    fields=("gamma", "lower"),
    unit="y per u and root second",
    meaning="from rest E|y(t)|^2 < gamma^2 at every t, in white noise of unit intensity",
    powers=(0.0, 1.0),
    gramian=True,
    rows=True,
)
DECAY_RATE = Kind(
    "decay rate",
    sense=-1,
    fields=("alpha", "upper"),
    unit="1/s",
    meaning="|x(t)| <= c exp(-alpha t) |x(0)| for some c",
    decays=True,
)
STABILITY = Kind(
    "stability", sense=0, fields=(), unit="", meaning="the free state decays exponentially"
)
