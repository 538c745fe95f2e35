"""Flights with everything in them, for several test modules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import symheli
from symheli import AirspeedSchedule, Excitation, Sensor, Wind
from symheli.environment import Dryden, Gust
from symheli.flight import XCELL_SERVOS

SLOW = {name: replace(servo, rate=0.4) for name, servo in XCELL_SERVOS.items()}
"""Those of the X-Cell with a limit on their rate, rad/s, which these flights reach."""

INPUTS = ("d_lon", "d_lat", "d_col", "d_ped")
SENSORS = {
    "q": Sensor(noise=0.01, bias=0.002, delay=0.05, period=0.04, quantum=0.001),
    "phi": Sensor(noise=0.002, delay=0.02),
    "u": Sensor(noise=0.1),
    "airspeed": Sensor(noise=0.2, bias=0.5, delay=0.1),
}
STORM = Wind((2.0, -1.0, 0.0), (Gust((0.0, 3.0, 0.5), 1.5, 1.0),), Dryden(5.0, 15.0), seed=2)
STIRRED = Excitation(dict.fromkeys(INPUTS, 0.004), seed=1)
EVERYTHING = {
    "excitation": STIRRED,
    "wind": STORM,
    "sensors": SENSORS,
    "servos": SLOW,
    "delay": 0.017,
}
SHORT = AirspeedSchedule((7.0, 1.0), (3.0, 3.0), (0.5, 0.5), lead=0.5)


def dynamic(heli, follow="command", dt=0.02):
    """A controller with states that moves with the square of the airspeed: the gains of an LQR, a
    lag on the attitude it answers, and a slow integral of the yaw rate.
    """
    pilot = symheli.flight.gain_scheduled_lqr(heli, 0.0, 13.0, dt)
    basis = symheli.lpv.Polynomial(2, 0.0, 13.0)
    nodes = np.linspace(0.0, 13.0, 14)
    K = basis.fit(nodes, np.stack([pilot.gain(V) for V in nodes]))
    n, inputs = basis.size, tuple(map(str, pilot.states))
    one = basis.constant()
    A, B, C = np.zeros((n, 3, 3)), np.zeros((n, 3, len(inputs))), np.zeros((n, 4, 3))
    D = -K.copy()
    for k, name in enumerate(("phi", "theta")):
        column = inputs.index(name)
        A[:, k, k], B[:, k, column] = 0.4 * one, 0.6 * one
        C[:, :, k], D[:, :, column] = -K[:, :, column], 0.0
    A[:, 2, 2], B[:, 2, inputs.index("r")] = one, dt * one
    C[:, 3, 2] = -0.05 * one
    model = symheli.LPVStateSpace(
        basis,
        A,
        B,
        C,
        D,
        symheli.Scheduling("airspeed", "m/s", 0.0, 13.0),
        ("phi_late", "theta_late", "heading"),
        inputs,
        INPUTS,
        dt,
    )
    return symheli.flight.ScheduledController(model, follow)


class InPython:
    """Any controller, asked in Python at every sample."""

    def __init__(self, controller):
        self.dt, self.controller = controller.dt, controller

    def reset(self):
        self.state = self.controller.init()

    def step(self, measured, reference, p):
        u, self.state = self.controller.step(self.state, measured, reference, p)
        return u


def differences(first, second):
    """Largest difference of each signal over its largest value (or 1e-3 where it hardly moves)."""
    size = np.maximum(np.abs(second.values).max(axis=0), 1e-3)
    return (np.abs(first.values - second.values).max(axis=0) / size).max()
