"""Unit conversion of inputs: units are declared at the interface; internally SI and radians."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping

from symheli.errors import InputError, UnknownNameError

_STANDARD_GRAVITY = 9.80665
_POUND = 0.45359237

_TO_SI: dict[str, tuple[float, str]] = {
    "1": (1.0, "1"),
    "%": (0.01, "1"),
    "s": (1.0, "s"),
    "ms": (1e-3, "s"),
    "us": (1e-6, "s"),
    "ns": (1e-9, "s"),
    "min": (60.0, "s"),
    "h": (3600.0, "s"),
    "m": (1.0, "m"),
    "cm": (0.01, "m"),
    "mm": (1e-3, "m"),
    "km": (1e3, "m"),
    "ft": (0.3048, "m"),
    "in": (0.0254, "m"),
    "m/s": (1.0, "m/s"),
    "km/h": (1 / 3.6, "m/s"),
    "kt": (1852 / 3600, "m/s"),
    "mph": (0.44704, "m/s"),
    "ft/s": (0.3048, "m/s"),
    "ft/min": (0.3048 / 60, "m/s"),
    "m/s^2": (1.0, "m/s^2"),
    "ft/s^2": (0.3048, "m/s^2"),
    "g": (9.80665, "m/s^2"),
    "rad": (1.0, "rad"),
    "deg": (math.pi / 180, "rad"),
    "mrad": (1e-3, "rad"),
    "rev": (2 * math.pi, "rad"),
    "rad/s": (1.0, "rad/s"),
    "deg/s": (math.pi / 180, "rad/s"),
    "rpm": (2 * math.pi / 60, "rad/s"),
    "kg": (1.0, "kg"),
    "gram": (1e-3, "kg"),
    "lb": (_POUND, "kg"),
    "oz": (_POUND / 16, "kg"),
    "slug": (14.593902937, "kg"),
    "kg m^2": (1.0, "kg m^2"),
    "kg cm^2": (1e-4, "kg m^2"),
    "gram cm^2": (1e-7, "kg m^2"),
    "lb ft^2": (_POUND * 0.3048**2, "kg m^2"),
    "lb in^2": (_POUND * 0.0254**2, "kg m^2"),
    "slug ft^2": (14.593902937 * 0.3048**2, "kg m^2"),
    "m^2": (1.0, "m^2"),
    "cm^2": (1e-4, "m^2"),
    "ft^2": (0.3048**2, "m^2"),
    "in^2": (0.0254**2, "m^2"),
    "N": (1.0, "N"),
    "kN": (1e3, "N"),
    "kgf": (_STANDARD_GRAVITY, "N"),
    "lbf": (_POUND * _STANDARD_GRAVITY, "N"),
    "ozf": (_POUND / 16 * _STANDARD_GRAVITY, "N"),
    "N m": (1.0, "N m"),
    "N cm": (0.01, "N m"),
    "kgf cm": (_STANDARD_GRAVITY * 0.01, "N m"),
    "ft lbf": (0.3048 * _POUND * _STANDARD_GRAVITY, "N m"),
    "in lbf": (0.0254 * _POUND * _STANDARD_GRAVITY, "N m"),
    "N m/rad": (1.0, "N m/rad"),
    "N m/deg": (180 / math.pi, "N m/rad"),
    "ft lbf/rad": (0.3048 * _POUND * _STANDARD_GRAVITY, "N m/rad"),
    "W": (1.0, "W"),
    "kW": (1e3, "W"),
    "hp": (745.6998715822702, "W"),
    "PS": (735.49875, "W"),
    "Pa": (1.0, "Pa"),
    "hPa": (100.0, "Pa"),
    "kPa": (1e3, "Pa"),
    "bar": (1e5, "Pa"),
    "psi": (_POUND * _STANDARD_GRAVITY / 0.0254**2, "Pa"),
    "kg/m^3": (1.0, "kg/m^3"),
    "1/rad": (1.0, "1/rad"),
    "1/deg": (180 / math.pi, "1/rad"),
    "rad/rad": (1.0, "rad/rad"),
    "s/rad": (1.0, "s/rad"),
    "1/s": (1.0, "1/s"),
    "Hz": (1.0, "1/s"),
    "V": (1.0, "V"),
}
"""{unit: (factor to SI, SI unit)}; messages offer these, and every product of them is read."""

_ALSO = {
    **dict.fromkeys(("kn", "kts", "knot", "knots"), "kt"),
    **dict.fromkeys(("lbs", "lbm", "pound", "pounds"), "lb"),
    **dict.fromkeys(("grams", "gm"), "gram"),
    **dict.fromkeys(("ounce", "ounces"), "oz"),
    **dict.fromkeys(("slugs",), "slug"),
    **dict.fromkeys(("kilogram", "kilograms", "kgs"), "kg"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("hr", "hour", "hours"), "h"),
    **dict.fromkeys(("degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("mbar",), "hPa"),
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("watt", "watts"), "W"),
    **dict.fromkeys(("µs", "μs"), "us"),
    "kph": "km/h",
    "Nm": "N m",
    "RPM": "rpm",
}
"""Other names of known units."""

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")

_MEANT = {"g": "gram", "lb": "lbf", "oz": "ozf"}
"""What a name of two meanings is read as where its first does not fit what is expected: 18 lb of
thrust, ft lb of torque, 850 g of mass.
"""

_BASE = ("kg", "m", "rad", "s", "V")
_ATOMS: dict[str, dict[str, int]] = {
    "1": {},
    **{base: {base: 1} for base in _BASE},
    "N": {"kg": 1, "m": 1, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
}

Dimension = Mapping[str, int]
"""Exponents of kg, m, rad, s, V; those that are zero are left out. The radian counts as a unit, to
distinguish N m from N m/rad.
"""


def to_si(unit: str, expected: str = "") -> tuple[float, str]:
    """(factor, SI unit) such that value_SI = factor * value. Raises `UnknownNameError`.

    Products, powers and quotients of known units are units too, in the usual spellings: "slug
    ft^2", "N*m", "kg·m²", "ft-lbf", "ft/s^2/rad", "1/(ft s)". Where a name has two meanings ("g",
    "lb", "oz") the one is taken that makes the dimension of `expected`.
    """
    if not isinstance(unit, str):
        raise InputError(
            f"unit: expected a text such as 'deg/s' ('1' where there is none), got {unit!r}"
        )
    read = _read(unit, expected)
    if read in _TO_SI:
        return _TO_SI[read]
    factor, powers = _parse(read)
    return factor, text(powers)


def dimension(unit: str, expected: str = "") -> Dimension:
    """The dimension of a unit, {"kg": 1, "m": 2, "s": -2} for N m; `expected` as in `to_si`.
    Raises `UnknownNameError`.
    """
    return dict(_parse(_read(unit, expected))[1])


@functools.cache
def _read(unit: str, expected: str) -> str:
    """The unit in this module's spelling, each name in the meaning that fits `expected`."""
    if unit in _TO_SI:
        plain = unit
    else:
        power = unit.translate(_SUPERSCRIPTS).replace("**", "^").replace("^(", "^").strip()
        joined = re.sub(r"[*·⋅×]|(?<=[A-Za-z])-(?=[A-Za-z])", " ", power)
        joined = re.sub(r"(?<![\d^-])\b([A-Za-z°µμ]+)(-?[1-9])(?!\d)", r"\1^\2", joined)
        plain = re.sub(r"[A-Za-z°µμ]+", lambda m: _named(m[0]), joined)
        plain = " ".join(re.sub(r"\s*/\s*", "/", plain).split())
    if expected:
        wanted = _parse(expected)[1]
        other = re.sub(r"[A-Za-z]+", lambda m: _MEANT.get(m[0], m[0]), plain)
        if other != plain and _parse(plain)[1] != wanted and _parse(other)[1] == wanted:
            return other
    return plain


