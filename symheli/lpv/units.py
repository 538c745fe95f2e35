"""Units at the door: what comes in is declared, what is inside is SI and radians."""

from __future__ import annotations

import math

from symheli.errors import UnknownNameError

_TO_SI: dict[str, tuple[float, str]] = {
    "1": (1.0, "1"), "%": (0.01, "1"), "s": (1.0, "s"), "ms": (1e-3, "s"), "us": (1e-6, "s"), "min": (60.0, "s"),
    "m": (1.0, "m"), "cm": (0.01, "m"), "mm": (1e-3, "m"), "km": (1e3, "m"), "ft": (0.3048, "m"), "in": (0.0254, "m"),
    "m/s": (1.0, "m/s"), "km/h": (1 / 3.6, "m/s"), "kt": (1852 / 3600, "m/s"), "mph": (0.44704, "m/s"),
    "ft/s": (0.3048, "m/s"), "ft/min": (0.3048 / 60, "m/s"),
    "m/s^2": (1.0, "m/s^2"), "ft/s^2": (0.3048, "m/s^2"), "g": (9.80665, "m/s^2"),
    "rad": (1.0, "rad"), "deg": (math.pi / 180, "rad"), "mrad": (1e-3, "rad"),
    "rad/s": (1.0, "rad/s"), "deg/s": (math.pi / 180, "rad/s"), "rpm": (2 * math.pi / 60, "rad/s"),
    "kg": (1.0, "kg"), "lb": (0.45359237, "kg"), "slug": (14.593902937, "kg"),
    "kg m^2": (1.0, "kg m^2"), "slug ft^2": (14.593902937 * 0.3048**2, "kg m^2"),
    "m^2": (1.0, "m^2"), "ft^2": (0.3048**2, "m^2"),
    "N": (1.0, "N"), "N m": (1.0, "N m"), "N m/rad": (1.0, "N m/rad"), "W": (1.0, "W"), "hp": (745.6998715822702, "W"),
    "Pa": (1.0, "Pa"), "kg/m^3": (1.0, "kg/m^3"), "1/rad": (1.0, "1/rad"), "rad/rad": (1.0, "rad/rad"),
    "s/rad": (1.0, "s/rad"), "1/s": (1.0, "1/s"), "V": (1.0, "V"),
}  # fmt: skip


def to_si(unit: str) -> tuple[float, str]:
    """(factor, SI unit) such that value_SI = factor * value. Raises `UnknownNameError`."""
    if unit not in _TO_SI:
        raise UnknownNameError("unit", unit, _TO_SI)
    return _TO_SI[unit]
