"""Cases computed here that the exported code must reproduce."""

from __future__ import annotations

import numpy as np

from symheli.helicopter import Helicopter
from symheli.values.c_text import define, rows

CASES = 12
STEP = 0.005  # s
_SIZE = {
    "u": 6.0,
    "v": 1.5,
    "w": 1.0,
    "p": 0.5,
    "q": 0.5,
    "r": 0.5,
    "phi": 0.3,
    "theta": 0.3,
    "a1": 0.03,
    "b1": 0.03,
    "om_i": 20.0,
}
"""Spread of each state (SI) over the cases; what is not named here (quaternion, position) has 1."""


def cases(heli: Helicopter) -> str:
    """Cases of `heli_rhs`, `heli_flight_rhs` and `heli_flight_step` as C tables, drawn from a fixed
    seed: flight, wind, saturations.
    """
    rng = np.random.default_rng(0)
    found = {"rhs_cases": [], "flight_cases": [], "step_cases": []}
    middle = np.array([0, 0, 1, 1])
    for _ in range(CASES):
        inputs = 0.5 * heli.travel * (rng.uniform(-1, 1, len(heli.inputs)) + middle)
        wind = 2.0 * rng.standard_normal(3)
        x, flight = _state(heli, heli.states, rng), _state(heli, heli.flight_states, rng)
        flight[6:10] /= np.linalg.norm(flight[6:10])
        rhs, flight_rhs = heli.numeric("rhs"), heli.numeric("flight_rhs")
        found["rhs_cases"].append((x, inputs, wind, rhs(x, inputs, wind)[0]))
        found["flight_cases"].append((flight, inputs, wind, flight_rhs(flight, inputs, wind)[0]))
        found["step_cases"].append((flight, inputs, wind, _step(heli, flight, inputs, wind)))
    tables = (
        rows("double", name, str(sum(map(len, given[0]))), np.array([*map(np.concatenate, given)]))
        for name, given in found.items()
    )
    return "\n".join([define("CASES", CASES), define("STEP", STEP, "s"), *tables])


def _state(heli: Helicopter, names: tuple, rng: np.random.Generator) -> np.ndarray:
    x = np.array([_SIZE.get(s, 1.0) for s in names]) * rng.standard_normal(len(names))
    x[0] = abs(x[0])
    for i, s in enumerate(names):
        if s == "Om":
            x[i] = heli.nominal_speed * (1 + 0.02 * rng.standard_normal())
    return x


def _step(heli: Helicopter, x: np.ndarray, u: np.ndarray, wind: np.ndarray) -> np.ndarray:
    """One classical Runge-Kutta step of `STEP` seconds, quaternion brought back to length 1."""

    def f(z: np.ndarray) -> np.ndarray:
        return heli.numeric("flight_rhs")(z, u, wind)[0]

    k1 = f(x)
    k2 = f(x + STEP / 2 * k1)
    k3 = f(x + STEP / 2 * k2)
    k4 = f(x + STEP * k3)
    end = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    end[6:10] /= np.linalg.norm(end[6:10])
    return end
