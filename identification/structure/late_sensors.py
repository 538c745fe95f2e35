"""Sensors that read what was true some time ago."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.records.shifted import shifted

LATE = ("p", "q", "r", "phi", "theta")


@dataclass(frozen=True)
class LateSensors:
    """Signals that come later than the others, by one time: filters of an autopilot, a bus.

    Parameters
    ----------
    delay : float
        s: measured(t) = true(t - delay).
    deviation : float
        Standard deviation of the delay, s; 0: known.
    signals : tuple of str
        Which; default the rates, and roll and pitch.

    Raises
    ------
    InputError
        A number that is not finite, or a negative deviation.

    Examples
    --------
    >>> time = 0.02 * np.arange(200)
    >>> late = FlightRecord.from_arrays(time, {"q": "rad/s"}, q=np.sin(3.0 * (time - 0.05)))
    >>> true = idn.structure.LateSensors(delay=0.05, signals=("q",)).along(late)
    >>> bool(np.abs(true["q"] - np.sin(3.0 * time))[:190].max() < 1e-5)
    True
    """

    delay: float = 0.0
    deviation: float = 0.0
    signals: tuple[str, ...] = LATE

    def __post_init__(self) -> None:
        if not (
            math.isfinite(self.delay) and math.isfinite(self.deviation) and self.deviation >= 0
        ):
            raise InputError(
                "sensors: expected a finite delay and a deviation >= 0 s, got"
                f" {self.delay!r}, {self.deviation!r}"
            )
        object.__setattr__(self, "signals", tuple(self.signals))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Unknowns that are estimated: "delay" (s)."""
        return ("delay",) if self.deviation else ()

    def moved(self, z: Sequence[float]) -> LateSensors:
        """Return these at `z` in the prior deviation of the delay from its given value."""
        return replace(self, delay=self.delay + self.deviation * sum(z))

    def found(self, z: Sequence[float], deviations: Sequence[float]) -> dict[str, Estimate]:
        """Delay and its standard deviation, s, at `z` with `deviations`, both in prior
        deviations.
        """
        if not self.deviation:
            return {}
        return {"delay": (self.moved(z).delay, self.deviation * float(deviations[0]))}

    def settled(self, estimates: dict[str, Estimate]) -> LateSensors:
        """Return these with the estimated delay in place of the given one, as a known one."""
        delay, _ = estimates.get("delay", (self.delay, 0.0))
        return replace(self, delay=delay, deviation=0.0)

    def along(self, record: FlightRecord) -> FlightRecord:
        """The record with its late signals where they belong in time, between samples by cubic
        splines; NaN where what was true then is not in the record.
        """
        return shifted(record, dict.fromkeys(self.signals, self.delay))


Estimate = tuple[float, float]
