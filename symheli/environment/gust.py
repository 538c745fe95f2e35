"""A single gust of the shape certification uses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError


@dataclass(frozen=True)
class Gust:
    """A 1-cosine gust: velocity `peak`/2 (1 - cos(2 pi (t - start)/duration)), zero before and
    after.

    Parameters
    ----------
    peak : (float, float, float)
        North, east, down, m/s.
    start, duration : float
        s; `Gust.over` takes the gradient distance instead.

    Raises
    ------
    InputError
        A duration that is not positive, or numbers that are not finite.

    References
    ----------
    EASA CS-25.341 (a full cosine); MIL-F-8785C, 3.7.1.3 is its first half.

    Examples
    --------
    >>> gust = symheli.environment.Gust(peak=(0.0, 3.0, 0.0), start=1.0, duration=2.0)
    >>> gust([0.0, 1.5, 2.0]).round(2)
    array([[0. , 0. , 0. ],
           [0. , 1.5, 0. ],
           [0. , 3. , 0. ]])
    """

    peak: tuple[float, float, float]
    start: float
    duration: float

    def __post_init__(self) -> None:
        if len(self.peak) != 3 or not all(math.isfinite(v) for v in (*self.peak, self.start)):
            raise InputError(
                "a gust needs a finite peak (north, east, down, m/s) and start (s), got"
                f" {self.peak}, {self.start}"
            )
        if not (math.isfinite(self.duration) and self.duration > 0):
            raise InputError(
                f"duration: expected a positive number of seconds, got {self.duration}"
            )

    @classmethod
    def over(
        cls, gradient: float, airspeed: float, peak: tuple[float, float, float], start: float
    ) -> Gust:
        """The gust met at `airspeed` (m/s) that reaches its peak after `gradient` metres of flight
        through the air.
        """
        if not (gradient > 0 and airspeed > 0):
            raise InputError(
                f"expected a gradient distance > 0 m and an airspeed > 0 m/s, got {gradient} and"
                f" {airspeed}"
            )
        return cls(peak, start, 2 * gradient / airspeed)

    def __call__(self, time: object) -> np.ndarray:
        """Velocity (n, 3), north east down, m/s, at `time` (n,) s."""
        phase = (np.asarray(time, float) - self.start) / self.duration
        shape = np.where((phase >= 0) & (phase <= 1), 0.5 * (1 - np.cos(2 * np.pi * phase)), 0.0)
        return shape[:, None] * np.array(self.peak)
