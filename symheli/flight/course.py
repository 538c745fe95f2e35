"""Reference trajectory and sampling of a flight: commanded airspeed, trims, time steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.flight.plan import FlightPlan
from symheli.flight.reference import references
from symheli.helicopter import Helicopter
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period

INTEGRATION_STEP = (
    0.005  # s; the error over a flight stays below 1e-5 of each state's peak (see tests)
)
MAX_SAMPLES = 1e9
"""Largest number of samples of a flight: half a year at 50 Hz, beyond the memory of any record."""


@dataclass(frozen=True)
class Clock:
    """Samples of the record, `every` control periods of `dt` seconds each, of `substeps` steps."""

    dt: float
    every: int
    substeps: int

    @classmethod
    def of(cls, plan: FlightPlan, dt: float) -> Clock:
        """The clock of a plan whose controller works every `dt` seconds."""
        every = round(plan.dt / dt)
        period = plan.dt / max(every, 1)
        if not same_period(period, dt):
            raise InputError(
                f"the controller was designed for {dt:g} s, the record is sampled every"
                f" {plan.dt:g} s: dt must be a whole multiple of the controller's"
            )
        return cls(period, every, math.ceil(period / INTEGRATION_STEP - 1e-9))

    @property
    def step(self) -> float:
        """Integration step, s."""
        return self.dt / self.substeps

    def samples(self, plan: FlightPlan) -> int:
        """Control samples of a plan: those whose record sample is complete; raises `InputError` for
        more than `MAX_SAMPLES`.
        """
        count = plan.schedule.duration / plan.dt * self.every
        if not count <= MAX_SAMPLES:
            raise InputError(
                f"a flight of {plan.schedule.duration:.3g} s takes {count:.3g} samples, more than"
                f" {MAX_SAMPLES:.0e}: fly a shorter schedule"
            )
        return math.floor(plan.schedule.duration / plan.dt + 1e-9) * self.every


@dataclass(frozen=True, eq=False)
class Course:
    """Along n control samples: time (s), airspeed and acceleration commanded `p` (n, 2), trim
    states and inputs `reference` (n, nx + 4).
    """

    time: Array
    p: Array
    reference: Array

    @classmethod
    def of(cls, heli: Helicopter, plan: FlightPlan, clock: Clock) -> Course:
        """Raises `TrimError` where there is no trim to be held to."""
        time = clock.dt * np.arange(clock.samples(plan))
        speed, rate = plan.schedule(time)
        acceleration = rate if plan.trims == "quasi-steady" else np.zeros_like(rate)
        x0, u0 = references(heli, time, speed, acceleration, np.array(plan.wind.steady))
        return cls(time, np.column_stack([speed, rate]), np.hstack([x0, u0]))
