"""What a sensor makes of a signal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError, UnknownNameError


@dataclass(frozen=True)
class Sensor:
    """Measured = true value some time ago, sampled and held, plus bias plus white noise, rounded.

    Delay and period act in whole control samples, rounded up. Before the first sample the value at
    the start is read.

    Parameters
    ----------
    noise : float
        Standard deviation, in the signal's own unit (SI, rad).
    bias : float
        In that unit.
    period : float
        s; 0: every control sample.
    delay : float
        s.
    quantum : float
        In the signal's unit; 0: not rounded.

    Raises
    ------
    InputError
        A negative or infinite number.

    Examples
    --------
    >>> gyro = symheli.Sensor(noise=0.002, delay=0.02, quantum=1e-4)
    >>> slow = symheli.AirspeedSchedule.transition(4.0, 5.0, acceleration=1.0, hold=0.5)
    >>> len(symheli.fly(heli, slow, sensors={"q": gyro}))
    307
    """

    noise: float = 0.0
    bias: float = 0.0
    period: float = 0.0
    delay: float = 0.0
    quantum: float = 0.0

    def __post_init__(self) -> None:
        for name in ("noise", "period", "delay", "quantum"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(
                    f"{name}: expected a finite number >= 0, got {getattr(self, name)}"
                )
        if not math.isfinite(self.bias):
            raise InputError(f"bias: expected a finite number, got {self.bias}")

    def sources(self, samples: int, dt: float) -> np.ndarray:
        """Index (samples,) of the sample read at each instant, `dt` s apart."""
        delay, period = (math.ceil(seconds / dt - 1e-9) for seconds in (self.delay, self.period))
        read = np.maximum(np.arange(samples) - delay, 0)
        return read - read % max(period, 1)


class SensorBank:
    """The sensors of several signals over a flight of `samples` instants `dt` s apart, with noise
    drawn from `seed`.
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        signals: Sequence[str],
        samples: int,
        dt: float,
        seed: int,
    ):
        """A signal without a sensor is read as it is."""
        for name in sensors:
            if name not in signals:
                raise UnknownNameError("measured signal", name, signals)
        bank = [sensors.get(name, Sensor()) for name in signals]
        white = np.random.default_rng(seed).standard_normal((samples, len(bank)))
        self._sources = np.column_stack([s.sources(samples, dt) for s in bank])
        self._columns = np.arange(len(bank))
        # one reading is one draw, held as long as the reading is
        drawn = white[self._sources, self._columns]
        self._offsets = np.array([s.bias for s in bank]) + np.array([s.noise for s in bank]) * drawn
        self._quanta = np.array([s.quantum for s in bank])

    def read(self, k: int, history: np.ndarray) -> np.ndarray:
        """Readings (n,) at instant k from the true values (samples, n), of which those after k are
        not looked at.
        """
        reading = history[self._sources[k], self._columns] + self._offsets[k]
        coarse = self._quanta > 0
        reading[coarse] = np.round(reading[coarse] / self._quanta[coarse]) * self._quanta[coarse]
        return reading
