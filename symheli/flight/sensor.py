"""Sensors: delay, sampling, bias, noise and quantization of a signal."""

from __future__ import annotations

import math
from dataclasses import dataclass

from symheli.errors import InputError


@dataclass(frozen=True)
class Sensor:
    """A sensor reads the true value some time ago, sampled and held, plus bias plus white noise,
    rounded.

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

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.Servo : lag, travel and rate of an actuator

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
