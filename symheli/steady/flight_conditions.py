"""The steady flight conditions of many trims, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from symheli.errors import InputError
from symheli.steady.flight_condition import FlightCondition, air_velocity
from symheli.values.arrays import Array, frozen

_NUMBERS = ("airspeed", "climb_rate", "turn_rate", "sideslip", "acceleration")


@dataclass(frozen=True, eq=False)
class FlightConditions(Sequence[FlightCondition]):
    """N flight conditions, each as `FlightCondition` describes one.

    Parameters
    ----------
    airspeed, climb_rate, turn_rate, sideslip, acceleration : array (N,)
        m/s, m/s, rad/s, rad, m/s^2; a number is one for all.
    wind : array (N, 3)
        m/s; (3,) is one for all.
    altitude : array (N,), optional
        m.

    Raises
    ------
    InputError
        Lengths that differ, or an invalid flight condition.
    """

    airspeed: Array
    climb_rate: Array | float = 0.0
    turn_rate: Array | float = 0.0
    sideslip: Array | float = 0.0
    wind: Any = (0.0, 0.0, 0.0)
    acceleration: Array | float = 0.0
    altitude: Array | float | None = None

    def __post_init__(self) -> None:
        names = [*_NUMBERS, *(["altitude"] if self.altitude is not None else [])]
        given = {name: np.asarray(getattr(self, name), float) for name in names}
        wind = np.asarray(self.wind, float)
        lengths = {a.shape for a in given.values() if a.ndim} | {wind.shape[:-1]} - {()}
        if len(lengths) > 1 or any(len(shape) != 1 for shape in lengths):
            sizes = ", ".join(f"{name} {a.shape}" for name, a in given.items() if a.ndim)
            raise InputError(
                "flight conditions: expected numbers, or arrays of one length N (wind (N, 3)), got"
                f" {sizes}, wind {wind.shape}"
            )
        shape = next(iter(lengths), (1,))
        if wind.shape[-1:] != (3,):
            raise InputError(f"wind: expected shape (3,) or (N, 3), got {wind.shape}")
        for name, array in given.items():
            object.__setattr__(self, name, _shared(array, name, shape))
        object.__setattr__(self, "wind", _shared(wind, "wind", (*shape, 3)))
        wrong = (self.airspeed < 0) | (np.abs(self.climb_rate) > self.airspeed)
        wrong |= (self.turn_rate != 0) & np.any(self.wind != 0, axis=1)
        if wrong.any():
            self[int(wrong.argmax())]  # says what is wrong with it

    def __len__(self) -> int:
        return len(self.airspeed)

    @overload
    def __getitem__(self, k: int) -> FlightCondition: ...
    @overload
    def __getitem__(self, k: slice | Array) -> FlightConditions: ...
    def __getitem__(self, k: int | slice | Array) -> FlightCondition | FlightConditions:
        """The condition at a position, or those of a slice, a mask (N,) or positions."""
        if isinstance(k, slice | np.ndarray):
            chosen = {name: getattr(self, name)[k] for name in (*_NUMBERS, "wind")}
            altitude = None if self.altitude is None else np.asarray(self.altitude)[k]
            return FlightConditions(**chosen, altitude=altitude)
        airspeed, *others = (float(getattr(self, name)[k]) for name in _NUMBERS)
        return FlightCondition(
            airspeed,
            **dict(zip(_NUMBERS[1:], others, strict=True)),
            wind=tuple(self.wind[k].tolist()),
            altitude=None if self.altitude is None else float(np.asarray(self.altitude)[k]),
        )

    @property
    def demand(self) -> Array:
        """Right-hand side of the equations of steady flight (N, 8), by `DEMAND`."""
        return np.column_stack(
            [
                air_velocity(self.airspeed, self.climb_rate, self.sideslip),
                self.turn_rate,
                self.wind,
                self.acceleration,
            ]
        )


def _shared(array: Array, name: str, shape: tuple[int, ...]) -> Array:
    return frozen(np.broadcast_to(array, shape), name)
