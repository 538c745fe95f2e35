"""Nonlinear flights of the planar VTOL: from the border of tubes, and of the published law."""

from __future__ import annotations

import casadi
import numpy as np
from scipy.linalg import expm

from evidence.planar_vtol.metric import Metric
from evidence.planar_vtol.model import GRAVITY, LIMITS, MASS, STATES, published
from synthesis.tubes import Tube

Array = np.ndarray

STEP = 0.005
"""Of Runge and Kutta's method, s."""
HORIZON = 1600
"""Steps of a flight in the worst gusts."""
DIRECTIONS = 36
"""Of the position at the end, that the gusts push to."""
POINTS = 5
"""Gauss points of the published law's integral."""


def _rk4(rate: casadi.Function, *inputs: str) -> casadi.Function:
    """One step of the first input, the others held."""
    x, *rest = (casadi.SX.sym(n, rate.size1_in(i)) for i, n in enumerate(inputs))
    a = rate(x, *rest)
    b = rate(x + STEP / 2 * a, *rest)
    c = rate(x + STEP / 2 * b, *rest)
    d = rate(x + STEP * c, *rest)
    return casadi.Function("step", [x, *rest], [x + STEP / 6 * (a + 2 * b + 2 * c + d)])


def from_its_border(found: Tube, count: int, steps: int) -> float:
    """The largest sqrt(e'P e) of flights that start on the border of a tube without a schedule, in
    gusts of full size and commands at their ends, which change at random.
    """
    rng, loop = np.random.default_rng(0), found.deviations
    P, ranges = found.P[0], np.array(loop.reference.ranges)[1:]
    e = rng.standard_normal((count, len(P)))
    e /= np.sqrt(np.einsum("ki,ij,kj->k", e, P, e))[:, None]
    data = loop.reference.data[0]
    step = _rk4(loop.rate, "e", "w", "c", "data").map(count)
    most, held = 0.0, rng.integers(1, 60, count)
    w, c = np.zeros((1, count)), np.zeros((2 + len(ranges), count))
    for k in range(steps):
        change = k % held == 0
        w[:, change] = rng.choice([-1.0, 1.0], (1, change.sum()))
        for i, limits in enumerate(ranges):
            c[2 + i, change] = rng.choice(limits, change.sum())
        e = np.asarray(step(e.T, w, c, data)).T
        most = max(most, float(np.einsum("ki,ij,kj->k", e, P, e).max()))
    return most**0.5


def worst_position(found: Tube) -> float:
    """The largest distance from the reference, m, of nonlinear flights from it, each in the gust
    that pushes the linear loop furthest in one direction; commands in the middle.
    """
    loop = found.deviations
    ranges = np.array(loop.reference.ranges)[1:]
    c, data = np.concatenate([[0, 0], ranges.mean(axis=1)]), loop.reference.data[0]
    e, w = casadi.SX.sym("e", 6), casadi.SX.sym("w", 1)
    rate = loop.rate(e, w, c, data)
    slopes = casadi.Function("A", [e, w], [casadi.jacobian(rate, e), casadi.jacobian(rate, w)])
    A, E = (np.asarray(m) for m in slopes(np.zeros(6), 0.0))
    gusts = _worst(A, E)
    step = _rk4(loop.rate, "e", "w", "c", "data").map(gusts.shape[1])
    x, most = np.zeros((6, gusts.shape[1])), 0.0
    for w in gusts:
        x = np.asarray(step(x, w[None], np.tile(c[:, None], len(w)), data))
        most = max(most, float(np.hypot(*x[:2]).max()))
    return most


def _worst(A: Array, E: Array) -> Array:
    """Gusts of size 1, (HORIZON, DIRECTIONS), that push the position furthest at the end."""
    angles = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    adjoint = np.zeros((DIRECTIONS, 6))
    adjoint[:, 0], adjoint[:, 1] = np.cos(angles), np.sin(angles)
    back, rows = expm(A.T * STEP), []
    for _ in range(HORIZON):
        rows.append(np.sign(adjoint @ E[:, 0]))
        adjoint = adjoint @ back.T
    return np.array(rows[::-1])


def published_law(metric: Metric) -> tuple[float, dict[str, float]]:
    """The largest distance from hover, m, of the published law u = u_r + integral of Y W^-1 along
    the straight line to the state, in the gusts that push its linear loop furthest; and the largest
    states on the way, of those the published box limits.
    """
    x, w = casadi.SX.sym("x", 6), casadi.SX.sym("w", 1)
    at = casadi.SX.sym("at", 2)
    W, Y, *_ = metric.at(at)
    gain = casadi.Function("gain", [at], [casadi.solve(W, Y.T).T])
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    K = sum(v / 2 * gain((1 + s) / 2 * x[2:4]) for s, v in zip(nodes, weights, strict=True))
    u = MASS * GRAVITY / 2 + K @ x
    rate = casadi.Function("law", [x, w], [published()(x, u, w)])
    slopes = casadi.Function(
        "A",
        [x, w],
        [
            casadi.jacobian(rate(x, w), x),
            casadi.jacobian(rate(x, w), w),
        ],
    )
    A, E = (np.asarray(m) for m in slopes(np.zeros(6), 0.0))
    gusts, most = _worst(A, E), np.zeros(6)
    step = _rk4(rate, "x", "w").map(gusts.shape[1])
    state, far = np.zeros((6, gusts.shape[1])), 0.0
    for w in gusts:
        state = np.asarray(step(state, w[None]))
        far = max(far, float(np.hypot(*state[:2]).max()))
        most = np.maximum(most, np.abs(state).max(axis=1))
    return far, {n: float(most[STATES.index(n)]) for n in LIMITS if n in STATES}
