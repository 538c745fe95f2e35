"""Exact linear models over airspeed and acceleration, climb rate, air density, altitude, mass or
rotor speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.lpv.linear_family import AIRSPEED, LinearFamily
from symheli.steady.airspeed_sweep import increasing
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.linearization import linear_models
from symheli.steady.steady_flights import SteadyFlights
from symheli.steady.trim_batch import hover, one_after_another, trimmed, warn_of_trims
from symheli.values.arrays import Array
from symheli.values.signal import Signal

AXES = {
    "acceleration": Signal("acceleration", "m/s^2"),
    "climb_rate": Signal("climb_rate", "m/s"),
    "density": Signal("density", "kg/m^3"),
    "altitude": Signal("altitude", "m"),
    "mass": Signal("mass", "kg"),
    "rotor_speed": Signal("rotor_speed", "rad/s"),
}
PARAMETER = {"density": "density", "mass": "body.mass", "rotor_speed": "drivetrain.nominal_speed"}
"""Which of the helicopter's parameters an axis changes; the inertias stay when the mass changes."""
CONDITION = {"acceleration", "climb_rate"}
"""Axes that are part of the flight condition."""


def sweep_grid(
    heli: Helicopter,
    airspeeds: Sequence[float] | Array,
    *,
    acceleration: Sequence[float] | Array | None = None,
    climb_rate: Sequence[float] | None = None,
    density: Sequence[float] | None = None,
    altitude: Sequence[float] | None = None,
    mass: Sequence[float] | None = None,
    rotor_speed: Sequence[float] | None = None,
    inputs: Sequence[str] | None = None,
) -> LinearFamily:
    """Run `sweep` at every combination of the values of one or more further axes.

    Parameters
    ----------
    heli : Helicopter
    airspeeds : sequence of float
        m/s, increasing.
    acceleration : sequence of float, optional
        m/s^2, horizontal, along the nose: quasi-steady trims, linearized there.
    climb_rate, density, altitude, mass, rotor_speed : sequence of float, optional
        m/s; kg/m^3; m of the standard atmosphere; kg (the inertias stay); rad/s. Increasing.
    inputs : sequence of str, optional
        As in `linearize`.

    Returns
    -------
    LinearFamily
        Axes: airspeed, then those given, in the order above. Trims start from those of the
        neighbouring value, and nothing is compiled anew.

    Raises
    ------
    TrimError
        Where a point cannot be trimmed.
    InputError
        No axis, values that do not increase, density and altitude both.

    Warns
    -----
    ValidityWarning
        The equations are not known to hold at all of them, once for all.

    Examples
    --------
    >>> import symheli
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> grid = symheli.steady.sweep_grid(heli, [3.0, 8.0], mass=[7.0, 8.2, 9.5])
    >>> grid.A.shape
    (2, 3, 10, 10)
    """
    requested = {
        "acceleration": acceleration,
        "climb_rate": climb_rate,
        "density": density,
        "altitude": altitude,
        "mass": mass,
        "rotor_speed": rotor_speed,
    }
    given = {
        name: np.atleast_1d(np.asarray(values, float)).tolist()
        for name, values in requested.items()
        if values is not None
    }
    if not given:
        raise InputError(f"sweep_grid needs one of {', '.join(AXES)}; for airspeed alone use sweep")
    if "density" in given and "altitude" in given:
        raise InputError("density and altitude are one axis: give one of them")
    speeds = increasing(airspeeds)
    points = [dict(zip(given, point, strict=True)) for point in product(*given.values())]
    helis = [_variant(heli, values) for values in points]
    each = np.repeat(np.arange(len(points)), len(speeds))
    requested = {
        name: np.array([values[name] for values in points])[each]
        for name in CONDITION & given.keys()
    }
    flights = SteadyFlights(
        helis, each, FlightConditions(np.tile(speeds, len(points)), **requested)
    )
    shape = [len(values) for values in given.values()]
    trims = trimmed(flights, hover(flights), _after_neighbours(shape, len(speeds)))
    warn_of_trims(flights, trims)
    airspeed_first = np.arange(len(flights)).reshape(len(points), -1).T.ravel()
    return LinearFamily(
        (AIRSPEED, *(AXES[name] for name in given)),
        (speeds, *map(np.asarray, given.values())),
        linear_models(flights[airspeed_first], trims[airspeed_first], inputs),
    )


def _after_neighbours(shape: Sequence[int], speeds: int) -> Array:
    """Return the trim from which each of a grid is started, airspeed running fastest: the first
    values of the other axes one after another, the others from the neighbouring value.
    """
    after = [one_after_another(speeds)]
    for k, position in enumerate(np.ndindex(*shape)):
        if k:
            moved = max(axis for axis, i in enumerate(position) if i)  # one back along this axis
            neighbour = [i - (axis == moved) for axis, i in enumerate(position)]
            after.append(np.ravel_multi_index(neighbour, shape) * speeds + np.arange(speeds))
    return np.concatenate(after)


def _variant(heli: Helicopter, values: dict[str, float]) -> Helicopter:
    if "altitude" in values:
        heli = heli.at_altitude(values["altitude"])
    changed = {PARAMETER[name]: v for name, v in values.items() if name in PARAMETER}
    return heli.with_parameters(changed) if changed else heli
