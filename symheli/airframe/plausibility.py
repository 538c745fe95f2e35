"""Plausibility of an airframe: impossible numbers, and numbers that a wrong unit would explain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import permutations
from math import pi
from typing import NamedTuple

from symheli.airframe.quantity import Quantity
from symheli.components import Entry
from symheli.values.kinematics import GRAVITY
from symheli.values.units import dimension, to_si, units_of


class Scale(NamedTuple):
    """Reference quantities of an airframe: main-rotor radius (m) and mass (kg)."""

    radius: float
    mass: float


class Range(NamedTuple):
    """Plausible values of a kind of quantity, those of models of 20 g up to helicopters of 60 t.

    `low` and `high` in `unit` bound the number itself or, with `ratio`, that multiple of it by
    `name`; ratios make one range serve every size.
    """

    low: float
    high: float
    unit: str
    name: str = ""
    ratio: Callable[[Scale], float] | None = None

    def __str__(self) -> str:
        return f"{f'{self.name} ' if self.name else ''}{self.low:g} to {self.high:g} {self.unit}"

    def among(self, value: float, scale: Scale | None) -> tuple[float, bool]:
        """The number compared, and whether it is plausible; without a scale a ratio is taken as
        such.
        """
        if self.ratio is None:
            return value, self.low <= value <= self.high
        if scale is None:
            return value, True
        compared = value * self.ratio(scale)
        return compared, self.low <= compared <= self.high


RANGES: Mapping[str, Range] = {
    "rotor radius": Range(0.03, 25.0, "m"),
    "mass": Range(
        2.0, 3000.0, "N/m^2", "disc loading m g/(pi R^2)", lambda s: GRAVITY / (pi * s.radius**2)
    ),
    "inertia": Range(1e-5, 3.0, "of m R^2", "I/(m R^2)", lambda s: 1 / (s.mass * s.radius**2)),
    "rotor speed": Range(10.0, 400.0, "m/s", "tip speed Om R", lambda s: s.radius),
    "power": Range(5.0, 5000.0, "W/kg", "P/m", lambda s: 1 / s.mass),
    "governor gain": Range(0.0, 1000.0, ""),
    "angle": Range(0.005, 1.0, "rad"),
    "length": Range(0.005, 3.0, "of R", "length/R", lambda s: 1 / s.radius),
    "distance": Range(-5.0, 5.0, "of R", "distance/R", lambda s: 1 / s.radius),
    "chord": Range(0.003, 0.5, "of R", "c/R", lambda s: 1 / s.radius),
    "area": Range(0.0, 2.0, "of pi R^2", "S/(pi R^2)", lambda s: 1 / (pi * s.radius**2)),
    "blades": Range(2, 12, ""),
    "lift slope": Range(0.5, 10.0, "1/rad"),
    "drag coefficient": Range(0.0, 0.2, ""),
    "thrust coefficient": Range(1e-4, 1.0, ""),
    "hub stiffness": Range(
        0.0, 50.0, "of m g R", "K/(m g R)", lambda s: 1 / (s.mass * GRAVITY * s.radius)
    ),
    "Lock number": Range(0.01, 50.0, ""),
    "flapping gain": Range(-20.0, 20.0, ""),
    "fraction": Range(-2.0, 5.0, ""),
    "efficiency": Range(0.1, 1.5, ""),
    "gear ratio": Range(0.2, 30.0, ""),
}
"""{kind of quantity: plausible range}, wider than any helicopter by a factor of two or more."""

USUAL_SOURCE = {
    "rad": "deg",
    "rad/s": "rpm",
    "1/rad": "1/deg",
    "kg": "gram",
    "m": "mm",
    "kg m^2": "kg cm^2",
    "W": "hp",
}
"""Unit in which a number most often is, by SI unit, when it was not converted."""

READABLE_UNIT = {"rad": "deg", "rad/s": "rpm", "1/rad": "1/deg"}
"""Unit in which a message prints a number, by SI unit."""


def impossibilities(
    sections: Mapping[str, Mapping[str, Quantity]], entries: Mapping[str, Mapping[str, Entry]]
) -> Iterator[tuple[str, str, str]]:
    """(section, entry, what is wrong) of every quantity that cannot be."""
    for section, quantities in sections.items():
        for name, q in quantities.items():
            entry = entries[section][name]
            if q.ref:
                continue
            if entry.least is not None and not (q.value >= entry.least and q.value % 1 == 0):
                yield section, name, f"must be a whole number >= {entry.least}, got {q.value:g}"
            elif entry.positive and not q.value > 0:
                yield section, name, f"must be > 0 {q.unit}, got {q.value:g}"
            elif q.unit == "m^2" and q.value < 0:
                yield section, name, f"an area must be >= 0 m^2, got {q.value:g}"
    body = sections.get("body", {})
    inertia = {axis: body[axis].value for axis in ("Ixx", "Iyy", "Izz") if axis in body}
    for largest, *others in permutations(inertia) if len(inertia) == 3 else ():
        both = sum(inertia[axis] for axis in others)
        if others == sorted(others) and inertia[largest] > both * (1 + 1e-12):
            yield (
                "body",
                largest,
                (
                    f"no body has {largest} = {inertia[largest]:g} > {' + '.join(others)} ="
                    f" {both:g} kg m^2"
                ),
            )


def implausibilities(
    sections: Mapping[str, Mapping[str, Quantity]], entries: Mapping[str, Mapping[str, Entry]]
) -> Iterator[tuple[str, str, str]]:
    """(section, entry, what the number would mean) of every number outside its plausible range.

    Where the main rotor's radius or the mass is itself implausible, nothing is compared with it.
    """
    scale = _scale(sections, entries)
    for section, quantities in sections.items():
        for name, q in quantities.items():
            kind = RANGES.get(entries[section][name].kind)
            if kind is None or q.ref or q.unusual:
                continue
            if kind.ratio and scale and scale.mass != scale.mass and _by_mass(kind):
                continue
            compared, plausible = kind.among(q.value, scale)
            if not plausible:
                yield section, name, _doubt(q, kind, compared, scale)


def _by_mass(kind: Range) -> bool:
    """Whether a ratio is one by the mass."""
    return kind.ratio is not None and kind.ratio(Scale(1.0, 1.0)) != kind.ratio(Scale(1.0, 2.0))


def _scale(
    sections: Mapping[str, Mapping[str, Quantity]], entries: Mapping[str, Mapping[str, Entry]]
) -> Scale | None:
    """Radius of the largest main rotor and mass; NaN for a mass that is itself implausible."""
    radii = [
        q.value
        for section, quantities in sections.items()
        for name, q in quantities.items()
        if entries[section][name].kind == "rotor radius"
    ]
    known = [r for r in radii if RANGES["rotor radius"].among(r, None)[1]]
    if not known or len(known) < len(radii):
        return None
    scale = Scale(max(known), float("nan"))
    mass = sections.get("body", {}).get("mass")
    if mass is not None and RANGES["mass"].among(mass.value, scale)[1]:
        scale = scale._replace(mass=mass.value)
    return scale


def _doubt(q: Quantity, kind: Range, compared: float, scale: Scale | None) -> str:
    written = f"{q.value / to_si(q.given or q.unit, q.unit)[0]:.6g} {q.given or q.unit}"
    means = (
        f"is {kind.name} = {compared:.4g} {kind.unit}".rstrip()
        if kind.name
        else f"is {q.value / to_si(READABLE_UNIT[q.unit])[0]:.4g} {READABLE_UNIT[q.unit]}"
        if q.unit in READABLE_UNIT
        else "is outside of every helicopter's range"
    )
    plausible = f"plausible is {kind.low:g} to {kind.high:g} {kind.unit}".rstrip()
    return f"{written} {means}, {plausible}{_meant(q, kind, scale)}"


def _meant(q: Quantity, kind: Range, scale: Scale | None) -> str:
    """The units that would make the number plausible, the usual slip first, at most two."""
    given = q.given or q.unit
    number = q.value / to_si(given, q.unit)[0]
    units = [u for u in units_of(dimension(q.unit)) if u != given]
    units.sort(key=lambda u: u != USUAL_SOURCE.get(q.unit))
    values = {unit: number * to_si(unit, q.unit)[0] for unit in units}
    fit = [unit for unit in units if kind.among(values[unit], scale)[1]][:2]
    readings = " or ".join(f"{number:g} {u}, {values[u]:.4g} {q.unit}" for u in fit)
    return f"; did you mean {readings}?" if readings else ""
