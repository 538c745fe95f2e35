"""The standard atmosphere up to 20 km."""

from __future__ import annotations

import math
from typing import NamedTuple

from symheli.errors import InputError
from symheli.values.numbers import finite

GRAVITY = 9.80665  # m/s^2, by which the geopotential metre is defined
GAS_CONSTANT = 287.05287  # J/(kg K), dry air
HEAT_RATIO = 1.4
EARTH_RADIUS = 6_356_766.0  # m
SEA_LEVEL_TEMPERATURE, SEA_LEVEL_PRESSURE = 288.15, 101_325.0  # K, Pa
LAPSE_RATE, TROPOPAUSE, CEILING = -0.0065, 11_000.0, 20_000.0  # K/m, geopotential m


class Air(NamedTuple):
    """Properties of still air: density, pressure, temperature and speed of sound in SI units.

    Parameters
    ----------
    temperature : float
        K.
    pressure : float
        Pa.
    density : float
        kg/m^3.
    speed_of_sound : float
        m/s.

    Examples
    --------
    >>> round(symheli.environment.standard_atmosphere(0.0).speed_of_sound, 1)
    340.3
    """

    temperature: float
    pressure: float
    density: float
    speed_of_sound: float


def standard_atmosphere(altitude: float, warmer: float = 0.0) -> Air:
    """Return the air at an altitude of the standard atmosphere, or warmer at the same pressure.

    Hydrostatic equation with -6.5 K/km up to 11 km, constant temperature above.

    Parameters
    ----------
    altitude : float
        Geometric, above sea level, m, -2000 .. 20000.
    warmer : float
        Than standard, K.

    Returns
    -------
    Air
        temperature (K), pressure (Pa), density (kg/m^3), speed_of_sound (m/s).

    Raises
    ------
    InputError
        An altitude outside that range.

    References
    ----------
    U.S. Standard Atmosphere 1976 (the same as ISO 2533 up to there).

    Examples
    --------
    >>> air = symheli.environment.standard_atmosphere(2000.0)
    >>> round(air.density, 3), round(air.temperature, 2)
    (1.007, 275.15)
    """
    altitude = finite(altitude, "altitude", "m")
    if not (-2000.0 <= altitude <= CEILING):
        raise InputError(
            f"altitude: expected -2000 .. {CEILING:.0f} m above sea level, got {altitude}; feet"
            " times 0.3048 are metres"
        )
    height = EARTH_RADIUS * altitude / (EARTH_RADIUS + altitude)
    low = min(height, TROPOPAUSE)
    temperature = SEA_LEVEL_TEMPERATURE + LAPSE_RATE * low
    pressure = SEA_LEVEL_PRESSURE * (temperature / SEA_LEVEL_TEMPERATURE) ** (
        -GRAVITY / (GAS_CONSTANT * LAPSE_RATE)
    )
    pressure *= math.exp(-GRAVITY * (height - low) / (GAS_CONSTANT * temperature))
    temperature += warmer
    if not temperature > 0:
        raise InputError(f"warmer: {warmer} K leaves a temperature of {temperature:g} K")
    return Air(
        temperature,
        pressure,
        pressure / (GAS_CONSTANT * temperature),
        math.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature),
    )
