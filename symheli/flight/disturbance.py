"""Disturbances of flights: noise of the sensors, wind, excitation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from symheli.flight.course import Course
from symheli.flight.equipment import Readings
from symheli.flight.plan import FlightPlan
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS


@dataclass(frozen=True, eq=False)
class Disturbances:
    """Disturbances of N flights over n control samples, zeros after the end of each; an axis of
    length 1 is shared.

    wind (N or 1, n or 1, 3) north east down, m/s; `added` to the inputs (N or 1, n or 1, 4), rad;
    standard normal numbers for the measured states `white` (N, n, 8) and for the airspeed
    `white_air` (N, n), None where nothing is noisy.
    """

    wind: Array
    added: Array
    white: Array | None
    white_air: Array | None

    @classmethod
    def of(
        cls, plans: Sequence[FlightPlan], courses: Sequence[Course], readings: Readings
    ) -> Disturbances:
        """Return the disturbances of these plans, the same for the same seeds, independent of the
        other flights.
        """
        longest = max(len(course.time) for course in courses)
        calm = cls(_winds(plans, courses, longest), _excitations(plans, courses), None, None)
        return calm.with_noise(plans, courses, readings)

    def with_noise(
        self, plans: Sequence[FlightPlan], courses: Sequence[Course], readings: Readings
    ) -> Disturbances:
        """Return the same with random numbers for the noisy sensors."""
        shape = len(plans), max(len(course.time) for course in courses)
        white = np.empty((*shape, 8)) if readings.noise[:8].any() else None
        white_air = np.zeros(shape) if readings.noise[8] else None
        for i, (plan, course) in enumerate(zip(plans, courses, strict=True)):
            n = len(course.time)
            if white is not None:
                np.random.default_rng(plan.seed).standard_normal(out=white[i, :n])
                white[i, n:] = 0.0
            if white_air is not None:
                np.random.default_rng((plan.seed, 1)).standard_normal(out=white_air[i, :n])
        return replace(self, white=white, white_air=white_air)


def _winds(plans: Sequence[FlightPlan], courses: Sequence[Course], longest: int) -> Array:
    if all(plan.wind.is_steady for plan in plans):
        steady = np.array([[plan.wind.steady] for plan in plans], float)
        return steady[:1] if (steady == steady[0]).all() else steady
    out = np.zeros((len(plans), longest, 3))
    for row, plan, course in zip(out, plans, courses, strict=True):
        row[: len(course.time)] = plan.wind.history(course.time, course.p[:, 0])
    return out


def _excitations(plans: Sequence[FlightPlan], courses: Sequence[Course]) -> Array:
    first = plans[0].excitation
    if all(p.excitation == first and c is courses[0] for p, c in zip(plans, courses, strict=True)):
        return excitation_of(plans[0], courses[0])[None]
    out = np.zeros((len(plans), max(len(course.time) for course in courses), len(INPUTS)))
    for row, plan, course in zip(out, plans, courses, strict=True):
        row[: len(course.time)] = excitation_of(plan, course)
    return out


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
