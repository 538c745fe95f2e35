"""References along a transition: level, straight flight with a commanded airspeed that accelerates,
consistent with the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi
import numpy as np
from scipy.interpolate import CubicSpline

from symheli import Helicopter, trim
from symheli.errors import InputError, TrimError

Array = np.ndarray

SWEEPS = 5
"""Times the derivatives of the reference are put back into the equations it solves."""
NEWTON_STEPS = 30
TOLERANCE = 1e-9
"""Of the accelerations at the nodes, m/s^2 and rad/s^2."""
NODES = 5
"""Chebyshev nodes in acceleration; three in jerk."""
FREE = (6, 7, 8, 9)
"""States solved for with the four controls: phi, theta, a1, b1."""
BALANCED = (0, 1, 2, 3, 4, 5, 8, 9)
"""States whose derivatives the controls and the free states bring about."""


@dataclass(frozen=True, eq=False)
class Reference:
    """States and controls x_r, u_r of the commanded airspeed p, its acceleration a and jerk j.

    Heading and height are constant. With these, f(x_r, u_r) = dx_r/dt at the nodes, but for the
    motion of j; what is left between them is bounded where a tube is proven.

    Attributes
    ----------
    airspeeds : array (m + 1,)
        Breaks in p, m/s.
    acceleration, jerk : float
        Largest |a| (m/s^2) and |j| (m/s^3).
    coefficients : array (m, n + 4, 4, 5, 3)
        Of tau^k (a/acceleration)^l (j/jerk)^i on each piece, tau in [-1, 1]; states, then controls.
    """

    airspeeds: Array
    acceleration: float
    jerk: float
    coefficients: Array

    @cached_property
    def half_widths(self) -> Array:
        """Half the length of each piece, m/s."""
        return 0.5 * np.diff(self.airspeeds)

    def at(self, airspeed: float, acceleration: float = 0.0, jerk: float = 0.0) -> Array:
        """x_r and u_r, one vector (n + 4,)."""
        i = int(np.clip(np.searchsorted(self.airspeeds, airspeed) - 1, 0, len(self.half_widths) - 1))
        tau = (airspeed - self.airspeeds[i]) / self.half_widths[i] - 1
        powers = (
            tau ** np.arange(4),
            (acceleration / self.acceleration) ** np.arange(NODES),
            (jerk / self.jerk) ** np.arange(3),
        )
        return np.einsum("xkli,k,l,i->x", self.coefficients[i], *powers)


def reference(
    heli: Helicopter, airspeeds: Any, acceleration: float, jerk: float
) -> Reference:
    """The reference of a helicopter whose governor is "ideal", for airspeeds between the first and
    the last of `airspeeds` (m/s, rising), accelerations up to `acceleration` (m/s^2) and jerk up to
    `jerk` (m/s^3).

    At each node Newton's method balances the accelerations with attitude, flapping and controls;
    rates of turn and derivatives come from the reference itself, sweep by sweep. Between nodes:
    cubic splines in p, polynomials in a and j.

    Raises
    ------
    InputError
        For another governor, airspeeds that do not rise, an acceleration or jerk <= 0.
    TrimError
        Where no balance is found.
    """
    airspeeds = np.asarray(airspeeds, float)
    if heli.governor != "ideal" or len(heli.states) != 10:
        raise InputError(
            "a reference needs the ten states of governor='ideal': Helicopter.load(...,"
            " governor='ideal')"
        )
    if airspeeds.ndim != 1 or len(airspeeds) < 4 or not np.all(np.diff(airspeeds) > 0):
        raise InputError("airspeeds must be four or more rising numbers, m/s")
    if not (acceleration > 0 and jerk > 0):
        raise InputError("acceleration (m/s^2) and jerk (m/s^3) must be positive")
    a, j = -np.cos(np.pi * np.arange(NODES) / (NODES - 1)), np.array([-1.0, 0.0, 1.0])
    shape = (len(airspeeds), NODES, 3)
    p = np.broadcast_to(airspeeds[:, None, None], shape).ravel()
    trims = [trim(heli, airspeed=float(v)) for v in airspeeds]
    start = np.array([[*np.array(t.x)[list(FREE)], *np.array(t.u)] for t in trims])
    free = np.broadcast_to(start[:, None, None], (*shape, 8)).reshape(-1, 8)
    balance = _balance(heli)
    rates, target = np.zeros((len(p), 2)), np.zeros((len(p), 8))
    for _ in range(SWEEPS):
        free = _newton(balance, free, np.column_stack([p, rates, target]))
        points = _states(p, free, rates).reshape(*shape, 14)
        coefficients = _coefficients(points, airspeeds, a, j)
        moving = _derivatives(coefficients, airspeeds, a, j, acceleration, jerk)
        rates = moving[..., [6, 7]].reshape(-1, 2)
        target = moving[..., list(BALANCED)].reshape(-1, 8)
    return Reference(airspeeds, float(acceleration), float(jerk), coefficients)


def _states(p: Any, free: Any, rates: Any) -> Any:
    """States and controls (N, 14): level flight at p with attitude and its rates."""
    phi, theta = free[:, 0], free[:, 1]
    return np.column_stack(
        [
            p * np.cos(theta),
            p * np.sin(phi) * np.sin(theta),
            p * np.cos(phi) * np.sin(theta),
            rates[:, 0],
            rates[:, 1] * np.cos(phi),
            -rates[:, 1] * np.sin(phi),
            free,
        ]
    )


def _balance(heli: Helicopter) -> casadi.Function:
    """(free (8), [p, phi', theta', target (8)]) -> residual (8) and its Jacobian."""
    free, given = casadi.SX.sym("free", 8), casadi.SX.sym("given", 11)
    p, rates = given[0], (given[1], given[2])
    phi, theta = free[0], free[1]
    x = casadi.vertcat(
        p * casadi.cos(theta),
        p * casadi.sin(phi) * casadi.sin(theta),
        p * casadi.cos(phi) * casadi.sin(theta),
        rates[0],
        rates[1] * casadi.cos(phi),
        -rates[1] * casadi.sin(phi),
        free[:4],
    )
    f = heli.rhs(x, free[4:], casadi.SX.zeros(3))
    residual = casadi.vertcat(*[f[i] for i in BALANCED]) - given[3:]
    return casadi.Function(
        "balance", [free, given], [residual, casadi.densify(casadi.jacobian(residual, free))]
    )


def _newton(balance: casadi.Function, free: Array, given: Array) -> Array:
    count = len(free)
    mapped = balance.map(count)
    for _ in range(NEWTON_STEPS):
        residual, slope = (np.asarray(m) for m in mapped(free.T, given.T))
        if np.max(np.abs(residual)) < TOLERANCE:
            return free
        slopes = np.stack(np.split(slope, count, axis=1))
        free = free - np.linalg.solve(slopes, residual.T[..., None])[..., 0]
        if not np.all(np.isfinite(free)):
            break
    raise TrimError(
        "no accelerating flight balances the equations for some airspeed, acceleration and jerk:"
        " reduce them"
    )


def _coefficients(points: Array, airspeeds: Array, a: Array, j: Array) -> Array:
    """(m, 14, 4, 5, 3) of values (m + 1, 5, 3, 14) at the nodes."""
    in_a, in_j = (np.linalg.inv(np.vander(nodes, increasing=True)) for nodes in (a, j))
    spline = CubicSpline(airspeeds, np.einsum("la,ij,majx->mxli", in_a, in_j, points))
    local = spline.c[::-1]  # powers of p - p_m, (4, m, 14, 5, 3)
    half = 0.5 * np.diff(airspeeds)
    # p - p_m = half (1 + tau)
    shift = np.array([[1, 1, 1, 1], [0, 1, 2, 3], [0, 0, 1, 3], [0, 0, 0, 1]], float)
    scale = half[:, None] ** np.arange(4)
    return np.einsum("tk,mk,kmxli->mxtli", shift, scale, local)


def _derivatives(
    coefficients: Array, airspeeds: Array, a: Array, j: Array, acceleration: float, jerk: float
) -> Array:
    """dx_r/dt (m + 1, 5, 3, 14) at the nodes where j is constant."""
    half = 0.5 * np.diff(airspeeds)
    powers = (lambda t, k: t ** np.arange(k), lambda t, k: np.r_[0, np.arange(1, k) * t ** np.arange(k - 1)])
    out = np.zeros((len(airspeeds), len(a), len(j), coefficients.shape[1]))
    for m in range(len(airspeeds)):
        piece, tau = (m, -1.0) if m < len(half) else (m - 1, 1.0)
        values, slopes = powers[0](tau, 4), powers[1](tau, 4)
        for l, t in enumerate(a):
            for i, s in enumerate(j):
                c = coefficients[piece]
                by_p = np.einsum("xkli,k,l,i->x", c, slopes, powers[0](t, 5), powers[0](s, 3))
                by_a = np.einsum("xkli,k,l,i->x", c, values, powers[1](t, 5), powers[0](s, 3))
                out[m, l, i] = by_p / half[piece] * t * acceleration + by_a / acceleration * s * jerk
    return out
