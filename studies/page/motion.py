"""Attitude and path of a vehicle as its samples come, for a picture in three dimensions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from studies.live.earth import earth_velocity, turn_rate

Vector = tuple[float, float, float]

APART = 0.5
"""Distance of two points of the path, m, at first; it doubles whenever there are `MOST`."""
MOST = 400
GAP = 1.0
"""Seconds between two samples above which the way between them is not known."""


class Motion(NamedTuple):
    """A vehicle at a time (s): attitude (rad), airspeed (m/s), position and path (m) from where the
    first sample came, east, north, up.
    """

    time: float
    phi: float
    theta: float
    psi: float
    airspeed: float
    position: Vector
    path: tuple[Vector, ...]

    @property
    def rotation(self) -> list[list[float]]:
        """Matrix (3, 3) from axes ahead, left, up of the vehicle to east, north, up."""
        angles = self.phi, self.theta, self.psi
        ahead, left, up = (
            earth_velocity(u, v, w, *angles) for u, v, w in ((1, 0, 0), (0, -1, 0), (0, 0, -1))
        )
        columns = [(east, north, -down) for north, east, down in (ahead, left, up)]
        return [list(row) for row in zip(*columns, strict=True)]

    @property
    def words(self) -> str:
        """One line for a reader."""
        degrees = (math.degrees(angle) for angle in (self.phi, self.theta, self.psi % math.tau))
        bank, pitch, heading = (f"{angle:.0f} deg" for angle in degrees)
        up = self.position[2]
        return (
            f"{self.time:.1f} s; airspeed {self.airspeed:.1f} m/s; bank {bank}; pitch {pitch};"
            f" heading {heading}; {abs(up):.1f} m {'above' if up >= 0 else 'below'} the start"
        )


class Track:
    """The way that a vehicle has come: each sample adds to it.

    Velocities are those of the samples, over ground or through the air as the source has them. A
    source without a heading is turned by its rates.
    """

    def __init__(self) -> None:
        self._last: tuple[float, tuple[float, float, float]] | None = None
        self._psi, self._apart = 0.0, APART
        self._position: Vector = (0.0, 0.0, 0.0)
        self._path: list[Vector] = [self._position]
        self.motion: Motion | None = None

    def add(self, time: float, values: Mapping[str, float]) -> None:
        """Take in the values of a sample at `time` (s); one without a finite attitude is left
        out, and the way over more than `GAP`.
        """
        phi, theta = (values.get(name, math.nan) for name in ("phi", "theta"))
        u, v, w = (values.get(name, math.nan) for name in "uvw")
        if not all(map(math.isfinite, (time, phi, theta, u, v, w))):
            return
        step = math.nan if self._last is None else time - self._last[0]
        known = 0.0 < step <= GAP
        self._turn(values, phi, theta, step if known else 0.0)
        north, east, down = earth_velocity(u, v, w, phi, theta, self._psi)
        now = (east, north, -down)
        if known and self._last is not None:
            ways = zip(self._position, now, self._last[1], strict=True)
            x, y, z = (at + 0.5 * step * (v + before) for at, v, before in ways)
            self._position = (x, y, z)
            self._extend()
        self._last = time, now
        airspeed = values.get("airspeed", math.nan)
        self.motion = Motion(time, phi, theta, self._psi, airspeed, self._position, ())

    def shown(self) -> Motion | None:
        """Return the motion with its path; None before the first sample."""
        return None if self.motion is None else self.motion._replace(path=tuple(self._path))

    def _turn(self, values: Mapping[str, float], phi: float, theta: float, step: float) -> None:
        psi = values.get("psi", math.nan)
        q, r = values.get("q", math.nan), values.get("r", math.nan)
        if math.isfinite(psi):
            self._psi = psi
        elif math.isfinite(q + r):
            self._psi += step * turn_rate(q, r, phi, theta)

    def _extend(self) -> None:
        if math.dist(self._position, self._path[-1]) < self._apart:
            return
        self._path.append(self._position)
        if len(self._path) > MOST:
            del self._path[1::2]
            self._apart *= 2.0
