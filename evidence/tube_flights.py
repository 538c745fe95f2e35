"""Nonlinear flights that try to leave a tube: from its border, and in the worst gusts found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import casadi
import numpy as np
from scipy.linalg import expm

from synthesis.tubes import Tube
from synthesis.tubes.reference import Reference

Array = np.ndarray

STEP = 0.005
"""Of Runge and Kutta's method, s, at most; the fastest pole of the loops is near -40 1/s."""
HORIZON = 1000
"""Steps of a flight in the worst gusts."""
DIRECTIONS, FEWEST = 60, 10
"""In which the deviation is driven; at least so many besides those of each state."""


@dataclass(frozen=True)
class Command:
    """Commanded airspeeds middle + size sin(rate t + phase), arrays (N,): m/s, rad/s, rad."""

    middle: Array
    size: Array
    rate: Array
    phase: Array

    @classmethod
    def held(cls, found: Tube, count: int, airspeed: float | None = None) -> Command:
        """An airspeed for all, by default the first."""
        p = found.nodes[0] if airspeed is None else airspeed
        zero = np.zeros(count)
        return cls(zero + p, zero, zero, zero)

    @classmethod
    def drawn(cls, found: Tube, count: int, rng: np.random.Generator) -> Command:
        """As large as range and limits allow, of rates from slow to fast."""
        low, high = found.nodes[0], found.nodes[-1]
        rate = np.exp(rng.uniform(np.log(0.1), np.log(4.0), count))
        a, j, b = cast(Reference, found.deviations.reference).limits
        size = np.minimum.reduce([a / rate, j / rate**2, b / rate**3, 0 * rate + (high - low) / 2])
        size = size if high > low else 0 * rate
        middle = rng.uniform(low + size, high - size)
        return cls(middle, size, rate, rng.uniform(0, 2 * np.pi, count))

    def at(self, t: float) -> tuple[Array, Array, Array, Array]:
        """p, its first three derivatives, (N,); the last 0 where the jerk may jump."""
        angle, rate = self.rate * t + self.phase, self.rate
        sine, cosine = self.size * np.sin(angle), self.size * np.cos(angle)
        return self.middle + sine, rate * cosine, -(rate**2) * sine, -(rate**3) * cosine


def flown(
    found: Tube,
    e: Array,
    gust: Callable[[int], Array],
    steps: int,
    command: Command | None = None,
    step: float = STEP,
    phase: int = 0,
) -> Array:
    """The largest e'P e of each nonlinear flight (N,) from deviations e (N, n) in gusts gust(k) (N,
    3), m/s, along a command; by default the first airspeed is held. Deviations of a sampled loop
    jump at each sample, the last of which was so many steps before (`phase`).

    Runge and Kutta's method of order 4.
    """
    loop, count = found.deviations, len(e)
    reference, jump = loop.reference, loop.reference.jump
    rhs = loop.rate.map(count)
    command = command or Command.held(found, count)

    def rate(e: Array, w: Array, t: float) -> Array:
        p, *rest = command.at(t)
        i, s = reference.place(p)
        size = w.T / (loop.gust or 1.0)
        return np.asarray(rhs(e.T, size, np.stack([s, *rest]), reference.data[i].T)).T

    most = np.zeros(count)
    for k in range(steps):
        w, t = gust(k), k * step
        a = rate(e, w, t)
        b = rate(e + step / 2 * a, w, t + step / 2)
        c_ = rate(e + step / 2 * b, w, t + step / 2)
        e = e + step / 6 * (a + 2 * b + 2 * c_ + rate(e + step * c_, w, t + step))
        if jump is None:
            most = np.maximum(most, _size(e, found.along(command.at(t + step)[0])))
            continue
        phase += 1
        most = np.maximum(most, _size(e, found.at(phase * step)[None]))
        if phase == _between_samples(found, step):
            phase, e = 0, e @ jump.T
            most = np.maximum(most, _size(e, found.P[:1]))
    return most


def cells_of(found: Tube, count: int, seconds: float) -> list[str]:
    """What a row of a table says of a tube: half widths, the share that the worst gusts found fill
    from any airspeed of its nodes, and the furthest of `count` flights from its border; or why
    there is none.
    """
    if not found.verified:
        return [f"none: {found.why}", "", "", ""]
    sampled = found.deviations.reference.jump is not None
    share = max(worst(found, p) for p in ([None] if sampled else found.nodes))
    return [*widths(found), f"{share:.2f}", f"{from_its_border(found, count, seconds):.3f}"]


