"""Accelerated level flight along a range of airspeeds, and the feedback about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_continuous_lyapunov

from symheli import Helicopter, trim
from symheli.errors import TrimError
from symheli.flight import Servo
from symheli.lpv.tools import Actuation
from symheli.progress import task
from symheli.steady import trim_batch
from symheli.steady.newton import newton
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.tubes.controllers import Choice
from synthesis.tubes.equipment import LoopEquipment

TUBE_SIZES = (0.4, 0.5, 0.8, 0.1, 0.1, 0.3, 0.08, 0.06, 0.02, 0.02, 3.0, 3.0)
"""Half widths of equal weight in the size of a tube, m/s, rad/s, rad; rotor speed, rad/s,
and the governor's integral, rad."""
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
    likewise, plus V(p) b; Y, V and K linear in p. One node: a held airspeed. The states of a
    controller and of servos come after those of the helicopter, the further rows of K are their
    rates; they are deviations, with 0 as their reference.

    airspeeds (k,): nodes, m/s. steady (k, 2, powers, n + 4): values of X_i at the nodes, states and
    controls, and their slopes by airspeed. jerk (k, n + 4): Y; snap (k, 4): V. gain (k, 4 + c, n +
    c): of the controller with c states, rad per SI unit. limits (3,): the largest sizes of a, j and
    b, m/s^2, m/s^3, m/s^4; b infinite where the jerk may jump (Y and V are then 0 for all states).
    """

    airspeeds: Array
    steady: Array
    jerk: Array
    snap: Array
    gain: Array
    limits: tuple[float, float, float]
    equipment: LoopEquipment = field(default_factory=LoopEquipment)

    __repr__ = summarized

    drifts = True
    """Whether the reference may miss the equations."""

    @property
    def own(self) -> int:
        """n, the number of states of the helicopter."""
        return self.steady.shape[3] - 4

    @property
    def sampled(self) -> bool:
        """Whether the scheduling command is the time since the last sample, s, at one airspeed."""
        return self.equipment.period > 0

    @property
    def jacobian_parts(self) -> tuple[int, int]:
        """Parts of a cell along airspeed and acceleration over which the Jacobian is enclosed,"""
        return (1, 1) if self.sampled else (4, 4)

    @property
    def drift_parts(self) -> tuple[int, int]:
        """and the drift of the reference; the clock changes neither."""
        return (1, 1) if self.sampled else (16, 16)

    @cached_property
    def nodes(self) -> Array:
        """Nodes of the scheduling command: the airspeeds, or the time since the last sample."""
        own = self.equipment
        return np.linspace(0.0, own.period, own.parts + 1) if self.sampled else self.airspeeds

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Ranges of the commands that cells split besides the airspeed: the acceleration; 1 of a
        clock.
        """
        return ((1.0, 1.0),) if self.sampled else ((-self.limits[0], self.limits[0]),)

    @cached_property
    def closed(self) -> Array:
        """K (k, 4 + m, n + m): blade pitch and the rates of the m further states."""
        return self.equipment.flow(self.gain)

    @property
    def jump(self) -> Array | None:
        """(n + m, n + m): the deviation after a sample by that before; None: there are none."""
        return self.equipment.jump(self.gain)

    @property
    def whole(self) -> tuple[float, ...]:
        """Largest sizes of the others, jerk and its derivative; 0 where it may jump."""
        return tuple(limit if np.isfinite(limit) else 0.0 for limit in self.limits[1:])

    @property
    def jumps(self) -> bool:
        """Whether a state may jump: with the jerk, or as a command that is held has limits."""
        with_jerk = np.any(self.jerk[:, : self.own]) or np.any(self.snap)
        held = len(self.airspeeds) == 1 and any(self.limits)
        return bool(held or (np.isinf(self.limits[2]) and with_jerk))

    def hypotheses(self, name: str, gust: float, states: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Hypotheses of a tube about it, in sentences."""
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
            f"the equations of {name}",
            *self.equipment.sentences(self.gain, states),
            f"{command}; gusts have at most {gust:g} m/s, any direction in body axes and any"
            " history",
        )

    @property
    def intervals(self) -> int:
        """Number of intervals between nodes, 1 for a held airspeed."""
        return max(len(self.nodes) - 1, 1)

    @cached_property
    def data(self) -> Array:
        """Data that `between` takes of each interval, (intervals, .)."""
        i = np.arange(self.intervals)
        ends = [0 * i, 0 * i] if self.sampled else [i, i + (len(self.airspeeds) > 1)]
        p = np.stack([self.airspeeds[i] for i in ends], axis=1)
        if len(self.airspeeds) == 1:
            p = p + np.array([0.0, 1.0])
        given = (self.steady, self.jerk, self.snap, self.closed)
        parts = [m[i].reshape(len(i), -1) for m in given for i in ends]
        return np.hstack([p, *parts])

    def between(self, data: Any, c: Any) -> tuple[Any, Any, Any, Any]:
        """(x_r, dx_r/dt, u_r, K) in CasADi; data: of an interval; c = (s, a, j, b), s in [0, 1] the
        position between its nodes. Of the further states 0; the controls after the first four are
        their rates.
        """
        z, moving, added, K = self._along(data, c)
        n, further = self.own, casadi.SX.zeros(1, self.equipment.count)
        u = casadi.horzcat(z[n:] + added, further)
        if self.equipment.bank is not None:  # its states follow the rest of the controls alone
            forward = zip(self.equipment.forward, (moving[n:], added), strict=True)
            u = casadi.horzcat(z[n:], sum((by @ casadi.DM(M.T) for M, by in forward), further))
        x, moving = (casadi.horzcat(row[:n], further) for row in (z, moving))
        return x.T, moving.T, u.T, K

    def commands(self, data: Any, c: Any) -> Any:
        """The controls u_r (4,) in CasADi, as `between`, as they are commanded."""
        z, _, added, _ = self._along(data, c)
        return (z[self.own :] + added).T

    def _along(self, data: Any, c: Any) -> tuple[Any, Any, Any, Any]:
        """State and controls (1, n + 4) but for what is added to the controls where the jerk
        changes (1, 4), the rates of the first, and K.
        """
        powers, n = self.steady.shape[2], self.own
        place = 2

        def part(rows: int, columns: int) -> Any:
            nonlocal place
            place += rows * columns
            return casadi.reshape(data[place - rows * columns : place], columns, rows).T

        s, a, j, snap, width = *casadi.vertsplit(c), data[1] - data[0]
        (y0, m0), (y1, m1) = (casadi.vertsplit(part(2 * powers, n + 4), powers) for _ in range(2))
        (Y0, Y1), (V0, V1), (K0, K1) = (
            [part(*shape) for _ in range(2)]
            for shape in ((1, n + 4), (1, 4), self.closed.shape[1:])
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
        return z, moving, (V0 + s * (V1 - V0)) * snap, K0 + s * (K1 - K0)

    def place(self, commands: Any) -> tuple[Array, Array]:
        """Intervals of airspeeds (N,) within the range, m/s, or of times since a sample, and their
        shares of the way along it, (N,).
        """
        p, nodes = np.asarray(commands, float), self.nodes
        i = np.clip(np.searchsorted(nodes, p) - 1, 0, self.intervals - 1)
        width = nodes[i + 1] - nodes[i] if len(nodes) > 1 else 1.0
        return i, (p - nodes[i]) / width


def held(
    heli: Helicopter,
    airspeed: Any,
    choice: Choice | None = None,
    servos: Mapping[str, Servo] | Actuation | None = None,
) -> Reference:
    """Steady level flight with the controller chosen, behind servos or a whole actuation."""
    choice = choice or Choice()
    steady = trim(heli, airspeed=airspeed)
    x, u, p = np.array(steady.x), np.array(steady.u), np.array([float(airspeed)])
    gain, states = choice.gains(heli, x[None], u[None], p)
    at = np.concatenate([x, u])[None, None, None]
    return Reference(
        p,
        np.concatenate([at, 0 * at], axis=1),
        np.zeros((1, len(x) + 4)),
        np.zeros((1, 4)),
        gain,
        (0.0, 0.0, 0.0),
        LoopEquipment(states, Actuation.of(servos, period=choice.period or None)),
    )


def moving(
    heli: Helicopter,
    airspeeds: Array,
    limits: tuple[float, float, float],
    choice: Choice | None = None,
    servos: Mapping[str, Servo] | Actuation | None = None,
) -> Reference:
    """Level flight that accelerates along these nodes, consistent with the equations where the
    acceleration stays the same, with the rates of its attitude; to first order also in a jerk that
    stays the same, where it may not jump.
    """
    choice = replace(choice or Choice(), moving=True)
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
    gain, states = choice.gains(heli, level, controls, airspeeds)
    K = gain
    if states:  # as if all states were known
        K = np.stack([choice.regulator(heli, *at) for at in zip(level, controls, strict=True)])
    by, feed = z[:, 0, 1, :n], np.zeros((k, n + 4))
    snap = np.zeros((k, 4))
    for i, at in enumerate(zip(level, controls, K, strict=True)):
        if np.isfinite(limits[2]):
            feed[i] = _in_jerk(heli, *at[:2], by[i])
            snap[i] = _against(heli, *at, feed[i, :n])
        else:
            feed[i, n:] = _against(heli, *at, by[i])
    return Reference(
        airspeeds, z, feed, snap, gain, limits, LoopEquipment(states, Actuation.of(servos))
    )


def _in_jerk(heli: Helicopter, x: Array, u: Array, by: Array) -> Array:
    """Y (n + 4,): rates, flapping and controls with which the state moves as the reference does,
    velocity and attitude being given, by least squares; by: dx_r/da.
    """
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    free = [i for i, name in enumerate(heli.states) if str(name) not in GIVEN]
    free += range(len(x), len(x) + 4)
    sizes, Y = np.array(TUBE_SIZES[: len(x)]), np.zeros(len(x) + 4)
    rows = np.hstack([A, B])[:, free] / sizes[:, None]
    Y[free] = np.linalg.lstsq(rows, by / sizes, rcond=None)[0]
    return Y


def _against(heli: Helicopter, x: Array, u: Array, K: Array, by: Array) -> Array:
    """(4,): the controls with which the reference's motion `by` moves the deviation least: the
    square of the linear loop's response to an impulse, in units of equal weight.
    """
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    X = solve_continuous_lyapunov((A + B @ K).T, -np.diag(np.array(TUBE_SIZES[: len(x)]) ** -2.0))
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
