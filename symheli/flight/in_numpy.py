"""The closed loop without a compiler, one flight at a time: a translation of closed_loop.c line by
line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symheli.flight.plan import READ
from symheli.integrate.equations import Equations, equations
from symheli.integrate.rk4 import runge_kutta_step
from symheli.physics.attitude import euler_state, flight_state
from symheli.physics.rigid_body import body_to_earth
from symheli.values.arrays import Array

if TYPE_CHECKING:
    from symheli.flight.loops import LoopResults, Loops

MAX_BANK = 1.4
"""Bank or pitch angle (rad) beyond which a flight is lost."""


class InNumpy:
    """A flight that waits for its command at every sample."""

    def __init__(self, loops: Loops, i: int, found: LoopResults):
        self._loops, self._i, self._found = loops, i, found
        self._made: Equations = equations(loops.heli)
        self._course, d = loops.courses[loops.chosen[i]], loops.disturbances
        self._winds, self._added = (a[min(i, len(a) - 1)] for a in (d.wind, d.added))
        n, servos = len(self._course.time), loops.equipment.servos
        x0, u0 = np.split(self._course.reference[0], [len(loops.heli.states)])
        self._x, self._start = flight_state(x0), u0
        self._truth = np.empty((n, len(READ)))
        self._commands = np.empty((n, 4))
        self._servo = servos.init(u0) if servos else None
        self._reached = (
            u0 if servos is None or self._servo is None else servos.deflection(self._servo)
        )
        self._noise = loops.noise[min(i, len(loops.noise) - 1)]
        self._p = loops.heli.parameters.array

    def read(self, k: int) -> Array | None:
        """Return the inputs of the controller at sample k; None where the flight is lost."""
        euler, air = _measured(self._x, self._wind(k))
        self._truth[k] = *euler[:8], air
        if not (np.isfinite(self._x).all() and np.abs(euler[6:8]).max() <= MAX_BANK):
            self._found.lost[self._i] = k
            return None
        r, d = self._loops.equipment.readings, self._loops.disturbances
        before = np.maximum(k - r.delay, 0)
        source = before - before % r.period
        drawn = np.zeros(len(READ))
        if d.white is not None:
            drawn[:8] = d.white[self._i, source[:8], np.arange(8)]
        if d.white_air is not None:
            drawn[8] = d.white_air[self._i, source[8]]
        reading = self._truth[source, np.arange(len(READ))] + (self._noise * drawn + r.bias)
        coarse = r.quantum > 0
        reading[coarse] = np.round(reading[coarse] / r.quantum[coarse]) * r.quantum[coarse]
        self._euler, self._reading, self._air = euler, reading, air
        return np.concatenate([reading, euler[-2:]])

    def command(self, k: int, u: Array) -> None:
        """Apply the commands and integrate to the next sample."""
        loops = self._loops
        if loops.changes is not None and k == loops.changes.samples[self._i]:
            self._p = loops.changes.parameters[self._i]
        clock, servos, late = loops.clock, loops.equipment.servos, loops.equipment.late
        u = np.clip(
            u + self._added[min(k, len(self._added) - 1)], -loops.heli.travel, loops.heli.travel
        )
        self._commands[k] = u
        for s in range(clock.substeps):
            at = k * clock.substeps + s - late
            effective = self._start if at < 0 else self._commands[at // clock.substeps]
            if s == 0:
                self._keep(k, self._reached if servos else effective)
            if servos and self._servo is not None:
                before = self._reached
                self._servo, self._reached = servos.step(self._servo, effective.copy())
                effective = 0.5 * (before + self._reached)
            self._x = self._stepped(effective, self._wind(k))

    def _stepped(self, u: Array, wind: Array) -> Array:
        rates = self._made.rates
        with np.errstate(all="ignore"):  # a lost flight ends in NaN or infinity
            return runge_kutta_step(
                lambda x: rates(x, u, wind, self._p)[0], self._x, self._loops.clock.step
            )

    def end(self) -> None:
        """Do nothing: no memory has to be freed."""

    def _wind(self, k: int) -> Array:
        return self._winds[min(k, len(self._winds) - 1)]

    def _keep(self, k: int, inputs: Array) -> None:
        if k % self._loops.clock.every == 0:
            row = self._found.out[self._i, k // self._loops.clock.every]
            row[:] = *self._reading[:8], *self._euler[8:], *inputs, *self._commands[k], self._air


def _measured(flight: Array, wind: Array) -> tuple[Array, float]:
    """Euler-form state and true airspeed (m/s) from the quaternion form; wind in earth axes."""
    velocity = flight[:3] - np.array(body_to_earth(*flight[6:10])).T @ wind
    return euler_state(flight), float(np.linalg.norm(velocity))
