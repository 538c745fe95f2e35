"""Motions of a lower bound flown again, by integrators that the search does not use."""

from __future__ import annotations

from typing import Any

import numpy as np

from symheli.values.arrays import Array
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.claims.verdict import Counterexample

CYCLES = 3
"""Cycles of a growing motion that are shown."""
METHODS = (("DOP853", 1e-10), ("Radau", 1e-8))
"""Integrators of a growing motion, of different families, and their relative tolerance."""
STEPS = 8
"""Steps of Runge and Kutta between two times of an input; once more with twice as many."""


def growth_along(loop: Any, cycle: SchedulingTrajectory) -> tuple[float, Counterexample] | None:
    """Return the growth of the state in one cycle of p, the lower one of two integrators, with the
    motion over some cycles; None where they do not both see growth.
    """
    transitions = [_transition(loop, cycle, *method) for method in METHODS]
    if loop.dt is not None:
        transitions = [_products(loop, cycle)]
    growth = min(float(np.abs(np.linalg.eigvals(M)).max()) for M in transitions)
    if not growth > 1 + 1e-6:
        return None
    values, vectors = np.linalg.eig(transitions[0])
    x = np.real(vectors[:, int(np.abs(values).argmax())])
    states = [x / np.abs(x).max()]
    for _ in range(CYCLES):
        states.append(transitions[0] @ states[-1])
    time = float(cycle.time[-1]) * np.arange(CYCLES + 1)
    return growth, Counterexample(time, np.array(states), np.asarray(cycle.p, dtype=float))


def _transition(loop: Any, cycle: SchedulingTrajectory, method: Any, tolerance: float) -> Array:
    from scipy.integrate import solve_ivp

    n = len(loop.states)
    Phi = np.eye(n)
    for t0, t1, p0, p1 in _stretches(cycle):

        def rate(t: float, x: Array, ends: Any = (t0, t1, p0, p1)) -> Array:
            a, b, low, high = ends
            p = low + (high - low) * (t - a) / (b - a)
            return (loop.matrices(float(p))[0] @ x.reshape(n, n)).ravel()

        found = solve_ivp(rate, (t0, t1), Phi.ravel(), method=method, rtol=tolerance, atol=1e-14)
        Phi = found.y[:, -1].reshape(n, n)
    return Phi


def _stretches(cycle: SchedulingTrajectory) -> list[tuple[float, float, float, float]]:
    t, p = (np.asarray(v, dtype=float) for v in cycle)
    return [
        (float(t[k]), float(t[k + 1]), float(p[k]), float(p[k + 1]))
        for k in range(len(t) - 1)
        if t[k + 1] > t[k]
    ]


def _products(loop: Any, cycle: SchedulingTrajectory) -> Array:
    Phi = np.eye(len(loop.states))
    for p in cycle.p[: max(1, len(cycle.p) - 1)] if len(cycle.p) > 1 else cycle.p:
        Phi = loop.matrices(float(p))[0] @ Phi
    return Phi


def energy_ratio(
    loop: Any, motion: SchedulingTrajectory, held: Array
) -> tuple[float, Counterexample]:
    """Return |y|/|u| of an input from rest, the lower of two step sizes less their difference; and
    the motion.
    """
    if loop.dt is not None:
        return _sampled_ratio(loop, motion, held)
    coarse, fine = (_ratio(loop, motion, held, STEPS * k) for k in (1, 2))
    ratio = min(coarse[0], fine[0]) - abs(coarse[0] - fine[0])
    return ratio, Counterexample(motion.time, fine[1], np.asarray(motion.p, dtype=float))


def _ratio(loop: Any, motion: SchedulingTrajectory, held: Array, steps: int) -> tuple[float, Array]:
    """Integrate by Runge and Kutta, energies by Simpson; the input ends with the last time."""
    x = np.zeros(len(loop.states))
    states, supplied, seen = [x], 0.0, 0.0
    for k in range(len(motion.time) - 1):
        width = float(motion.time[k + 1] - motion.time[k])
        if width > 0:
            ends = float(motion.p[k]), float(motion.p[k + 1])
            u = np.asarray(held[k], dtype=float)
            x, energy = _stretch(loop, x, u, ends, width, steps)
            seen += energy
            supplied += width * float(u @ u)
        states.append(x)
    return float(np.sqrt(seen / supplied)) if supplied else 0.0, np.array(states)


def _stretch(
    loop: Any, x: Array, u: Array, ends: tuple[float, float], width: float, steps: int
) -> tuple[Array, float]:
    h, energy = width / steps, 0.0
    p = np.linspace(*ends, 2 * steps + 1)
    A, B, C, D = loop.matrices(p)
    forced = B @ u
    for j in range(0, 2 * steps, 2):
        k1 = A[j] @ x + forced[j]
        k2 = A[j + 1] @ (x + h / 2 * k1) + forced[j + 1]
        k3 = A[j + 1] @ (x + h / 2 * k2) + forced[j + 1]
        k4 = A[j + 2] @ (x + h * k3) + forced[j + 2]
        middle = x + h / 24 * (5 * k1 + 4 * k2 + 4 * k3 - k4)
        after = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        y = [C[j + i] @ v + D[j + i] @ u for i, v in enumerate((x, middle, after))]
        energy += h / 6 * float(y[0] @ y[0] + 4 * y[1] @ y[1] + y[2] @ y[2])
        x = after
    return x, energy


def _sampled_ratio(
    loop: Any, motion: SchedulingTrajectory, held: Array
) -> tuple[float, Counterexample]:
    x, states, seen = np.zeros(len(loop.states)), [], 0.0
    for p, u in zip(motion.p, held, strict=False):
        A, B, C, D = loop.matrices(float(p))
        y = C @ x + D @ u
        seen += float(y @ y)
        states.append(x)
        x = A @ x + B @ u
    supplied = float(np.sum(np.asarray(held) ** 2))
    found = Counterexample(motion.time, np.array(states), np.asarray(motion.p, dtype=float))
    return float(np.sqrt(seen / supplied)) if supplied else 0.0, found