def _named(name: str) -> str:
    """A known name for one of a unit: another name of it, or the same in other case."""
    if name in _TO_SI:
        return name
    if name in _ALSO:
        return _ALSO[name]
    small = name.lower()
    return (
        _ALSO.get(small, small) if len(name) > 1 and (small in _TO_SI or small in _ALSO) else name
    )


def quotient(unit: str, by: str) -> str:
    """The SI unit of a quantity in `unit` divided by one in `by`: "m/s^2" by "rad" is
    "m/s^2/rad".
    """
    return text(_combined(dimension(unit), dimension(by), -1))


def per_second(unit: str) -> str:
    """The unit of a rate of something in `unit`: "m/s^2" of "m/s"; "km/h/s" of "km/h"; a
    user-defined unit, which cannot be converted, with "/s" appended.
    """
    try:
        return quotient(unit, "s") if to_si(unit)[0] == 1.0 else f"{unit}/s"
    except InputError:
        return f"{unit}/s"


def ratio(unit: str, other: str) -> float | None:
    """Return how many of `other` one `unit` is: 3.6 for "m/s" and "km/h"; None for another
    dimension, or for unknown and different units.
    """
    if unit == other:
        return 1.0
    try:
        if dimension(unit) != dimension(other):
            return None
        return to_si(unit)[0] / to_si(other)[0]
    except InputError:
        return None


