"""Descent on a function with kinks: BFGS with a weak Wolfe line search, then gradient sampling."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import optimize

from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.design.tuning.peaks import Value

Function = Callable[[Array, float], Value]
"""The value and slope at numbers (n,); above the limit any value above it is enough."""

DECREASE, CURVATURE = 1e-4, 0.5
"""Constants of the weak Wolfe conditions."""
HALVINGS = 30
"""Largest number of trials of a line search."""
WINDOW, STANDSTILL = 15, 1e-8
"""BFGS ends where so many steps lowered the value by no more than this."""

RADII = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
"""Radii of the balls, in units of the numbers, in which gradients are sampled in turn."""
STATIONARY = 1e-3
"""Length of the shortest combination below which the next radius is taken."""
STEPS = 20
"""Steps of gradient sampling at most."""
MAX_SAMPLES = 60
"""Gradients in a ball at most; else twice as many as numbers."""


class Point(NamedTuple):
    """Numbers (n,), with the value and slope there."""

    x: Array
    at: Value

    @property
    def value(self) -> float:
        """The value there."""
        return self.at.value


class Stationarity(NamedTuple):
    """How nearly a point is a local minimum.

    `measure`: length of the shortest convex combination of gradients sampled within `radius` around
    it, 0 at a minimum. Both in units of the numbers, of the logarithm of the gain: where it is m,
    no small step lowers the gain by more than about m times its length.
    """

    measure: float
    radius: float


def bfgs(
    function: Function,
    start: Point,
    iterations: int,
    enough: float = -math.inf,
    standstill: float = STANDSTILL,
) -> Point:
    """Descend until the value is below `enough`, falls by no more than `standstill` in `WINDOW`
    steps, or `iterations` are spent.

    Source: Lewis and Overton, Mathematical Programming 141 (2013).
    """
    here, H, fresh = start, np.eye(len(start.x)), True
    history = [here.value]
    for _ in tracked("descending", range(iterations)):
        if here.value < enough:
            break
        direction = -H @ here.at.slope
        if here.at.slope @ direction >= 0:
            H, direction = np.eye(len(here.x)), -here.at.slope
        if fresh:  # a step of one unit at most
            direction = direction / max(1.0, float(np.linalg.norm(direction)))
        after = _line_search(function, here, direction)
        if after is None:
            if fresh:
                break
            H, fresh = np.eye(len(here.x)), True
            continue
        s, y = after.x - here.x, after.at.slope - here.at.slope
        here = after
        if s @ y > 1e-14 * float(np.linalg.norm(s) * np.linalg.norm(y)):
            if fresh:
                H = np.eye(len(s)) * (s @ y) / (y @ y)
            rho = 1.0 / (s @ y)
            left = np.eye(len(s)) - rho * np.outer(s, y)
            H = left @ H @ left.T + rho * np.outer(s, s)
            fresh = False
        history.append(here.value)
        if len(history) > WINDOW and history[-1 - WINDOW] - here.value < standstill:
            break
    return here


def _line_search(function: Function, here: Point, direction: Array) -> Point | None:
    """Return a point of less value and a flatter slope, by doubling and halving; None where there
    is none to be found.
    """
    slope = float(here.at.slope @ direction)
    low, high, t, best = 0.0, math.inf, 1.0, None
    for _ in range(HALVINGS):
        x = here.x + t * direction
        limit = here.value + DECREASE * t * slope
        at = function(x, limit)
        if not at.value < limit:
            high = t
        else:
            best = Point(x, at) if best is None or at.value < best.value else best
            if at.slope @ direction < CURVATURE * slope:
                low = t
            else:
                return Point(x, at)
        t = 0.5 * (low + high) if math.isfinite(high) else 2.0 * low
        if math.isfinite(high) and high - low < 1e-14 * max(1.0, t):
            break
    return best


def shortest(gradients: Array) -> Array:
    """Return the shortest convex combination (n,) of gradients (m, n).

    The least squares of (G'l, sum l - 1) over l >= 0 are, up to a factor, those over l of sum 1.

    Examples
    --------
    >>> shortest(np.array([[1.0, 1.0], [1.0, -1.0]]))
    array([1., 0.])
    """
    size = max(float(np.linalg.norm(gradients, axis=1).max()), 1e-300)
    rows = np.vstack([gradients.T / size, np.ones(len(gradients))])
    weights = optimize.nnls(rows, np.eye(len(rows))[-1], maxiter=100 * len(gradients))[0]
    return gradients.T @ (weights / weights.sum())


def sampled_descent(
    function: Function, start: Point, rng: np.random.Generator
) -> tuple[Point, Stationarity]:
    """Descend along the shortest combination of gradients in ever smaller balls, and return how
    nearly stationary the end is.

    Source: Burke, Lewis and Overton, SIAM J. Optimization 15 (2005).
    """
    here, k = start, 0
    measured = Stationarity(float(np.linalg.norm(start.at.slope)), 0.0)
    n = len(start.x)
    for _ in tracked("gradient sampling", range(STEPS)):
        if k == len(RADII):
            break
        radius = RADII[k]
        steps = rng.standard_normal((min(2 * n, MAX_SAMPLES), n))
        steps *= (rng.uniform(size=len(steps)) ** (1 / n) / np.linalg.norm(steps, axis=1))[:, None]
        around = [function(here.x + radius * step, math.inf) for step in steps]
        slopes = [here.at.slope, *(v.slope for v in around if math.isfinite(v.value))]
        downhill = shortest(np.array(slopes))
        length = float(np.linalg.norm(downhill))
        after = None
        if length > STATIONARY:
            after = _backtracked(function, here, -downhill / length, radius, length)
        if after is None:
            measured, k = Stationarity(length, radius), k + 1
        else:
            here = after
    return here, measured


def _backtracked(
    function: Function, here: Point, direction: Array, radius: float, length: float
) -> Point | None:
    """Return a point of less value along the direction; None where there is none down to a
    thousandth of the radius.
    """
    t = 16 * radius
    while t > 1e-3 * radius:
        x = here.x + t * direction
        limit = here.value - DECREASE * t * length
        at = function(x, limit)
        if at.value < limit:
            return Point(x, at)
        t *= 0.5
    return None
