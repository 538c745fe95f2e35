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

    Heading and height are constant. With these, f(x_r, u_r) = dx_r/dt at the nodes while the jerk
    is constant; what is left elsewhere is bounded where a tube is proven. On each piece a cubic in p
    through values and slopes at its ends, so that pieces join exactly.

    Attributes
    ----------
    airspeeds : array (m + 1,)
        Ends of the pieces in p, m/s.
    acceleration, jerk : float
        Largest |a| (m/s^2) and |j| (m/s^3).
    values, slopes : array (m + 1, n + 4, 5, 3)
        Factors of (a/acceleration)^l (j/jerk)^i of states and controls at the airspeeds, and their
        derivatives by p.
    """

    airspeeds: Array
    acceleration: float
    jerk: float
    values: Array
    slopes: Array

    @cached_property
    def half_widths(self) -> Array:
        """Half the length of each piece, m/s."""
        return 0.5 * np.diff(self.airspeeds)

    @cached_property
    def nodal(self) -> Array:
        """(m, 4, n + 4, 5, 3): values and slopes at the lower, then at the upper end of a piece."""
        v, s = self.values, self.slopes
        return np.stack([v[:-1], s[:-1], v[1:], s[1:]], axis=1)

    def polynomial(self, tau: Any, a: Any, j: Any, nodal: Any, half: Any) -> Any:
        """x_r and u_r as CasADi expressions: tau in [-1, 1] on a piece of half length `half`, a and
        j over their limits, `nodal` the numbers of that piece in C order.
        """
        t = 0.5 * (1 + tau)
        rows, powers = self.values.shape[1], self.values.shape[2:]

        def cubic(place: int) -> Any:
            """Hermite's cubic as a line and what bends it: exact at both ends."""
            v0, s0, v1, s1 = (nodal[k * rows * powers[0] * powers[1] + place] for k in range(4))
            rise = v1 - v0
            bend = (2 * half * s0 - rise) * (1 - t) - (2 * half * s1 - rise) * t
            return v0 + t * rise + t * (1 - t) * bend

        out = []
        for x in range(rows):
            total = 0
            for l in reversed(range(powers[0])):
                inner = 0
                for i in reversed(range(powers[1])):
                    inner = inner * j + cubic((x * powers[0] + l) * powers[1] + i)
                total = total * a + inner
            out.append(total)
        return casadi.vertcat(*out)

    def at(self, airspeed: float, acceleration: float = 0.0, jerk: float = 0.0) -> Array:
        """x_r and u_r, one vector (n + 4,)."""
        last = len(self.half_widths) - 1
        i = int(np.clip(np.searchsorted(self.airspeeds, airspeed) - 1, 0, last))
        half = self.half_widths[i]
        tau = (airspeed - self.airspeeds[i]) / half - 1
        return np.asarray(
            self.polynomial(
                tau,
                acceleration / self.acceleration,
                jerk / self.jerk,
                casadi.DM(self.nodal[i].ravel()),
                half,
            )
        ).ravel()


def reference(heli: Helicopter, airspeeds: Any, acceleration: float, jerk: float) -> Reference:
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
        values = _coefficients(points, a, j)
        slopes = CubicSpline(airspeeds, values)(airspeeds, 1)
        moving = _derivatives(values, slopes, a, j, acceleration, jerk)
        rates = moving[..., [6, 7]].reshape(-1, 2)
        target = moving[..., list(BALANCED)].reshape(-1, 8)
    return Reference(airspeeds, float(acceleration), float(jerk), values, slopes)


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


def _coefficients(points: Array, a: Array, j: Array) -> Array:
    """(m + 1, 14, 5, 3) of values (m + 1, 5, 3, 14) at the nodes."""
    in_a, in_j = (np.linalg.inv(np.vander(nodes, increasing=True)) for nodes in (a, j))
    return np.einsum("la,ij,majx->mxli", in_a, in_j, points)


def _derivatives(
    values: Array, slopes: Array, a: Array, j: Array, acceleration: float, jerk: float
) -> Array:
    """dx_r/dt (m + 1, 5, 3, 14) at the nodes while j is constant."""
    powers_a, powers_j = (np.vander(t, k, increasing=True) for t, k in ((a, NODES), (j, 3)))
    rising_a = np.hstack([np.zeros((NODES, 1)), powers_a[:, :-1] * np.arange(1, NODES)])
    by_p = np.einsum("mxli,al,ji->majx", slopes, powers_a, powers_j)
    by_a = np.einsum("mxli,al,ji->majx", values, rising_a, powers_j) / acceleration
    return by_p * (a * acceleration)[:, None, None] + by_a * (j * jerk)[:, None]
