"""Accelerated level flight along a range of airspeeds, and the feedback about it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

from symheli import Helicopter, trim, trim_batch
from symheli.errors import InputError, TrimError
from symheli.progress import task
from symheli.steady.newton import newton
from symheli.values.summary import summarized

Array = np.ndarray

STATE_SIZES = (1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1)
"""Deviations of equal weight in the default feedback: m/s, rad/s, rad."""
CONTROL_SIZE = 0.1
"""Control of the weight of these, rad."""
TUBE_SIZES = (0.4, 0.5, 0.8, 0.1, 0.1, 0.3, 0.08, 0.06, 0.02, 0.02)
"""Half widths of equal weight in the size of a tube: m/s, rad/s, rad."""
GIVEN = ("u", "v", "w", "phi", "theta")
"""States that airspeed and acceleration give."""
POWERS = 4
"""Number of powers of the acceleration in the reference."""
SWEEPS = 4
"""Solutions of the accelerated flight, each with the slopes along airspeed of the one before."""
CONSISTENT = 1e-6
"""Largest residual of an accelerated flight that Newton's method may leave, SI."""


@dataclass(frozen=True, eq=False)
class Reference:
    """x_r, u_r and K of a commanded airspeed p, dp/dt = a, da/dt = j, dj/dt = b.

    Between two nodes x_r is sum a^i X_i(p) + Y(p) j, X_i cubic in p by Hermite's formula; u_r
    likewise, plus V(p) b; Y, V and K linear in p. One node: a held airspeed.

    airspeeds (k,): nodes, m/s. steady (k, 2, powers, n + 4): values of X_i at the nodes, states and
    controls, and their slopes by airspeed. jerk (k, n + 4): Y; snap (k, 4): V. gain (k, 4, n): K,
    rad per SI unit. limits (3,): the largest sizes of a, j and b, m/s^2, m/s^3, m/s^4; b infinite
    where the jerk may jump (Y and V are then 0 for all states).
    """

    airspeeds: Array
    steady: Array
    jerk: Array
    snap: Array
    gain: Array
    limits: tuple[float, float, float]

    __repr__ = summarized

    jacobian_parts = (4, 4)
    """Parts of a cell along airspeed and acceleration over which the Jacobian is enclosed,"""
    drift_parts = (16, 16)
    """and the drift of the reference."""
    drifts = True
    """Whether the reference may miss the equations."""

    @property
    def nodes(self) -> Array:
        """Of the scheduling command: the airspeeds."""
        return self.airspeeds

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Of the commands that cells split besides the airspeed: the acceleration."""
        return ((-self.limits[0], self.limits[0]),)

    @property
    def whole(self) -> tuple[float, ...]:
        """Largest sizes of the others, jerk and its derivative; 0 where it may jump."""
        return tuple(limit if np.isfinite(limit) else 0.0 for limit in self.limits[1:])

    @property
    def jumps(self) -> bool:
        """Whether a state may jump: with the jerk, or as a command that is held has limits."""
        n = self.gain.shape[-1]
        with_jerk = np.any(self.jerk[:, :n]) or np.any(self.snap)
        held = len(self.airspeeds) == 1 and any(self.limits)
        return bool(held or (np.isinf(self.limits[2]) and with_jerk))

    def hypotheses(self, name: str, gust: float) -> tuple[str, ...]:
        """What a tube about it rests on, in sentences."""
        p, (a, j, b) = self.airspeeds, self.limits
        command = f"the commanded airspeed is {p[0]:g} m/s"
        if len(p) > 1:
            bounded = (
                f", which changes by at most {b:g} m/s^4" if np.isfinite(b) else " that may jump"
            )
            command = (
                f"the commanded airspeed stays within {p[0]:g} to {p[-1]:g} m/s, its acceleration"
                f" within {a:g} m/s^2, with a jerk of at most {j:g} m/s^3{bounded}"
            )
        return (
            f"the equations of {name} with an ideal governor; u = u_r + K e in continuous time with"
            " all ten states known; no servos, no delay",
            f"{command}; gusts have at most {gust:g} m/s, any direction in body axes and any"
            " history",
        )

    @property
    def intervals(self) -> int:
        """Number of intervals between nodes, 1 for a held airspeed."""
        return max(len(self.airspeeds) - 1, 1)

    @cached_property
    def data(self) -> Array:
        """What `between` takes of each interval, (intervals, .)."""
        ends = [np.arange(self.intervals), np.arange(self.intervals) + (len(self.airspeeds) > 1)]
        p = np.stack([self.airspeeds[i] for i in ends], axis=1)
        if len(self.airspeeds) == 1:
            p = p + np.array([0.0, 1.0])
        given = (self.steady, self.jerk, self.snap, self.gain)
        parts = [m[i].reshape(len(i), -1) for m in given for i in ends]
        return np.hstack([p, *parts])

    def between(self, data: Any, c: Any) -> tuple[Any, Any, Any, Any]:
        """(x_r, dx_r/dt, u_r, K) in CasADi; data: of an interval; c = (s, a, j, b), s in [0, 1] the
        position between its nodes.
        """
        powers, n = self.steady.shape[2], self.gain.shape[2]
        place = 2

        def part(rows: int, columns: int) -> Any:
            nonlocal place
            place += rows * columns
            return casadi.reshape(data[place - rows * columns : place], columns, rows).T

        s, a, j, snap, width = *casadi.vertsplit(c), data[1] - data[0]
        (y0, m0), (y1, m1) = (casadi.vertsplit(part(2 * powers, n + 4), powers) for _ in range(2))
        (Y0, Y1), (V0, V1), (K0, K1) = (
            [part(*shape) for _ in range(2)] for shape in ((1, n + 4), (1, 4), (4, n))
        )
        # y0 + s (d0 + s (c2 + s c3)): small numbers beside the first
        d0, d1, step = width * m0, width * m1, y1 - y0
        c2, c3 = 3 * step - 2 * d0 - d1, d0 + d1 - 2 * step
        value, slope = y0 + s * (d0 + s * (c2 + s * c3)), (d0 + s * (2 * c2 + 3 * s * c3)) / width
        z, along, by = value[-1, :], slope[-1, :], casadi.SX.zeros(1, n + 4)
        for i in range(powers - 2, -1, -1):
            by = z + a * by
            z, along = value[i, :] + a * z, slope[i, :] + a * along
        Y, turn = Y0 + s * (Y1 - Y0), (Y1 - Y0) / width
        z, moving = z + Y * j, (along + turn * j) * a + by * j + Y * snap
        u = z[n:] + (V0 + s * (V1 - V0)) * snap
        return z[:n].T, moving[:n].T, u.T, K0 + s * (K1 - K0)

    def place(self, airspeeds: Any) -> tuple[Array, Array]:
        """Intervals of airspeeds (N,) within the range, m/s, and their shares of the way along it,
        (N,).
        """
        p = np.asarray(airspeeds, float)
        i = np.clip(np.searchsorted(self.airspeeds, p) - 1, 0, self.intervals - 1)
        low, high = self.data[i, :2].T
        return i, (p - low) / (high - low)


def held(heli: Helicopter, airspeed: Any, gain: Any = None) -> Reference:
    """Steady level flight."""
    steady = trim(heli, airspeed=airspeed)
    x, u = np.array(steady.x), np.array(steady.u)
    K = regulator(heli, x, u) if gain is None else np.asarray(gain, float)
    at = np.concatenate([x, u])[None, None, None]
    return Reference(
        np.array([float(airspeed)]),
        np.concatenate([at, 0 * at], axis=1),
        np.zeros((1, len(x) + 4)),
        np.zeros((1, 4)),
        _schedule(K, 1, len(x)),
        (0.0, 0.0, 0.0),
    )


def moving(
    heli: Helicopter, airspeeds: Array, limits: tuple[float, float, float], gain: Any = None
) -> Reference:
    """Level flight that accelerates along these nodes, consistent with the equations where the
    acceleration stays the same, with the rates of its attitude; to first order also in a jerk that
    stays the same, where it may not jump.
    """
    acceleration, k, powers = limits[0], len(airspeeds), POWERS
    a = acceleration * np.cos(np.pi * (np.arange(powers) + 0.5) / powers)
    p, accelerations = np.repeat(airspeeds, powers), np.tile(a, k)
    start = trim_batch(heli, p, acceleration=accelerations)
    x, u = start.x.copy(), start.u.copy()
    flight = _Accelerated(heli)
    with task("accelerated flight", SWEEPS) as progress:
        for _ in range(SWEEPS):
            along = CubicSpline(airspeeds, x.reshape(k, powers, -1))(airspeeds, 1)
            rates = accelerations[:, None] * along.reshape(k * powers, -1)
            for i in range(k * powers):
                x[i], u[i] = flight.solved(p[i], rates[i], x[i], u[i])
            progress.step()
    # powers of a, from the values at Chebyshev's points
    to_powers = np.linalg.inv(np.vander(a, increasing=True))
    z = np.concatenate([x, u], axis=1).reshape(k, powers, -1)
    z = np.einsum("ij,kjn->kin", to_powers, z)
    z = np.stack([z, CubicSpline(airspeeds, z)(airspeeds, 1)], axis=1)
    n = x.shape[1]
    level, controls = z[:, 0, 0, :n], z[:, 0, 0, n:]
    if gain is None:
        K = np.stack([regulator(heli, *at) for at in zip(level, controls, strict=True)])
    else:
        K = _schedule(gain, k, n)
    by, feed = z[:, 0, 1, :n], np.zeros((k, n + 4))
    snap = np.zeros((k, 4))
    for i, at in enumerate(zip(level, controls, K, strict=True)):
        if np.isfinite(limits[2]):
            feed[i] = _in_jerk(heli, *at[:2], by[i])
            snap[i] = _against(heli, *at, feed[i, :n])
        else:
            feed[i, n:] = _against(heli, *at, by[i])
    return Reference(airspeeds, z, feed, snap, K, limits)


def regulator(heli: Helicopter, x: Array, u: Array) -> Array:
    """K (4, 10) of the linear-quadratic regulator."""
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    Q, R = np.diag(1 / np.array(STATE_SIZES) ** 2), np.eye(4) / CONTROL_SIZE**2
    return -np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))


def _schedule(gain: Any, nodes: int, n: int) -> Array:
    K = np.asarray(gain, float)
    if K.shape not in ((4, n), (nodes, 4, n)) or not np.all(np.isfinite(K)):
        raise InputError(
            f"gain must be 4 by {n} finite numbers, rad per SI unit, or as many for each of the"
            f" {nodes} nodes of the airspeed; got {K.shape}"
        )
    return np.broadcast_to(K, (nodes, 4, n)).copy()


def _in_jerk(heli: Helicopter, x: Array, u: Array, by: Array) -> Array:
    """Y (n + 4,): rates, flapping and controls with which the state moves as the reference does,
    velocity and attitude being given, by least squares; by: dx_r/da.
    """
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    free = [i for i, name in enumerate(heli.states) if str(name) not in GIVEN]
    free += range(len(x), len(x) + 4)
    sizes, Y = np.array(TUBE_SIZES), np.zeros(len(x) + 4)
    rows = np.hstack([A, B])[:, free] / sizes[:, None]
    Y[free] = np.linalg.lstsq(rows, by / sizes, rcond=None)[0]
    return Y


def _against(heli: Helicopter, x: Array, u: Array, K: Array, by: Array) -> Array:
    """(4,): the controls with which the reference's motion `by` moves the deviation least: the
    square of the linear loop's response to an impulse, in units of equal weight.
    """
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    X = solve_continuous_lyapunov((A + B @ K).T, -np.diag(np.array(TUBE_SIZES) ** -2.0))
    return np.linalg.solve(B.T @ X @ B, B.T @ X @ by)


class _Accelerated:
    """Level flight at airspeed p whose state changes at a given rate, heading held.

    Unknown: phi, theta, the helicopter's own states, the four controls.
    """

    def __init__(self, heli: Helicopter):
        n = len(heli.states)
        self.free = [i for i, name in enumerate(heli.states) if str(name) not in "uvwpqr"]
        self.rows = [i for i, name in enumerate(heli.states) if str(name) not in ("phi", "theta")]
        z, p, rate = casadi.SX.sym("z", n - 2), casadi.SX.sym("p"), casadi.SX.sym("rate", n)
        own = dict(zip([str(heli.states[i]) for i in self.free], casadi.vertsplit(z), strict=False))
        phi, theta = own["phi"], own["theta"]
        turn = dict(zip(map(str, heli.states), casadi.vertsplit(rate), strict=True))
        own |= {
            "u": p * casadi.cos(theta),
            "v": p * casadi.sin(phi) * casadi.sin(theta),
            "w": p * casadi.cos(phi) * casadi.sin(theta),
            "p": turn["phi"],
            "q": turn["theta"] * casadi.cos(phi),
            "r": -turn["theta"] * casadi.sin(phi),
        }
        x, u = casadi.vertcat(*[own[str(name)] for name in heli.states]), z[len(self.free) :]
        residual = (heli.rhs(x, u, casadi.SX.zeros(3)) - rate)[self.rows]
        self.system = casadi.Function(
            "accelerated", [z, p, rate], [residual, casadi.jacobian(residual, z), x, u]
        )

    def solved(self, p: float, rate: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """(x, u), started from others."""

        def system(z: Array) -> tuple[Array, Array]:
            residual, slopes, *_ = self.system(z, p, rate)
            return np.asarray(residual)[:, 0], np.asarray(slopes)

        z = np.concatenate([x[self.free], u])
        z, miss = newton(system, range(len(z)), z)
        if miss > CONSISTENT:
            raise TrimError(f"no level flight that accelerates was found at {p:g} m/s")
        _, _, x_new, u_new = self.system(z, p, rate)
        return np.asarray(x_new)[:, 0], np.asarray(u_new)[:, 0]
