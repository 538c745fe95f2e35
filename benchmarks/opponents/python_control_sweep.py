"""Trim and linearization along airspeed in python-control, on the hand-written equations in
Python.
"""

from math import cos, sin

import control
import numpy as np

from benchmarks.opponents.equations import build

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "a1", "b1")
INPUTS = ("d_lon", "d_lat", "d_col", "d_ped")
OUTPUTS = ("forward", "right", "down")
HOVER = (np.array([0, 0, 0, 0, 0, 0, 0.08, 0, 0, 0.0]), np.array([0, 0, 0.1, 0.25]))
_RATES, _VELOCITIES = [3, 4, 5], [0, 1, 2]
_BALANCES = [0, 1, 2, 3, 4, 5, 8, 9]  # with the rates at zero the attitude rests by itself
_find = getattr(control, "find_operating_point", None) or control.find_eqpt  # older name


def helicopter():
    """The helicopter as a nonlinear system; its outputs are the velocity in heading axes."""
    euler = build().euler

    def update(t, x, u, params):
        return np.array(euler(*x.tolist(), *u.tolist()))

    def output(t, x, u, params):
        u_, v, w, _, _, _, phi, theta, _, _ = x.tolist()
        s, c = sin(phi), cos(phi)
        across = v * s + w * c
        return np.array(
            [
                u_ * cos(theta) + across * sin(theta),
                v * c - w * s,
                across * cos(theta) - u_ * sin(theta),
            ]
        )

    return control.nlsys(
        update, output, name="helicopter", states=STATES, inputs=INPUTS, outputs=OUTPUTS
    )


def sweep(airspeeds: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, control.StateSpace]]:
    """Trim state, trim input and linear model at each airspeed (m/s), each trim started from the
    one before.
    """
    system, (x, u), models = helicopter(), HOVER, []
    for speed in airspeeds:
        x, u = _find(system, x, u, y0=[speed, 0.0, 0.0], ix=_RATES, iy=_VELOCITIES, idx=_BALANCES)
        if x is None:
            raise RuntimeError(f"python-control found no operating point at {speed:g} m/s")
        models.append((x, u, system.linearize(x, u)))
    return models
