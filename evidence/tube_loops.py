"""Tubes of loops with the parts of a real one: governor, observer, servos, a sampled controller.

The table of `python -m evidence.tubes --only loops`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import casadi
import numpy as np
from scipy.linalg import expm

from evidence.tables import markdown
from symheli import Helicopter
from symheli.codegen.compile import compiled
from symheli.dynamics import Governor
from symheli.flight import XCELL_SERVOS
from synthesis import Tube, tube
from synthesis.tubes.reference import Reference

Array = np.ndarray
Worst = Callable[[Tube], float]
Border = Callable[[Tube, int, float], float]

EIGHT = ("u", "v", "w", "p", "q", "r", "phi", "theta")
"""States that are measured."""
TEN = (*EIGHT, "a1", "b1")
TWELVE = (*TEN, "Om", "om_i")
FINE = {name: replace(servo, steps=None) for name, servo in XCELL_SERVOS.items()}
"""The servos of the X-Cell without the steps of their commands."""
PERIOD = 0.02
"""s"""
LONGEST = 0.005
"""Step of Runge and Kutta's method, s, at most."""
FLIGHTS, SECONDS = 500, 0.25
"""From the border of a tube, and how long each lasts: what leaves it leaves at once."""
DIRECTIONS, HORIZON = 10, 5.0
"""Gusts that are worst for the linear loop: so many directions besides those of each state, and how
long the flights last, s.
"""


@dataclass(frozen=True)
class Case:
    """A loop: words, vehicle, governor, airspeed or range, gusts in m/s, arguments of `tube`."""

    words: str
    vehicle: str
    governor: Governor
    airspeed: Any
    gust: float
    given: Mapping[str, Any] = field(default_factory=dict)

    def found(self) -> Tube:
        """The tube."""
        heli = Helicopter.load(self.vehicle, governor=self.governor)
        return tube(heli, self.airspeed, gust=self.gust, **self.given)


CASES = (
    Case("ten states", "xcell60", "pi", 3.0, 0.25),
    Case("twelve states", "xcell60", "pi", 3.0, 0.25, {"known": TWELVE}),
    Case("eight states, observer", "xcell60", "ideal", 3.0, 0.25, {"known": EIGHT}),
    Case("eight states, observer", "xcell60", "pi", 3.0, 0.25, {"known": EIGHT}),
    Case("ten states, servos", "xcell60", "ideal", 3.0, 0.25, {"servos": FINE}),
    Case("ten states, servos with steps", "xcell60", "ideal", 3.0, 0.25, {"servos": XCELL_SERVOS}),
    Case("ten states, 50 Hz", "xcell60", "ideal", 3.0, 0.25, {"period": PERIOD}),
    Case("ten states, 50 Hz, delay", "xcell60", "ideal", 3.0, 0.25, {"period": PERIOD, "delay": 1}),
)
"""Delay: one period from the sample to the command."""
GOVERNED = (Case("eight states, observer", "xcell_kahn_hudson", "pi", 3.0, 0.25, {"known": EIGHT}),)
"""Another helicopter, whose governor is slow."""


def row(case: Case, worst: Worst, border: Border) -> list[str]:
    """Its row of the table; worst gust and flights from the border of a loop in continuous time as
    given.
    """
    found, p = case.found(), case.airspeed
    cells = [
        *(case.vehicle, case.governor, case.words),
        f"{p:g}" if np.ndim(p) == 0 else f"{p[0]:g} to {p[1]:g}",
        f"{case.gust:g}",
        str(len(found.deviations.states)),
    ]
    if not found.proven:
        return [*cells, f"none: {found.why}", "", "", ""]
    widths = [f"{w:.2g}" for w in found.half_widths[:8]]
    if found.deviations.reference.jump is None:
        share, furthest = worst(found), border(found, FLIGHTS, SECONDS)
    else:
        share, furthest = worst_gust(found), from_border(found, FLIGHTS, SECONDS)
    cells += [" ".join(widths[:3]) + "; " + " ".join(widths[3:6]), " ".join(widths[6:])]
    return [*cells, f"{share:.2f}", f"{furthest:.3f}"]


def table(cases: Sequence[Case], worst: Worst, border: Border) -> str:
    """The table in Markdown, a row for each loop; as `row`."""
    rows = []
    for case in cases:
        rows.append(row(case, worst, border))
        print(*rows[-1], flush=True)
    head = ["helicopter", "governor", "the controller knows", "airspeed, m/s", "gusts, m/s"]
    head += ["states", "u v w, m/s; p q r, rad/s", "phi theta, rad"]
    return markdown([*head, "worst gust found", "furthest flight"], rows)


