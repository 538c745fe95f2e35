"""A steady wind in which a flight took place: velocity through the air from that over ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array

VELOCITY = ("u", "v", "w")


@dataclass(frozen=True)
class SteadyWind:
    """A horizontal wind that does not change: what acts is the velocity over ground less the wind,
    turned by heading, pitch and roll into the axes of the body.

    Parameters
    ----------
    north, east : float
        Where it blows to, m/s: known, or the best guess.
    deviation : float
        Standard deviation of each, m/s; 0: known.
    heading : str
        Signal of the heading, rad.
    over_ground : str, optional
        Scheduling parameter that is a speed over ground along the heading, as a commanded one, m/s:
        the coefficients move with it less the wind. None: all are of the air.

    Raises
    ------
    InputError
        A number that is not finite, or a negative deviation.

    Examples
    --------
    >>> wind = idn.structure.SteadyWind(north=-5.0, east=0.0)
    >>> turned = wind.in_body(np.zeros(2), np.zeros(2), np.array([0.0, np.pi]))
    >>> print(turned.round(3) + 0.0)
    [[-5.  0.  0.]
     [ 5.  0.  0.]]
    """

    north: float = 0.0
    east: float = 0.0
    deviation: float = 0.0
    heading: str = "psi"
    over_ground: str | None = None

    def __post_init__(self) -> None:
        if not all(math.isfinite(v) for v in (self.north, self.east, self.deviation)):
            raise InputError(
                "wind: expected finite numbers of m/s, got"
                f" {self.north!r}, {self.east!r}, {self.deviation!r}"
            )
        if self.deviation < 0:
            raise InputError(f"deviation: expected m/s >= 0, got {self.deviation!r}")

    @property
    def unknown(self) -> tuple[str, ...]:
        """Unknowns that are estimated: "north" and "east" (m/s)."""
        return ("north", "east") if self.deviation else ()

    def moved(self, z: Sequence[float]) -> SteadyWind:
        """Return the wind at `z` in its prior deviations from its guess."""
        north, east = z if self.deviation else (0.0, 0.0)
        return replace(
            self,
            north=self.north + self.deviation * north,
            east=self.east + self.deviation * east,
        )

    def found(self, z: Sequence[float], deviations: Sequence[float]) -> dict[str, Estimate]:
        """Value and standard deviation of what is estimated, at `z` with `deviations`, both in
        prior deviations.
        """
        at = self.moved(z)
        sizes = (self.deviation * float(d) for d in deviations)
        return dict(zip(self.unknown, zip((at.north, at.east), sizes, strict=True), strict=False))

    def settled(self, estimates: dict[str, Estimate]) -> SteadyWind:
        """Return this with estimated values in place of the guess, as known ones."""
        values = {name: value for name, (value, _) in estimates.items()}
        return replace(self, deviation=0.0, **values)

    def in_body(self, phi: Array, theta: Array, psi: Array) -> Array:
        """The wind (n, 3) in the axes of the body, m/s, at roll, pitch and heading (n,)."""
        ahead = self.north * np.cos(psi) + self.east * np.sin(psi)
        right = self.east * np.cos(psi) - self.north * np.sin(psi)
        return np.column_stack(
            [
                ahead * np.cos(theta),
                ahead * np.sin(theta) * np.sin(phi) + right * np.cos(phi),
                ahead * np.sin(theta) * np.cos(phi) - right * np.sin(phi),
            ]
        )

    def along(self, record: FlightRecord) -> FlightRecord:
        """The record with `u_air`, `v_air`, `w_air`, and its speed over ground through the air as
        `<name>_air`; raises `UnknownNameError` for a signal it lacks.
        """
        wind = self.in_body(record["phi"], record["theta"], record[self.heading])
        names = tuple(map(of_air, VELOCITY))
        columns = dict(zip(names, (record.columns(VELOCITY) - wind).T, strict=True))
        if self.over_ground is not None:
            psi = record[self.heading]
            ahead = self.north * np.cos(psi) + self.east * np.sin(psi)
            columns[of_air(self.over_ground)] = record[self.over_ground] - ahead
        return record.with_signals(dict.fromkeys(columns, "m/s"), **columns)


Estimate = tuple[float, float]


def of_air(name: str) -> str:
    """Return the name of a velocity through the air."""
    return f"{name}_air"