def from_its_border(found: Tube, count: int, seconds: float) -> float:
    """The largest sqrt(e'P e) of flights that start on the border of the tube, in gusts of full
    size that change at random, slowly and fast, along commands as large as allowed; of a sampled
    loop at all times between two samples.
    """
    rng, out = np.random.default_rng(0), 0.0
    sampled = found.deviations.reference.jump is not None
    step = _step(found) if sampled else 2 * STEP
    phases = _between_samples(found, step) if sampled else 1
    for phase in range(phases):
        own = count // phases
        command = Command.held(found, own) if sampled else Command.drawn(found, own, rng)
        P = found.along(np.full(own, phase * step) if sampled else command.at(0.0)[0])
        e = rng.standard_normal((own, P.shape[-1]))
        e = np.linalg.solve(np.swapaxes(np.linalg.cholesky(P), 1, 2), e[..., None])[..., 0]
        e /= np.sqrt(_size(e, P))[:, None]
        gust = _random_gusts(found.deviations.gust, own, rng)
        most = flown(found, e, gust, round(seconds / step), command, step, phase)
        out = max(out, float(most.max() ** 0.5))
    return out


def worst(found: Tube, airspeed: float | None = None) -> float:
    """The largest sqrt(e'P e) of nonlinear flights from the reference at an airspeed (by default
    the first), each in the gust that drives the linear loop furthest in one direction; of a sampled
    loop at the end of a period.
    """
    loop, p = found.deviations, found.nodes[0] if airspeed is None else airspeed
    reference, jump = loop.reference, loop.reference.jump
    i, s = reference.place([p])
    c, data = np.array([s[0], 0, 0, 0]), reference.data[i[0]]
    e, w = casadi.SX.sym("e", len(loop.states)), casadi.SX.sym("w", 3)
    rate = loop.rate(e, w, c, data)
    slopes = casadi.Function("AE", [e, w], [casadi.jacobian(rate, e), casadi.jacobian(rate, w)])
    A, E = (np.asarray(m) for m in slopes(np.zeros(len(loop.states)), np.zeros(3)))
    step = STEP if jump is None else _step(found)
    every = HORIZON if jump is None else _between_samples(found, step)
    root = np.linalg.cholesky(found.at(p) if jump is None else found.P[-1])
    rng = np.random.default_rng(0)
    drawn = rng.standard_normal((max(DIRECTIONS - 2 * len(A), FEWEST), len(A)))
    unit = np.vstack([np.eye(len(A)), -np.eye(len(A)), drawn])
    adjoint = (root @ unit.T).T  # direction of e'P e at the end
    back, rows = expm(A * step), []
    for k in range(every * round(HORIZON * STEP / step / every)):
        if jump is not None and k and k % every == 0:
            adjoint = adjoint @ jump
        rows.append(adjoint @ E)
        adjoint = adjoint @ back
    history = np.array(rows[::-1])
    history *= loop.gust / np.maximum(np.linalg.norm(history, axis=-1, keepdims=True), 1e-300)
    command = Command.held(found, len(unit), p)
    start = np.zeros((len(unit), len(A)))
    most = flown(found, start, lambda k: history[k], len(history), command, step)
    return float(most.max() ** 0.5)


def _size(e: Array, P: Array) -> Array:
    """e'P e of each flight."""
    return np.einsum("ki,kij,kj->k", e, np.broadcast_to(P, (len(e), *P.shape[1:])), e)


def _step(found: Tube) -> float:
    """The longest step up to `STEP`, s, of which a sample period has a whole number."""
    return float(found.nodes[-1] / np.ceil(found.nodes[-1] / STEP))


def _between_samples(found: Tube, step: float) -> int:
    """Number of steps in a sample period."""
    return round(float(found.nodes[-1]) / step)


def _random_gusts(size: float, count: int, rng: np.random.Generator) -> Callable[[int], Array]:
    """Gusts (count, 3) by the number of the step, m/s, each of which lasts 1 to 99 steps."""
    lasts, w = rng.integers(1, 100, count), np.zeros((count, 3))

    def gust(k: int) -> Array:
        new = rng.standard_normal((count, 3))
        new *= size / np.linalg.norm(new, axis=1, keepdims=True)
        change = k % lasts == 0
        w[change] = new[change]
        return w.copy()

    return gust


WIDTHS = ("u v w, m/s; p q r, rad/s", "phi theta, rad")
"""Heads of the cells of `widths`."""


def widths(found: Tube) -> list[str]:
    """The half widths of u to theta in two cells."""
    each = [f"{w:.2g}" for w in found.half_widths[:8]]
    return [" ".join(each[:3]) + "; " + " ".join(each[3:6]), " ".join(each[6:])]
