"""The steady flight condition of a trim."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.numbers import finite
from symheli.values.signal import signals

NUMBERS = {
    "airspeed": "m/s",
    "climb_rate": "m/s",
    "turn_rate": "rad/s",
    "sideslip": "rad",
    "acceleration": "m/s^2",
    "altitude": "m",
}
"""Unit of each number of a flight condition."""

DEMAND = signals(
    ("forward", "right", "down", "turn_rate", "wind_n", "wind_e", "wind_d", "acceleration"),
    {"forward": "m/s", "right": "m/s", "down": "m/s", "turn_rate": "rad/s"}
    | {"acceleration": "m/s^2"},
)
"""Velocity through the air, turn rate, wind and acceleration a steady flight is to have, by the
axes of the heading.
"""


@dataclass(frozen=True)
class FlightCondition:
    """The flight condition that a trim has to meet.

    Parameters
    ----------
    airspeed : float
        Of the whole motion through the air, climb included, m/s.
    climb_rate : float
        m/s, up.
    turn_rate : float
        rad/s, to the right.
    sideslip : float
        Of the horizontal airspeed, from the right, rad.
    wind : (float, float, float)
        North, east, down as seen by a nose pointing north, m/s.
    acceleration : float
        m/s^2, horizontal, along the nose's heading: a quasi-steady point of an accelerating flight,
        0 for an equilibrium.
    altitude : float, optional
        m in the standard atmosphere; None: in the air of the helicopter.

    Raises
    ------
    InputError
        A negative airspeed, a climb rate beyond it, a turn in wind.

    Examples
    --------
    >>> print(symheli.steady.FlightCondition(5.0, climb_rate=3.0).air_velocity)
    [ 4.  0. -3.]
    """

    airspeed: float
    _: KW_ONLY
    climb_rate: float = 0.0
    turn_rate: float = 0.0
    sideslip: float = 0.0
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    acceleration: float = 0.0
    altitude: float | None = None

    def __post_init__(self) -> None:
        for name, unit in NUMBERS.items():
            if (given := getattr(self, name)) is not None or name != "altitude":
                object.__setattr__(self, name, finite(given, name, unit))
        if np.shape(self.wind) != (3,):
            raise InputError(f"wind: expected (north, east, down) in m/s, got {self.wind!r:.80}")
        wind = tuple(finite(v, "wind", "m/s") for v in self.wind)
        object.__setattr__(self, "wind", wind)
        if abs(self.sideslip) > 2 * math.pi:
            degrees = f"math.radians({self.sideslip:g})"
            raise InputError(
                f"sideslip: expected rad, within a full circle, got {self.sideslip:g}; degrees are"
                f" {degrees}"
            )
        if self.airspeed < 0:
            raise InputError(
                f"airspeed must be >= 0 m/s, got {self.airspeed}; rearward flight is sideslip = pi"
            )
        if abs(self.climb_rate) > self.airspeed:
            raise InputError(
                f"|climb_rate| = {abs(self.climb_rate)} m/s exceeds the airspeed of {self.airspeed}"
                " m/s, which includes it: straight up is airspeed = climb_rate"
            )
        if self.turn_rate and any(self.wind):
            raise InputError("a turn in wind is not steady; trim it in still air")

    @property
    def air_velocity(self) -> np.ndarray:
        """Velocity through the air, forward right down with respect to the heading (3,), m/s."""
        return air_velocity(self.airspeed, self.climb_rate, self.sideslip)

    @property
    def demand(self) -> np.ndarray:
        """Right-hand side of the equations of steady flight (8,), by `DEMAND`."""
        return np.array([*self.air_velocity, self.turn_rate, *self.wind, self.acceleration])

    def __str__(self) -> str:
        words = [f"{self.airspeed:g} m/s"]
        words += (
            [
                f"{'climbing' if self.climb_rate > 0 else 'descending'} at"
                f" {abs(self.climb_rate):g} m/s"
            ]
            if self.climb_rate
            else []
        )
        words += [f"turning at {self.turn_rate:g} rad/s"] if self.turn_rate else []
        words += [f"sideslip {self.sideslip:g} rad"] if self.sideslip else []
        words += ["wind ({:g}, {:g}, {:g}) m/s".format(*self.wind)] if any(self.wind) else []
        words += [f"accelerating at {self.acceleration:g} m/s^2"] if self.acceleration else []
        words += [f"{self.altitude:g} m above sea level"] if self.altitude is not None else []
        return ", ".join(words)


def air_velocity(airspeed: Any, climb_rate: Any, sideslip: Any) -> np.ndarray:
    """Velocity through the air (..., 3), forward right down with respect to the heading, m/s, of
    one flight condition or of arrays of them (m/s, m/s, rad).
    """
    level = np.sqrt(np.maximum(np.square(airspeed) - np.square(climb_rate), 0.0))
    return np.stack(
        [level * np.cos(sideslip), level * np.sin(sideslip), np.negative(climb_rate)], axis=-1
    )
