"""The family of exact linear models along a range of airspeeds, and where it has corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symheli.errors import InputError
from symheli.helicopter import Helicopter, require
from symheli.lpv.linear_family import LinearFamily
from symheli.steady.equilibrium import Equilibrium
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.kinks import kink_speeds
from symheli.steady.linearization import linear_models
from symheli.steady.steady_flights import ALONE, SteadyFlights
from symheli.steady.trim_batch import (
    TrimBatch,
    hover,
    one_after_another,
    trimmed,
    warn_of_trims,
)
from symheli.values.arrays import Array


def sweep(
    heli: Helicopter,
    airspeeds: Sequence[float] | Array,
    *,
    climb_rate: float = 0.0,
    acceleration: float = 0.0,
    wind: Sequence[float] | Array = (0.0, 0.0, 0.0),
    inputs: Sequence[str] | None = None,
    start: LinearFamily | None = None,
) -> LinearFamily:
    """Trim and linearize at each of several airspeeds, each trim started from the previous one.

    Parameters
    ----------
    heli : Helicopter
        The model.
    airspeeds : sequence of float
        Increasing, m/s.
    climb_rate : float
        m/s, up.
    acceleration : float
        m/s^2, horizontal, along the nose: quasi-steady points of an accelerating flight.
    wind : (float, float, float)
        North, east, down as seen by a nose pointing north, m/s: the same at every airspeed.
    inputs : sequence of str, optional
        As in `linearize`.
    start : LinearFamily, optional
        A family at the same airspeeds whose trims are near, to start from instead.

    Returns
    -------
    LinearFamily
        Its `kinks` list, by cause, the airspeeds between the first and the last at which the linear
        models have a corner (a wake edge, a limit, a flow reversal).

    Raises
    ------
    TrimError
        No equilibrium at one of them.
    InputError
        Airspeeds that do not increase.

    Warns
    -----
    ValidityWarning
        The equations are not known to hold at all of them, once for all.

    See Also
    --------
    symheli.linearize : the exact linear model about a trim
    symheli.steady.sweep_grid : linear models over several parameters
    symheli.derivatives : stability and control derivatives

    Examples
    --------
    >>> family = symheli.sweep(heli, [2.0, 5.0, 8.0])
    >>> family.A.shape, len(family.trims)
    ((3, 10, 10), 3)
    """
    require(heli, "sweep(heli, [0.0, 5.0, 10.0])")
    speeds = increasing(airspeeds)
    if start and not np.array_equal(start.over_airspeed("a sweep from a family"), speeds):
        raise InputError("the family to start from has other airspeeds")
    conditions = FlightConditions(
        speeds, climb_rate=climb_rate, acceleration=acceleration, wind=wind
    )
    flights = SteadyFlights.of(heli, conditions)
    if start:
        known = start.known_trims("a sweep from a family")
        problems = [Equilibrium(heli, condition) for condition in conditions]
        points = zip(problems, known, strict=True)
        z, after = np.stack([problem.unknowns_of(point) for problem, point in points]), ALONE
    else:
        z, after = hover(flights), one_after_another(len(flights))
    trims = trimmed(flights, z, after)
    warn_of_trims(flights, trims)
    return _family(flights, trims, inputs)


def design_family(heli: Helicopter, airspeeds: Sequence[float] | Array) -> LinearFamily:
    """Run `sweep` of level flight for a controller, without validity warnings, which the flight
    gives.
    """
    flights = SteadyFlights.of(heli, FlightConditions(increasing(airspeeds)))
    return _family(flights, trimmed(flights, hover(flights), one_after_another(len(flights))))


def _family(
    flights: SteadyFlights, trims: TrimBatch, inputs: Sequence[str] | None = None
) -> LinearFamily:
    models = linear_models(flights, trims, inputs)
    kinks = kink_speeds(flights.helis[0], trims)
    return LinearFamily.from_models(flights.conditions.airspeed, models, kinks)


def increasing(airspeeds: Sequence[float] | Array) -> Array:
    """Airspeeds (K,) of a sweep, m/s."""
    speeds = np.atleast_1d(np.asarray(airspeeds, float))
    if not len(speeds) or np.any(np.diff(speeds) <= 0):
        raise InputError("sweep needs increasing airspeeds")
    return speeds
