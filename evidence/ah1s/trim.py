"""Equilibria of the held simulator: level flight at an airspeed, with an acceleration if asked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evidence.ah1s.simulator import AH1S
from symheli.errors import TrimError
from symheli.values.arrays import Array

GUESS = np.array([-0.04, 0.0, 0.0, 0.0, 0.5, 0.3])
"""Roll, pitch (rad) and sticks near hover."""

STEP = np.array([0.01, 0.01, 0.02, 0.02, 0.02, 0.02])
ACCURACY = 1e-3
"""m/s^2 and rad/s^2; about what the creeping governor leaves."""

ITERATIONS = 12


class Trim(NamedTuple):
    """State (8,) and sticks (4,) in equilibrium."""

    state: Array
    sticks: Array


def at(airspeed: float, unknown: Array) -> Trim:
    """Straight flight along the nose at `airspeed` (m/s) with this roll, pitch and these sticks."""
    phi, theta = unknown[:2]
    velocity = airspeed * along(phi, theta)
    return Trim(np.concatenate([velocity, np.zeros(3), [phi, theta]]), unknown[2:])


def along(phi: float, theta: float) -> Array:
    """The horizontal direction of the nose in body axes (3,)."""
    return np.array([np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi) * np.sin(theta)])


def trim(simulator: AH1S, airspeed: float, acceleration: float = 0.0, guess: Array = GUESS) -> Trim:
    """State and sticks at which the held simulator would go on straight and level, at `airspeed`
    (m/s) and `acceleration` (m/s^2) along the nose. Newton's method by central differences; raises
    `TrimError`.
    """

    def residual(unknown: Array) -> Array:
        rates = simulator.hold(*at(airspeed, unknown))
        rates[:3] -= acceleration * along(*unknown[:2])
        return rates

    unknown = np.array(guess, float)
    for _ in range(ITERATIONS):
        left = residual(unknown)
        if np.abs(left).max() < ACCURACY:
            return at(airspeed, unknown)
        slopes = [(residual(unknown + h) - residual(unknown - h)) / 2 for h in np.diag(STEP)]
        change = -np.linalg.solve(np.array(slopes).T / STEP, left)
        unknown += change / max(1.0, np.abs(change).max() / 0.3)
    raise TrimError(
        f"no equilibrium of the AH-1S at {airspeed:g} m/s and {acceleration:g} m/s^2: the"
        f" accelerations stay at {np.abs(left).max():.2g}; nearer to {airspeed:g} m/s start from a"
        " trim beside it"
    )