@dataclass(frozen=True)
class Sampled:
    """Nonlinear flights of a sampled loop that begin so many steps after a sample, by Runge and
    Kutta's method of order 4; deviations jump at each sample.
    """

    found: Tube
    step: float
    phase: int = 0

    @property
    def _reference(self) -> Reference:
        return cast(Reference, self.found.deviations.reference)

    def flown(self, e: Array, gust: Callable[[int], Array], steps: int) -> tuple[Array, Array]:
        """The largest e'P e of each flight (N,), and the last deviations (N, n)."""
        loop, r, count = self.found.deviations, self._reference, len(e)
        rhs, period = compiled(loop.rate).map(count), r.equipment.period
        each = round(period / self.step)
        c, jump = np.zeros((loop.rate.size1_in(2), count)), cast(Array, r.jump)
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
            most = np.maximum(most, np.einsum("ki,ij,kj->k", e, self.found.at(h * k), e))
            if k == each:
                k, e = 0, e @ jump.T
                most = np.maximum(most, np.einsum("ki,ij,kj->k", e, self.found.P[0], e))
        return most, e


def _step(found: Tube) -> float:
    """The longest step up to `LONGEST`, s, of which a sample period has a whole number."""
    return float(found.nodes[-1] / np.ceil(found.nodes[-1] / LONGEST))


def from_border(found: Tube, count: int, seconds: float) -> float:
    """The largest sqrt(e'P e) of flights of a sampled loop that start on the border at all times
    between two samples, in gusts of full size that change at random, slowly and fast.
    """
    step, rng, out = _step(found), np.random.default_rng(0), 0.0
    each = round(found.nodes[-1] / step)
    own = count // each
    for phase in range(each):
        P = found.at(phase * step)
        e = rng.standard_normal((own, len(P)))
        e = np.linalg.solve(np.linalg.cholesky(P).T, e.T).T
        e /= np.sqrt(np.einsum("ki,ij,kj->k", e, P, e))[:, None]
        lasts, w = rng.integers(1, 100, own), np.zeros((own, 3))

        def gust(k: int, w: Array = w, lasts: Array = lasts) -> Array:
            new = rng.standard_normal(w.shape)
            new *= found.deviations.gust / np.linalg.norm(new, axis=1, keepdims=True)
            w[k % lasts == 0] = new[k % lasts == 0]
            return w.copy()

        most, _ = Sampled(found, step, phase).flown(e, gust, round(seconds / step))
        out = max(out, float(most.max() ** 0.5))
    return out


def worst_gust(found: Tube) -> float:
    """The largest sqrt(e'P e) of flights of a sampled loop from the reference, each in the gust
    that drives the linear loop furthest in one direction at the end of a sample period.
    """
    loop, r, step = found.deviations, found.deviations.reference, _step(found)
    e, w = casadi.SX.sym("e", len(loop.states)), casadi.SX.sym("w", loop.disturbances)
    rate = loop.rate(e, w, np.zeros(loop.rate.size1_in(2)), r.data[0])
    slopes = casadi.Function("AE", [e, w], [casadi.jacobian(rate, e), casadi.jacobian(rate, w)])
    A, E = (np.asarray(m) for m in slopes(np.zeros(len(loop.states)), np.zeros(3)))
    n, jump, each = len(A), r.jump, round(found.nodes[-1] / step)
    steps = each * round(HORIZON / step / each)
    rng = np.random.default_rng(0)
    unit = np.vstack([np.eye(n), -np.eye(n), rng.standard_normal((DIRECTIONS, n))])
    adjoint, back, rows = (np.linalg.cholesky(found.P[-1]) @ unit.T).T, expm(A * step), []
    for k in range(steps):
        if k and k % each == 0:
            adjoint = adjoint @ jump
        rows.append(adjoint @ E)
        adjoint = adjoint @ back
    history = np.array(rows[::-1])
    history *= loop.gust / np.maximum(np.linalg.norm(history, axis=-1, keepdims=True), 1e-300)
    start = np.zeros((len(unit), n))
    most, _ = Sampled(found, step).flown(start, lambda k: history[k], steps)
    return float(most.max() ** 0.5)
