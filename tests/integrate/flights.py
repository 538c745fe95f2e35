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


def without_compiler(monkeypatch, heli):
    """The same helicopter, its equations never compiled."""
    monkeypatch.setattr("symheli.integrate.equations.library", lambda source, name: None)
    return symheli.Helicopter(heli.vehicle, heli.governor, heli.density)
