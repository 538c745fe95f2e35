"""The states and controls a flight is held to: quasi-steady trims along the commanded airspeed."""

from __future__ import annotations

import numpy as np

from symheli.errors import TrimError
from symheli.helicopter import Helicopter
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.steady_flights import SteadyFlights
from symheli.steady.trim_batch import hover, one_after_another, trimmed
from symheli.values.signal import Signal

LARGEST_MISS = 0.3
"""Residual of the accelerations (m/s^2, rad/s^2) a reference may have; feedback makes up for it.
Where the wake factor jumps (flow reversing through the disc) no quasi-steady point is exact.
"""
INTERVAL = 0.1  # s between trims; linear in between


def references(
    heli: Helicopter, time: np.ndarray, speed: np.ndarray, rate: np.ndarray, wind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Quasi-steady states (n, nx) and inputs (n, 4) at `time` (n,) s of the commanded airspeed
    `speed` (n,) m/s and its `rate` (n,) m/s^2 in a steady `wind` (3,), north east down, m/s; q
    follows theta. Raises `TrimError`.
    """
    stride = max(round(INTERVAL / (time[1] - time[0])), 1)
    knots = np.append(np.arange(0, len(time) - 1, stride), len(time) - 1)
    first, which = np.unique(
        np.column_stack([speed, rate])[knots], axis=0, return_index=True, return_inverse=True
    )[1:]
    order = np.sort(first)  # in the order of the flight, each started from one before
    conditions = FlightConditions(speed[knots[order]], acceleration=rate[knots[order]], wind=wind)
    flights = SteadyFlights.of(heli, conditions)
    points = trimmed(flights, hover(flights), one_after_another(len(flights)), throw=False)
    misses = np.abs(points.residual[:, :6]).max(axis=1)
    if misses.max() > LARGEST_MISS:
        worst = int(misses.argmax())
        raise TrimError(
            f"no quasi-steady reference at {speed[knots[order[worst]]]:.1f} m/s,"
            f" {rate[knots[order[worst]]]:.1f} m/s^2 (misses by {misses[worst]:.2g} SI): reduce the"
            " accelerations",
            points[worst],
        )
    at = np.searchsorted(order, first)[which.ravel()]

    def spread(values: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(time, time[knots], column) for column in values[at].T])

    x0, q = spread(points.x), heli.states.index(Signal("q"))
    x0[:, q] = np.gradient(x0[:, heli.states.index(Signal("theta"))], time)
    return x0, spread(points.u)