def text(powers: Dimension) -> str:
    """A dimension as a unit of kg, m, rad and s: "m/s^2/rad"; "1" without dimension."""

    def name(base: str, power: int) -> str:
        return base if power == 1 else f"{base}^{power}"

    above = " ".join(name(b, powers[b]) for b in _BASE if powers.get(b, 0) > 0)
    below = [name(b, -powers[b]) for b in ("kg", "m", "s", "rad", "V") if powers.get(b, 0) < 0]
    return "/".join([above or "1", *below])


def units_of(wanted: Dimension) -> list[str]:
    """Known units of this dimension."""
    return [unit for unit in _TO_SI if dimension(unit) == wanted]


@functools.cache
def _parse(unit: str) -> tuple[float, Dimension]:
    """Factor to SI and dimension. After a / stands one unit or a product in brackets: m/(s rad),
    m/s/rad, never m/s rad.
    """
    if unit in _TO_SI and _TO_SI[unit][1] != unit:  # km/h, rpm: known as a whole
        factor, si = _TO_SI[unit]
        return factor, _parse(si)[1]
    parts = re.split(r"/\s*(\([^()]*\)|[^/()]+)", unit.strip())
    factor, powers = _product(parts[0], unit)
    for below, rest in zip(parts[1::2], parts[2::2], strict=True):
        inner = below.strip().removeprefix("(").removesuffix(")")
        if rest.strip() or (" " in below.strip() and inner == below.strip()):
            raise InputError(
                f"unit {unit!r}: put what follows a / in brackets, as in 1/(m s), or use a second"
                " /, as in 1/m/s"
            )
        other, minus = _product(inner, unit)
        factor, powers = factor / other, _combined(powers, minus, -1)
    return factor, powers


def _product(part: str, unit: str) -> tuple[float, Dimension]:
    factor: float = 1.0
    powers: Dimension = {}
    for token in part.split():
        name, caret, exponent = token.partition("^")
        if name not in _TO_SI or "/" in name or (caret and not re.fullmatch(r"-?\d+", exponent)):
            raise UnknownNameError("unit", unit, _TO_SI)
        scale, si = _TO_SI[name]
        inside = _ATOMS[si] if si in _ATOMS else dimension(si)
        power = int(exponent or 1)
        factor, powers = factor * scale**power, _combined(powers, inside, power)
    if not part.split():
        raise UnknownNameError("unit", unit, _TO_SI)
    return factor, powers


def _combined(one: Dimension, other: Dimension, power: int) -> Dimension:
    total = {base: one.get(base, 0) + power * other.get(base, 0) for base in _BASE}
    return {base: n for base, n in total.items() if n}
