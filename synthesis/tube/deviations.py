"""Deviations of a helicopter from an accelerating reference under state feedback, enclosed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np

from symheli import Helicopter
from symheli.enclosure import Domain, Form, enclose
from synthesis.tube.inequality import Coefficients, elementwise, rank_one
from synthesis.tube.reference import Reference

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Deviations:
    """de/dt of e = x - x_r(p, a, j) with u = u_r(p, a, j) + K(p) e in gusts of amplitude `gust`.

    Attributes
    ----------
    heli : Helicopter
    reference : Reference
    gains : array (m + 1, 4, n)
        K at the reference's airspeeds, linear in between; rad per SI unit.
    gust : float
        m/s, body axes, any direction.
    snap : float
        Largest |d(jerk)/dt| of the command, m/s^4.
    """

    heli: Helicopter
    reference: Reference
    gains: Array
    gust: float
    snap: float

    @cached_property
    def _functions(self) -> tuple[casadi.Function, ...]:
        """(e, w, command, data) -> de/dt with its start, and the same for e = w = 0."""
        SX, n = casadi.SX, len(self.heli.states)
        e, w, lam = SX.sym("e", n), SX.sym("w", 3), SX.sym("lam", 2)
        command = SX.sym("command", 4)  # tau in [-1, 1], a, j, snap over their limits
        tau, a, j, snap = (command[i] for i in range(4))
        nodal = self.reference.nodal[0].shape
        count, K = int(np.prod(nodal)), 4 * n
        data = SX.sym("data", 1 + count + 2 * K)
        half = data[0]
        x_u = self.reference.polynomial(tau, a, j, data[1 : 1 + count], half)
        first, last = data[1 + count : 1 + count + K], data[1 + count + K :]
        ends = [casadi.reshape(part, 4, n) for part in (first, last)]
        gain = ends[0] + (ends[1] - ends[0]) * (0.5 * (1 + tau))
        x, u = x_u[:n], x_u[n:]
        r = self.reference
        along = casadi.vertcat(
            a * r.acceleration / half, j * r.jerk / r.acceleration, snap * (self.snap / r.jerk)
        )
        moving = casadi.jacobian(x, casadi.vertcat(tau, a, j)) @ along
        given = [e, w, command, data]
        at = (x + e, u + gain @ e, w * self.gust)
        f, balance = self.heli.implicit(*at, lam)
        f0, balance0 = self.heli.implicit(x, u, SX.zeros(3), lam)
        return (
            casadi.Function("deviation", [*given, lam], [f - moving, balance]),
            casadi.Function("inflow", given, [self.heli.inflow(*at)]),
            casadi.Function("drift", [command, data, lam], [f0 - moving, balance0]),
            casadi.Function("inflow", [command, data], [self.heli.inflow(x, u, SX.zeros(3))]),
        )

    def enclosed(
        self, pieces: Array, lower: Array, upper: Array, factors: Array
    ) -> list[Coefficients | None]:
        """The sets of F over N parts: pieces (N,) of the reference, commands (tau, a, j over their
        limits) between `lower` and `upper` (N, 3), deviations e = factor z, |z| <= 1 (N, n, n).

        By the mean value theorem along segments from e = 0, w = 0. None where there is no bound.
        """
        full, start, drift, start0 = self._functions
        n, N = len(self.heli.states), len(pieces)
        data = Domain.point(np.stack([self._data(i) for i in pieces]))
        ends = np.ones((N, 1))
        command = Domain.box(np.hstack([lower, -ends]), np.hstack([upper, ends]))
        found = enclose(
            full,
            Domain.ellipsoid(np.zeros((N, n)), factors),
            Domain.ellipsoid(np.zeros(3), np.eye(3)),
            command,
            data,
            start=start,
            by=[0, 1],
        )
        drifting = enclose(drift, command, data, start=start0)
        finite = found.finite & drifting.finite
        assert found.jacobian is not None
        return [
            self._coefficients(found.jacobian[i], found.symbols, drifting.value[i], factors[i])
            if finite[i]
            else None
            for i in range(N)
        ]

    def _coefficients(
        self, jacobian: Form, symbols: int, drift: Form, factor: Array
    ) -> Coefficients:
        n = len(factor)
        q = n + 5
        units = np.concatenate([np.linalg.norm(factor, axis=1), np.ones(5)])
        slopes = np.zeros((jacobian.slopes.shape[-1], n, q))
        slopes[..., : n + 3] = np.moveaxis(jacobian.slopes, -1, 0)
        slopes[: n + 3] *= 0.5  # averages over segments: half of what is linear in e and w
        tube, gust = slopes[:n], slopes[n : n + 3]
        gust[:, :, :n] += _exchanged(tube[:, :, n : n + 3], factor)
        tube[:, :, n : n + 3] = 0.0
        rest = np.zeros((n, q))
        rest[:, : n + 3] = jacobian.rest
        rest += np.abs(slopes[n + 3 : symbols]).sum(axis=0)
        rest += 1e-13 * (np.abs(gust).sum(axis=0))
        centre = np.zeros((n, q))
        centre[:, : n + 3] = jacobian.centre
        centre[:, -2], centre[:, -1] = drift.slopes[:, 3], drift.centre
        rest[:, -1] = drift.rest + np.abs(drift.slopes[:, :3]).sum(axis=1)
        left, weights, more = rank_one(slopes[symbols:], units)
        rows, diagonal = elementwise((rest + more) * (1 + 1e-12), units)
        return Coefficients(
            centre, tube, gust, np.vstack([left, rows]), np.concatenate([weights, diagonal])
        )

    def _data(self, piece: int) -> Array:
        """Numbers of one piece: half its length, values of the reference, gains at its ends."""
        r = self.reference
        return np.concatenate(
            [
                [r.half_widths[piece]],
                r.nodal[piece].ravel(),
                self.gains[piece].ravel(order="F"),
                self.gains[piece + 1].ravel(order="F"),
            ]
        )


def _exchanged(tube: Array, factor: Array) -> Array:
    """z_k H_k w as y_m G_m e: the same sum, since z = factor^-1 e and w = y."""
    inverse = np.linalg.inv(factor)
    return np.einsum("knm,ke->mne", tube, inverse)
