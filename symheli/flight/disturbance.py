"""What chance and the plan bring into one flight: noise of the sensors, wind, excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.dynamics import INPUTS
from symheli.flight.course import Course
from symheli.flight.equipment import Readings
from symheli.flight.plan import FlightPlan
from symheli.values.arrays import Array


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Over n control samples: wind (n, 3) north east down, m/s, one row where it is steady;
    `added` to the inputs (n, 4), rad, or one row of zeros; standard normal numbers of the measured
    states `white` (n, 8) and the airspeed `white_air` (n,), None where nothing is noisy.
    """

    wind: Array
    added: Array
    white: Array | None
    white_air: Array | None

    @classmethod
    def of(cls, plan: FlightPlan, course: Course, readings: Readings) -> Disturbance:
        """The same for the same seeds, whatever else flies."""
        n = len(course.time)
        wind = (
            np.array([plan.wind.steady], float)
            if plan.wind.is_steady
            else plan.wind.history(course.time, course.p[:, 0])
        )
        rng = np.random.default_rng(plan.seed)
        white = rng.standard_normal((n, 8)) if readings.noise[:8].any() else None
        apart = np.random.default_rng((plan.seed, 1))
        white_air = apart.standard_normal(n) if readings.noise[8] else None
        return cls(wind, excitation_of(plan, course), white, white_air)


def excitation_of(plan: FlightPlan, course: Course) -> Array:
    """Added to the inputs (n, 4), rad; one row of zeros without excitation."""
    if plan.excitation is None:
        return np.zeros((1, len(INPUTS)))
    signals = plan.excitation(course.time)
    out = np.zeros((len(course.time), len(INPUTS)))
    for i, name in enumerate(INPUTS):
        if name in signals:
            out[:, i] = signals[name]
    return out
