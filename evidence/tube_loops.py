"""Tubes of loops with the parts of a real one: governor, observer, servos, a sampled controller.

The table of `python -m evidence.tubes --only loops`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi
import numpy as np
from scipy.linalg import expm

from symheli import Helicopter
from symheli.codegen.compile import compiled
from symheli.flight import XCELL_SERVOS
from synthesis import Tube, tube
from synthesis.tubes.reference import Reference

Array = np.ndarray

EIGHT = ("u", "v", "w", "p", "q", "r", "phi", "theta")
"""States that are measured."""
COARSE = dict(XCELL_SERVOS)
FINE = {name: replace(servo, steps=None) for name, servo in XCELL_SERVOS.items()}
"""The servos of the X-Cell, with the steps of their commands and without."""
PERIOD = 0.02
"""s"""


@dataclass(frozen=True)
class Case:
    """A loop: words, helicopter, airspeed or range, gusts in m/s, governor, arguments of `tube`."""

    words: str
    vehicle: str
    airspeed: Any
    gust: float
    governor: str = "ideal"
    given: Mapping[str, Any] = field(default_factory=dict)

    def found(self) -> Tube:
        """The tube."""
        heli = Helicopter.load(self.vehicle, governor=self.governor)  # type: ignore[arg-type]
        return tube(heli, self.airspeed, gust=self.gust, **self.given)


@dataclass(frozen=True)
class Sampled:
    """Nonlinear flights of a loop at one airspeed from the time `phase` s after a sample, whole
    steps of Runge and Kutta's method of order 4; deviations jump at each sample.
    """

    found: Tube
    step: float
    phase: int = 0

    @property
    def _reference(self) -> Reference:
        reference = self.found.deviations.reference
        assert isinstance(reference, Reference)
        return reference

    def flown(self, e: Array, gust: Callable[[int], Array], steps: int) -> tuple[Array, Array]:
        """The largest e'P e of each flight (N,), and the last deviations (N, n)."""
        loop, r, count = self.found.deviations, self._reference, len(e)
        rhs, period = compiled(loop.rate).map(count), r.equipment.period
        each = round(period / self.step)
        c, jump = np.zeros((1 + len(r.ranges) + len(r.whole), count)), r.jump
        data = np.repeat(r.data[:1], count, axis=0).T

        def rate(e: Array, w: Array) -> Array:
            size = w.T / (loop.gust or 1.0)
            return np.asarray(rhs(e.T, size, c, data)).T

        h, most, k = self.step, np.zeros(count), self.phase
        for i in range(steps):
            w = gust(i)
            a = rate(e, w)
            b = rate(e + h / 2 * a, w)
            d = rate(e + h / 2 * b, w)
            e = e + h / 6 * (a + 2 * b + 2 * d + rate(e + h * d, w))
            k += 1
            P = self.found.at(h * k if jump is not None else self.found.nodes[0])
            most = np.maximum(most, np.einsum("ki,ij,kj->k", e, P, e))
            if jump is not None and k == each:
                k, e = 0, e @ jump.T
                most = np.maximum(most, np.einsum("ki,ij,kj->k", e, self.found.P[0], e))
        return most, e


def step_of(found: Tube, longest: float) -> float:
    """The longest step, s, no longer than this, of which a sample period has a whole number."""
    period = found.deviations.reference.equipment.period  # type: ignore[union-attr]
    return period / np.ceil(period / longest) if period else longest


def from_border(found: Tube, count: int, seconds: float, longest: float = 0.005) -> float:
    """The largest sqrt(e'P e) of flights at one airspeed that start on the border at all times
    between two samples, in gusts of full size that change at random, slowly and fast.
    """
    step, rng = step_of(found, longest), np.random.default_rng(0)
    phases = len(found.nodes) > 1 and found.deviations.reference.jump is not None
    each = round(found.nodes[-1] / step) if phases else 1
    out = 0.0
    for phase in range(each):
        P = found.at(phase * step if phases else found.nodes[0])
        own = count // each
        e = rng.standard_normal((own, len(P)))
        e = np.linalg.solve(np.linalg.cholesky(P).T, e.T).T
        e /= np.sqrt(np.einsum("ki,ij,kj->k", e, P, e))[:, None]
        lasts, w = rng.integers(1, 100, own), np.zeros((own, 3))

        def gust(k: int, w: Array = w, lasts: Array = lasts, own: int = own) -> Array:
            new = rng.standard_normal((own, 3))
            new *= found.deviations.gust / np.linalg.norm(new, axis=1, keepdims=True)
            w[k % lasts == 0] = new[k % lasts == 0]
            return w.copy()

        most, _ = Sampled(found, step, phase).flown(e, gust, round(seconds / step))
        out = max(out, float(most.max() ** 0.5))
    return out


def worst(found: Tube, directions: int, seconds: float, longest: float = 0.005) -> float:
    """The largest sqrt(e'P e) of flights from the reference at one airspeed, each in the gust that
    drives the linear loop furthest in one direction at the end of a sample period.
    """
    loop, r, step = found.deviations, found.deviations.reference, step_of(found, longest)
    e, w = casadi.SX.sym("e", len(loop.states)), casadi.SX.sym("w", loop.disturbances)
    c = np.zeros(1 + len(r.ranges) + len(r.whole))
    rate = loop.rate(e, w, c, r.data[0])
    slopes = casadi.Function("AE", [e, w], [casadi.jacobian(rate, e), casadi.jacobian(rate, w)])
    A, E = (np.asarray(m) for m in slopes(np.zeros(len(loop.states)), np.zeros(3)))
    n, jump = len(A), r.jump
    each = round(found.nodes[-1] / step) if jump is not None else 1
    steps = each * round(seconds / step / each)
    root = np.linalg.cholesky(found.P[-1])
    rng = np.random.default_rng(0)
    unit = np.vstack([np.eye(n), -np.eye(n), rng.standard_normal((directions, n))])
    adjoint, back, rows = (root @ unit.T).T, expm(A * step), []
    for k in range(steps):
        if jump is not None and k and k % each == 0:
            adjoint = adjoint @ jump
        rows.append(adjoint @ E)
        adjoint = adjoint @ back
    history = np.array(rows[::-1])
    history *= loop.gust / np.maximum(np.linalg.norm(history, axis=-1, keepdims=True), 1e-300)
    start = np.zeros((len(unit), n))
    most, _ = Sampled(found, step).flown(start, lambda k: history[k], steps)
    return float(most.max() ** 0.5)
