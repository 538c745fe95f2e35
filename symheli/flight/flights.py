"""Flights of plans: what plans share is computed once, random numbers are drawn for each flight."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any

import numpy as np

from symheli.codegen import Layout
from symheli.flight.autopilot import gain_scheduled_lqr
from symheli.flight.controller import MEASURED, controller_of
from symheli.flight.course import Clock, Course
from symheli.flight.disturbance import Disturbances
from symheli.flight.equipment import Equipment
from symheli.flight.flight_data import FlightData
from symheli.flight.loops import Changes, LoopResults, Loops
from symheli.flight.plan import READ, FlightPlan
from symheli.helicopter import Helicopter
from symheli.values.arrays import Array
from symheli.values.controllers import PureController, StatefulController

MAX_CACHED_COURSES = 256
"""Largest number of courses that are cached for plans with the same course."""


@dataclass
class Flights:
    """Flights of one helicopter, with a cache of the controllers, courses and equipment that plans
    share.
    """

    heli: Helicopter
    _controllers: dict[Hashable, PureController | StatefulController] = field(default_factory=dict)
    _courses: dict[Hashable, Course] = field(default_factory=dict)
    _equipment: dict[Hashable, Equipment] = field(default_factory=dict)
    _under_way: set[Loops] = field(default_factory=set)
    _stopped: bool = False
    _lock: Any = field(default_factory=Lock)

    def controller(self, plan: FlightPlan) -> PureController | StatefulController:
        """Return the controller of a plan, sampled; an LQR over the commanded airspeeds where it
        names none.
        """
        clock = Clock.of(plan, plan.control_period)
        if plan.controller is not None:
            key: Hashable = (id(plan.controller), clock.dt)
        else:
            speeds = plan.schedule(clock.dt * np.arange(clock.samples(plan)))[0]
            low, high = float(speeds.min()), float(speeds.max())
            key = (low, high, clock.dt, id(plan.servos))
        if key not in self._controllers:
            self._controllers[key] = (
                controller_of(plan.controller, clock.dt)
                if plan.controller is not None
                else gain_scheduled_lqr(
                    self.heli, low, max(high, low + 1.0), clock.dt, servos=plan.servos
                ).scheduled_controller
            )
        return self._controllers[key]

    def clock(self, plan: FlightPlan) -> Clock:
        """Return the clock of a plan; raise `InputError` where the controller's period does not
        divide that of the record.
        """
        return Clock.of(plan, self.controller(plan).dt)

    def course(self, plan: FlightPlan) -> Course:
        """Return the course of a plan; the last ones are cached."""
        key = (plan.schedule, plan.dt, self.clock(plan), plan.wind.steady, plan.trims)
        with self._lock:
            if key not in self._courses:
                self._courses[key] = Course.of(self.heli, plan, self.clock(plan))
                if len(self._courses) > MAX_CACHED_COURSES:
                    del self._courses[next(iter(self._courses))]
            return self._courses[key]

    def equipment(self, plan: FlightPlan) -> Equipment:
        """Return the equipment of a plan; the same object for plans that can fly side by side."""
        key = (id(self.controller(plan)), id(plan.sensors), id(plan.servos), plan.delay, plan.dt)
        if key not in self._equipment:
            controller = self.controller(plan)
            self._equipment[key] = Equipment.of(self.heli, self.clock(plan), controller, plan)
        return self._equipment[key]

    def loops(self, plans: Sequence[FlightPlan], flown: Sequence[Course]) -> Loops:
        """Plans with the same equipment, ready to fly their courses."""
        courses = {id(c): c for c in flown}
        position = {key: i for i, key in enumerate(courses)}
        equipment = self.equipment(plans[0])
        return Loops(
            self.heli,
            self.clock(plans[0]),
            equipment,
            list(courses.values()),
            [position[id(course)] for course in flown],
            Disturbances.of(plans, flown, equipment.readings),
            equipment.readings.noise[None],
            Changes.of(self.heli, [plan.change for plan in plans], self.clock(plans[0]).dt),
        )

    def stop(self) -> None:
        """Stop every running flight at its next sample, and start none."""
        self._stopped = True
        for loops in list(self._under_way):
            loops.stop()

    def _run(self, loops: Loops, layout: Layout) -> LoopResults:
        self._under_way.add(loops)
        try:
            if self._stopped:
                raise KeyboardInterrupt
            return loops.fly(layout)
        finally:
            self._under_way.discard(loops)

    def fly(self, plans: Sequence[FlightPlan], layout: Layout) -> list[FlightData]:
        """Fly plans with the same equipment; where a plan gives its noise in decibels, without
        noise first.
        """
        clock, courses = self.clock(plans[0]), [self.course(plan) for plan in plans]
        loops = self.loops(plans, courses)
        found = self._data(plans, courses, clock, self._run(loops, layout))
        if any(plan.noise_db is not None for plan in plans):
            noise = np.stack([_noise(data) for data in found])
            noisy = replace(loops.equipment.readings, noise=noise.max(axis=0))
            loops.disturbances = loops.disturbances.with_noise(plans, courses, noisy)
            loops.noise = noise
            found = self._data(plans, courses, clock, self._run(loops, layout))
        return found

    def _data(
        self,
        plans: Sequence[FlightPlan],
        courses: Sequence[Course],
        clock: Clock,
        flown: LoopResults,
    ) -> list[FlightData]:
        return [
            FlightData(self.heli, plan, clock, course, out, int(lost))
            for plan, course, out, lost in zip(plans, courses, flown.out, flown.lost, strict=True)
        ]


def _noise(data: FlightData) -> Array:
    """Standard deviations (9,) so many decibels below those of a flight without noise."""
    out = np.zeros(len(READ))
    if data.plan.noise_db is not None:
        spread = data.out[: data.kept, : len(MEASURED)].std(axis=0)
        out[: len(MEASURED)] = spread * 10 ** (-data.plan.noise_db / 20)
    return out
