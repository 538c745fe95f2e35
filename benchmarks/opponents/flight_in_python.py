"""A flight under feedback as one writes it in Python: a compiled step of the helicopter, the rest
of the loop in NumPy.
"""

from __future__ import annotations

import math

import numpy as np

import symheli
from symheli.codegen.numeric import Numeric
from symheli.integrate import runge_kutta
from symheli.physics.attitude import flight_state


class FlightInPython:
    """Flies gains over airspeed, a sample every `dt` seconds of `substeps` Runge-Kutta steps; the
    step is compiled once for all flights.
    """

    def __init__(self, heli, autopilot, dt, substeps):
        self.heli, self.autopilot, self.dt = heli, autopilot, dt
        self.step = Numeric(runge_kutta(heli, dt, substeps))
        self.travel = heli.travel

    def trims(self, time, speed, rate):
        """x0 (n, nx), u0 (n, 4): a trim every 0.1 s, each from the one before, straight lines
        between.
        """
        every, point, x, u = round(0.1 / self.dt), None, [], []
        knots = sorted({*range(0, len(time), every), len(time) - 1})
        for k in knots:
            if k == 0 or speed[k] != point.airspeed or rate[k] != point.condition.acceleration:
                point = symheli.trim(
                    self.heli, speed[k], acceleration=rate[k], start=point, throw=False
                )
            x.append(point.x.array)
            u.append(point.u.array)
        x0, u0 = (
            np.column_stack([np.interp(time, time[knots], c) for c in np.transpose(v)])
            for v in (x, u)
        )
        x0[:, 4] = np.gradient(x0[:, 7], time)  # q follows theta
        return x0, u0

    def fly(self, schedule, excitation, noise, seed):
        """States (n, nx) as measured and inputs (n, 4), with excitation and sensor noise of
        standard deviations `noise` (8,).
        """
        time = self.dt * np.arange(int(schedule.duration / self.dt))
        airspeed, rate = schedule(time)
        x0, u0 = self.trims(time, airspeed, rate)
        signals = excitation(time)
        added = np.column_stack([signals[str(name)] for name in self.heli.inputs])
        n, nx = x0.shape
        white = np.random.default_rng(seed).standard_normal((n, 8))
        at = np.linspace(0, 1, len(self.autopilot.airspeeds))
        states, inputs = np.empty((n, nx)), np.empty((n, 4))
        flight, wind = flight_state(x0[0]), np.zeros(3)
        for k in range(n):
            states[k] = euler_form(flight)
            states[k, :8] += noise * white[k]
            position = np.interp(airspeed[k], self.autopilot.airspeeds, at) * (len(at) - 1)
            i = min(int(position), len(at) - 2)
            gains = self.autopilot.gains[i : i + 2]
            K = (1 - (position - i)) * gains[0] + (position - i) * gains[1]
            command = u0[k] - K @ (states[k, :8] - x0[k, :8]) + added[k]
            inputs[k] = np.clip(command, -self.travel, self.travel)
            flight = self.step(flight, inputs[k], wind)[0]
        return states, inputs


def euler_form(flight):
    """u v w p q r phi theta and the rest from the quaternion form."""
    q0, q1, q2, q3 = flight[6:10]
    phi = math.atan2(2 * (q0 * q1 + q2 * q3), 1 - 2 * (q1**2 + q2**2))
    theta = math.asin(max(-1.0, min(1.0, 2 * (q0 * q2 - q3 * q1))))
    return np.concatenate([flight[:6], [phi, theta], flight[13:]])
