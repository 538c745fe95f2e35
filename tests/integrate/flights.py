"""Flights that several test modules use."""

from __future__ import annotations

import numpy as np

import symheli
from symheli.physics.attitude import flight_state


def manoeuvre(heli, airspeed=6.0, n=20, size=0.01, dt=0.02):
    """A trim point as start, and smooth motion of all four inputs about its own (n, 4)."""
    point = symheli.trim(heli, airspeed)
    time = dt * np.arange(n)[:, None]
    return flight_state(point.x.array), point.u.array + size * np.sin(
        time * np.array([5.0, 6.0, 7.0, 8.0]) + [0.0, 1.0, 2.0, 3.0]
    )


def held(heli, seconds, airspeed=6.0, dt=0.02):
    """Smooth motion of the inputs about an airspeed that feedback holds: start, inputs (n, 4) and
    feedback.
    """
    n = round(seconds / dt)
    autopilot = symheli.flight.gain_scheduled_lqr(heli, airspeed - 1, airspeed + 1, dt, points=3)
    gain = np.zeros((4, len(heli.states)))
    for name, column in zip(autopilot.states, autopilot.gain(airspeed).T, strict=True):
        gain[:, heli.states.index(name)] = column
    x0, u = manoeuvre(heli, airspeed, n, dt=dt)
    reference = np.tile(symheli.trim(heli, airspeed).x.array, (n, 1))
    return x0, u, symheli.integrate.Feedback(np.tile(gain, (n, 1, 1)), reference, heli.travel)


def transition(heli):
    """Start and inputs (n, 4) of 11 s from hover to 8 m/s and back, through the edge of the wake
    and the stall of fin and tail.
    """
    schedule = symheli.AirspeedSchedule.transition(0.0, 8.0, acceleration=3.0, hold=0.5)
    inputs = symheli.fly(heli, schedule).columns(heli.inputs)[:-1]
    return flight_state(symheli.trim(heli, 0.0).x.array), inputs


def without_compiler(monkeypatch, heli):
    """The same helicopter, its equations never compiled."""
    monkeypatch.setattr("symheli.integrate.equations.library", lambda source, name: None)
    return symheli.Helicopter(heli.vehicle, heli.governor, heli.density)
