"""Equipment of a helicopter for its flights: controller, sensors, servos and the delay before them,
as numbers for a clock.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from symheli.flight.course import Clock
from symheli.flight.plan import READ, FlightPlan
from symheli.flight.sensor import Sensor
from symheli.flight.servo import ServoBank
from symheli.helicopter import Helicopter
from symheli.values.arrays import Array
from symheli.values.controllers import PureController, StatefulController
from symheli.values.kinematics import INPUTS

MAX_STEPS = 2**40
"""Number of steps that no flight reaches."""


@dataclass(frozen=True, eq=False)
class Readings:
    """Sensors of the measured states and the airspeed: noise, bias, quantum (9,) in the unit of
    each, delay and period (9,) in samples.
    """

    noise: Array
    bias: Array
    quantum: Array
    delay: Array
    period: Array

    @classmethod
    def of(cls, sensors: Mapping[str, Sensor], dt: float) -> Readings:
        """A signal without a sensor is read as it is."""
        bank = [sensors.get(name, Sensor()) for name in READ]
        noise, bias, quantum = (
            np.array([getattr(s, name) for s in bank]) for name in ("noise", "bias", "quantum")
        )
        delay, period = (
            np.array([_whole(getattr(s, name), dt) for s in bank], dtype=np.int_)
            for name in ("delay", "period")
        )
        return cls(noise, bias, quantum, delay, np.maximum(period, 1))


@dataclass(frozen=True, eq=False)
class Equipment:
    """Equipment common to all flights of one campaign; `late` counts integration steps."""

    controller: PureController | StatefulController
    readings: Readings
    servos: ServoBank | None
    late: int
    travel: Array

    @classmethod
    def of(
        cls,
        heli: Helicopter,
        clock: Clock,
        controller: PureController | StatefulController,
        plan: FlightPlan,
    ) -> Equipment:
        """Return the equipment of a plan."""
        servos = plan.actuation.servos
        return cls(
            controller,
            Readings.of(plan.sensors or {}, clock.dt),
            None if servos is None else ServoBank(servos, INPUTS, heli.travel, clock.step),
            _whole(plan.delay, clock.step),
            np.ascontiguousarray(heli.travel, float),
        )


def _whole(seconds: float, step: float) -> int:
    """Steps that last so long, rounded up; more than any flight has where that is very long."""
    return min(math.ceil(min(seconds / step, MAX_STEPS) - 1e-9), MAX_STEPS)
