"""Deviations of a helicopter from steady flight under state feedback, over an ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi
import numpy as np

from symheli import Helicopter
from symheli.enclosure import AffineForm, Domain, enclose
from symheli.values.summary import summarized
from synthesis.tubes.inequality import ROUNDED, ROUNDED_UP, MatrixSet, elementwise, rank_one

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Deviations:
    """de/dt of e = x - x0 with u = u0 + K e in gusts of amplitude `gust`.

    x (n,) and u (4,): steady flight, SI and rad. gain (4, n): K, rad per SI unit. gust: m/s, body
    axes, any direction.
    """

    heli: Helicopter
    x: Array
    u: Array
    gain: Array
    gust: float

    __repr__ = summarized

    @cached_property
    def _functions(self) -> tuple[casadi.Function, casadi.Function]:
        """(e, w, lam) -> de/dt, balance of the inflow; (e, w) -> lam."""
        e, w, lam = casadi.SX.sym("e", len(self.x)), casadi.SX.sym("w", 3), casadi.SX.sym("lam", 2)
        at = (self.x + e, self.u + self.gain @ e, self.gust * w)
        function = casadi.Function("deviation", [e, w, lam], list(self.heli.implicit(*at, lam)))
        return function, casadi.Function("inflow", [e, w], [self.heli.inflow(*at)])

    def enclosed(self, factor: Array) -> MatrixSet | None:
        """The set of F for e = factor z, |z| <= 1, and all gusts; None where there is no bound.

        f(e, w) - f(0, 0) = J [e; w] with the average J of the Jacobian over the segment to (e, w):
        the part of J that is linear in (e, w) is halved.
        """
        function, start = self._functions
        n = len(factor)
        zero, ball = np.zeros(n), Domain.ellipsoid(np.zeros(3), np.eye(3))
        over = (Domain.ellipsoid(zero, factor), ball)
        found = enclose(function, *over, start=start, by=[0, 1])
        rest = enclose(function, Domain.point(zero), Domain.point(np.zeros(3)), start=start).value
        if not (found.finite and np.all(np.isfinite(rest.rest))):
            return None
        return _coefficients(found.segment_average(), found.symbols, rest, factor)


def _coefficients(
    average: AffineForm, symbols: int, at_rest: AffineForm, factor: Array
) -> MatrixSet:
    n = len(factor)
    q = n + 4
    units = np.concatenate([np.linalg.norm(factor, axis=1), np.ones(4)])
    slopes = np.zeros((average.slopes.shape[-1], n, q))
    slopes[..., :-1] = np.moveaxis(average.slopes, -1, 0)
    tube, gust = slopes[:n], slopes[n:symbols]
    centre, rest = np.zeros((n, q)), np.zeros((n, q))
    centre[:, :-1], centre[:, -1] = average.centre, at_rest.centre
    rest[:, :-1], rest[:, -1] = average.rest, at_rest.rest
    # z_k H_k w = y_m G_m e, since z = factor^-1 e and y = w: one multiplier takes both
    inverse, wind = np.linalg.inv(factor), slice(n, n + 3)
    cross = tube[:, :, wind].copy()
    gust[:, :, :n] += np.einsum("knm,ke->mne", cross, inverse)
    tube[:, :, wind] = 0.0
    products = np.einsum("knm,ke->ne", np.abs(cross), np.abs(inverse))
    rest[:, :n] += ROUNDED * (products + np.abs(gust[:, :, :n]).sum(axis=0))
    missed = np.abs(np.eye(n) - inverse @ factor) + ROUNDED * np.abs(inverse) @ np.abs(factor)
    rest[:, wind] += missed.sum(axis=1).max() * np.abs(cross).sum(axis=0)
    left, weights, more = rank_one(slopes[symbols:], units)
    rows, diagonal = elementwise((rest + more) * ROUNDED_UP, units)
    return MatrixSet(
        centre, tube, gust, np.vstack([left, rows]), np.concatenate([weights, diagonal])
    )
