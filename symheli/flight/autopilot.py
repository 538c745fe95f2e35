"""A gain-scheduled LQR that keeps a flight near its commanded transition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from symheli.airspeed_sweep import sweep
from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.signal import Signal

UNMEASURED = ("a1", "b1")
SCALE = {"u": 1.5, "v": 1.5, "w": 1.0, "p": 1.0, "q": 1.0, "r": 0.7, "phi": 0.15, "theta": 0.15, "Om": 5.0, "om_i": 3.0}
"""Deviation of each state (SI) that counts as much as 0.01 rad of an input in the LQR weights."""
INPUT_SCALE = 0.01


@dataclass(frozen=True)
class Autopilot:
    """u = u0 - K(V)(x - x0) on the measured `states`, at sample period `dt` (s), gains (K, 4, nx) at `airspeeds` (m/s).

    `radius`: largest closed-loop eigenvalue magnitude (one sample of delay included) over the design points, < 1.
    """

    airspeeds: np.ndarray
    gains: np.ndarray
    states: tuple[Signal, ...]
    dt: float
    radius: float

    def gain(self, airspeed: float) -> np.ndarray:
        """K (4, nx), linearly interpolated over airspeed."""
        position = np.interp(airspeed, self.airspeeds, np.arange(len(self.airspeeds)))
        k = min(int(position), len(self.airspeeds) - 2)
        return (1 - (position - k)) * self.gains[k] + (position - k) * self.gains[k + 1]


def gain_scheduled_lqr(heli: Helicopter, low: float, high: float, dt: float, points: int = 14) -> Autopilot:
    """LQR at `points` airspeeds from `low` to `high` (m/s) on the model with quasi-steady flapping, sampled at `dt` (s).

    Each gain is checked on the full model (flapping states, one sample of delay); raises `InputError` where the loop
    would be unstable there.
    """
    family = sweep(heli, np.linspace(low, high, points))  # type: ignore[arg-type]
    design = family.residualize([s for s in UNMEASURED if s in family.states])
    states = design.states
    Q = np.diag([1 / SCALE[s] ** 2 for s in states])
    R = np.eye(4) / INPUT_SCALE**2
    gains = []
    for k in range(len(design)):
        model = design[k].discretize(dt)
        P = solve_discrete_are(model.A, model.B, Q, R)
        gains.append(np.linalg.solve(R + model.B.T @ P @ model.B, model.B.T @ P @ model.A))
    radius = _closed_loop_radius(family, np.stack(gains), states, dt)
    if radius >= 1:
        raise InputError(f"the scheduled LQR is unstable on the full model at dt = {dt} s (eigenvalue {radius:.3f}); sample faster")
    return Autopilot(family.airspeeds, np.stack(gains), states, dt, radius)


def _closed_loop_radius(family: LinearFamily, gains: np.ndarray, states: tuple[Signal, ...], dt: float) -> float:
    pick = np.array([[float(s == t) for t in family.states] for s in states])

    def radius(model: LinearModel, K: np.ndarray) -> float:
        feedback = -K @ pick
        delayed = np.block([[model.A, model.B], [feedback, np.zeros((4, 4))]])  # u(k) = -K x(k-1)
        return float(max(np.abs(np.linalg.eigvals(model.A + model.B @ feedback)).max(), np.abs(np.linalg.eigvals(delayed)).max()))

    return max(radius(family[k].discretize(dt), gains[k]) for k in range(len(family)))
