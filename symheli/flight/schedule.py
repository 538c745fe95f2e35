"""Commanded airspeed over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError
from symheli.values.drawing import LINE, axes_of, plain
from symheli.values.html_table import as_table
from symheli.values.numbers import whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class AirspeedSchedule:
    """An airspeed schedule joins commands (m/s) over time (s) by half-cosine ramps.

    Parameters
    ----------
    targets : tuple of float
        m/s, one a ramp.
    accelerations : tuple of float
        Peak |dV/dt| with which each is reached, m/s^2.
    holds : tuple of float
        How long each is held, s.
    start : float
        Airspeed at the start, m/s.
    lead : float
        How long that is held, s.

    Raises
    ------
    InputError
        Lists of different lengths, an acceleration that is not positive, a negative speed or time.

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.FlightPlan : all settings of a flight

    Examples
    --------
    >>> there_and_back = symheli.AirspeedSchedule((8.0, 0.0), (2.0, 2.0), (3.0, 3.0))
    >>> airspeed, acceleration = there_and_back([0.0, 10.0])
    >>> airspeed.round(1), round(there_and_back.duration, 1)
    (array([0., 8.]), 20.6)
    """

    targets: tuple[float, ...]
    accelerations: tuple[float, ...]
    holds: tuple[float, ...]
    start: float = 0.0
    lead: float = 2.0

    _repr_html_ = as_table

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the commanded airspeed (m/s) over time (s)."""
        time = np.linspace(0.0, self.duration, 1001)
        ax = axes_of(ax, height=2.8)
        ax.plot(time, self(time)[0], color=LINE)
        ax.set_xlabel("time (s)")
        ax.set_ylabel("commanded airspeed (m/s)")
        return plain(ax)

    def __post_init__(self) -> None:
        if not len(self.targets) == len(self.accelerations) == len(self.holds):
            raise InputError(
                "an airspeed schedule needs as many accelerations and holds as targets"
            )
        numbers = (*self.targets, *self.holds, self.start, self.lead)
        if not all(math.isfinite(n) and n >= 0 for n in numbers) or not all(
            math.isfinite(a) and a > 0 for a in self.accelerations
        ):
            raise InputError(f"airspeeds and holds must be >= 0, accelerations > 0; got {self}")

    @classmethod
    def transition(
        cls,
        low: float = 0.0,
        high: float = 13.0,
        acceleration: float = 3.0,
        hold: float = 3.0,
        laps: int = 1,
    ) -> AirspeedSchedule:
        """low -> high -> low (m/s), `laps` times, with this peak acceleration (m/s^2), held `hold`
        s at each end.
        """
        laps = whole(laps, "laps", 1)
        return cls((high, low) * laps, (acceleration,) * (2 * laps), (hold,) * (2 * laps), low)

    @classmethod
    def varied(
        cls, low: float, high: float, accelerations: Sequence[float], hold: float, seed: int
    ) -> AirspeedSchedule:
        """One ramp an acceleration, alternating between random targets in the lower and upper third
        of [low, high], ends included.
        """
        rng = np.random.default_rng(seed)
        third = (high - low) / 3
        targets = [high, low] + [
            float(low + third * rng.random()) if i % 2 else float(high - third * rng.random())
            for i in range(len(accelerations) - 2)
        ]
        return cls(
            tuple(targets[: len(accelerations)]),
            tuple(accelerations),
            (hold,) * len(accelerations),
            low,
        )

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.lead + sum(
            math.pi * abs(b - a) / (2 * peak) + hold for a, b, peak, hold in self._legs()
        )

    def _legs(self) -> list[tuple[float, float, float, float]]:
        return list(
            zip(
                (self.start, *self.targets[:-1]),
                self.targets,
                self.accelerations,
                self.holds,
                strict=True,
            )
        )

    def __call__(self, time: object) -> tuple[np.ndarray, np.ndarray]:
        """Commanded airspeed (m/s) and its rate (m/s^2) at `time` (n,) s."""
        t = np.asarray(time, float)
        speed, rate = np.full(t.shape, self.start), np.zeros(t.shape)
        begin = self.lead
        for before, after, peak, hold in self._legs():
            ramp = math.pi * abs(after - before) / (2 * peak)
            if ramp > 0:
                s = np.clip((t - begin) / ramp, 0.0, 1.0)
                inside = (t >= begin) & (t <= begin + ramp)
                speed = np.where(
                    t >= begin, before + (after - before) * 0.5 * (1 - np.cos(np.pi * s)), speed
                )
                rate = np.where(
                    inside, (after - before) * 0.5 * np.pi / ramp * np.sin(np.pi * s), rate
                )
            begin += ramp + hold
        return speed, rate
