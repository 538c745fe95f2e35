"""Exact linear models over airspeed and climb rate, air density, altitude, mass or rotor speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_grid import LinearGrid
from symheli.steady.airspeed_sweep import sweep
from symheli.values.signal import Signal

AXES = {
    "climb_rate": Signal("climb_rate", "m/s"),
    "density": Signal("density", "kg/m^3"),
    "altitude": Signal("altitude", "m"),
    "mass": Signal("mass", "kg"),
    "rotor_speed": Signal("rotor_speed", "rad/s"),
}
PARAMETER = {"density": "density", "mass": "body.mass", "rotor_speed": "drivetrain.nominal_speed"}
"""Which of the helicopter's parameters an axis changes; the inertias stay when the mass changes."""


def sweep_grid(
    heli: Helicopter,
    airspeeds: Sequence[float],
    *,
    climb_rate: Sequence[float] | None = None,
    density: Sequence[float] | None = None,
    altitude: Sequence[float] | None = None,
    mass: Sequence[float] | None = None,
    rotor_speed: Sequence[float] | None = None,
    inputs: Sequence[str] | None = None,
) -> LinearGrid:
    """`sweep` for every value of one more axis, increasing: sweep_grid(heli, speeds, mass=[7.0,
    8.2, 9.5]).

    climb_rate in m/s, density in kg/m^3, altitude in m of the standard atmosphere, mass in kg (the
    inertias stay), rotor_speed in rad/s. Trims start from those of the neighbouring value, and
    nothing is compiled anew. Raises `TrimError`, `InputError`.
    """
    asked = {
        "climb_rate": climb_rate,
        "density": density,
        "altitude": altitude,
        "mass": mass,
        "rotor_speed": rotor_speed,
    }
    given = {name: values for name, values in asked.items() if values is not None}
    if len(given) != 1:
        raise InputError(
            f"sweep_grid needs exactly one of {', '.join(AXES)}; got {', '.join(given) or 'none'}"
        )
    ((name, values),) = given.items()
    grid = np.atleast_1d(np.asarray(values, float))
    families: list[LinearFamily] = []
    for value in grid.tolist():
        near = families[-1] if families else None
        climb = value if name == "climb_rate" else 0.0
        families.append(
            sweep(
                _variant(heli, name, value), airspeeds, climb_rate=climb, inputs=inputs, start=near
            )
        )
    return LinearGrid(AXES[name], grid, tuple(families))


def _variant(heli: Helicopter, name: str, value: float) -> Helicopter:
    if name == "altitude":
        return heli.at_altitude(value)
    return heli.with_parameters({PARAMETER[name]: value}) if name in PARAMETER else heli
