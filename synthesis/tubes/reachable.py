"""Finite-time reachable tubes of nonlinear equations, every bound rounded outwards.

A set of states is a zonotope c + G z, |z_i| <= 1. Over a step the equations are enclosed to first
order in z (`enclosure`), over a set that Picard's operator maps into itself; their linear part
moves the zonotope by the exponential of a matrix, the rest widens it. Sources: Althoff, Stursberg
and Buss, CDC (2008); Girard, HSCC (2005); Moore, Interval Analysis (1966).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise, product
from typing import Any, NamedTuple

import casadi
import numpy as np

from symheli.errors import InputError
from symheli.progress import task, tracked
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import positive, whole
from symheli.values.summary import summarized
from synthesis.tubes.enclosure import Domain, enclose
from synthesis.tubes.enclosure.form import EPS, MARGIN, AffineForm

TERMS = 12
"""Terms of the series of an exponential."""
WIDER, TRIALS = 1.15, 12
"""Factor on the set about a step until it is mapped into itself, and the most trials."""
TINY = 1e-250
"""Added to bounds of rounding, which may underflow."""
LARGEST = 1e100
"""Size of a set at which the tube is given up."""


@dataclass(frozen=True, eq=False)
class ReachableTube:
    """Boxes that hold all motions from a box of starts, up to a time.

    Attributes
    ----------
    states : tuple of str
        Names.
    times : array (k + 1,)
        Ends of the steps, s, from 0.
    lower, upper : array (k, n)
        Bounds over each step.
    at_lower, at_upper : array (k + 1, n)
        Bounds at the times.
    why : str
        Why the tube ends before its horizon; empty where it does not.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x", 1)
    >>> growth = casadi.Function("growth", [x], [1 + x**2])
    >>> found = reachable(growth, ([0.0], [0.1]), 0.5, step=0.02)
    >>> low, high = found.bounds("x1", 0.0, 0.5)
    >>> bool(low <= 0 and 0.6836 < high < 0.69)  # tan(0.5 + atan(0.1)) = 0.68365
    True
    """

    states: tuple[str, ...]
    times: Array
    lower: Array
    upper: Array
    at_lower: Array
    at_upper: Array
    why: str = ""

    __repr__ = summarized

    def bounds(self, state: str, start: float = 0.0, end: float = math.inf) -> tuple[float, float]:
        """Bounds of a state over all times from `start` to `end`, s."""
        i = self._place(state)
        over = (self.times[1:] >= start) & (self.times[:-1] <= end)
        if not over.any():
            raise InputError(f"the tube ends at {self.times[-1]:g} s; {self.why or 'ask earlier'}")
        if self.why and end > self.times[-1]:
            return -math.inf, math.inf
        return float(self.lower[over, i].min()), float(self.upper[over, i].max())

    def width(self, state: str, time: float) -> float:
        """Width of the bounds of a state at the first end of a step from `time` on, s."""
        i, k = self._place(state), int(np.searchsorted(self.times, time))
        if k == len(self.times):
            raise InputError(f"the tube ends at {self.times[-1]:g} s; {self.why or 'ask earlier'}")
        return float(self.at_upper[k, i] - self.at_lower[k, i])

    def _place(self, state: str) -> int:
        if state not in self.states:
            raise InputError(f"no state {state!r}; known: {', '.join(self.states)}")
        return self.states.index(state)


class Ball(NamedTuple):
    """Matrices within `radius`, entry by entry, of `middle`."""

    middle: Array
    radius: Array

    def __matmul__(self, other: Ball) -> Ball:  # type: ignore[override]
        a, b = np.abs(self.middle), np.abs(other.middle)
        exact = a @ other.radius + self.radius @ b + self.radius @ other.radius
        rounding = (a.shape[-1] + 2) * EPS * (a @ b)
        return Ball(self.middle @ other.middle, (exact + rounding + TINY) * MARGIN)

    def plus(self, other: Ball) -> Ball:
        """Return the sum."""
        middle = self.middle + other.middle
        radius = self.radius + other.radius + EPS * np.abs(middle) + TINY
        return Ball(middle, radius * MARGIN)

    def times(self, factor: float) -> Ball:
        """Return the product with a number."""
        middle = factor * self.middle
        return Ball(middle, (abs(factor) * self.radius + EPS * np.abs(middle) + TINY) * MARGIN)


def point(values: Array) -> Ball:
    """Return a matrix of doubles."""
    return Ball(values, np.zeros(values.shape))


def flow(A: Array, h: float) -> tuple[Ball, Ball]:
    """Return exp(A h) and its integral from 0 to h, by their series and bounds of what is left."""
    n = len(A)
    M, term = point(A).times(h), point(np.eye(n))
    total, integral = term, term
    for k in range(1, TERMS + 1):
        term = (term @ M).times(1.0 / k)
        total, integral = total.plus(term), integral.plus(term.times(1.0 / (k + 1)))
    size = float((np.abs(M.middle) + M.radius).sum(axis=1).max()) * MARGIN
    if not size < 0.5 * TERMS:
        raise InputError(f"step: too long for these equations; take less than {h / size:.2g} s")
    left = 2.0 * size ** (TERMS + 1) / math.factorial(TERMS + 1) * MARGIN + TINY
    rest = Ball(np.zeros((n, n)), np.full((n, n), left))
    return total.plus(rest), integral.plus(rest).times(h)


class Zonotope(NamedTuple):
    """c + G z, |z_i| <= 1."""

    c: Array
    G: Array

    @property
    def radius(self) -> Array:
        """Half widths of the box about it, rounded up."""
        return np.abs(self.G).sum(axis=1) * MARGIN

    def box(self) -> tuple[Array, Array]:
        """Lower and upper bounds."""
        reach = self.radius
        return np.nextafter(self.c - reach, -np.inf), np.nextafter(self.c + reach, np.inf)

    def reduced(self, most: int) -> Zonotope:
        """Return a larger set with at most `most` generators: the least ones become a box."""
        n, m = self.G.shape
        if m <= most:
            return self
        size = np.abs(self.G) / np.maximum(self.radius, TINY)[:, None]
        order = np.argsort(size.sum(axis=0) - size.max(axis=0))
        boxed, kept = order[: m - most + n], order[m - most + n :]
        box = np.abs(self.G[:, boxed]).sum(axis=1) * MARGIN
        return Zonotope(self.c, np.hstack([self.G[:, kept], np.diag(box)]))


def reachable(
    f: casadi.Function,
    start: tuple[Any, Any],
    horizon: float,
    *,
    step: float,
    states: Sequence[str] = (),
    order: int = 12,
    parts: Sequence[int] = (),
) -> ReachableTube:
    """Bounds of all motions of dx/dt = f(x) from a box of starts, for all times up to a horizon.

    The bounds hold for real arithmetic on the constants of f as they are stored. They are computed
    in doubles that are rounded outwards, and are no statement of the kind that a file proves again.

    Parameters
    ----------
    f : casadi.Function
        x -> dx/dt, columns, of the operations that tubes know.
    start : (array, array)
        Lower and upper bounds of x at time 0, (n,) each.
    horizon : float
        s.
    step : float
        Largest step, s; a power of two below it is taken. Smaller ones are sharper at first.
    states : sequence of str, optional
        Names; by default x1, x2, ...
    order : int
        Generators of a set, per state: more are sharper.
    parts : sequence of int, optional
        Parts of the box of starts along each state, each with a tube of its own; default: one.

    Returns
    -------
    ReachableTube
        `why` says where it ends early.

    Raises
    ------
    InputError
        Shapes and numbers that do not fit, a step that is too long.

    Examples
    --------
    >>> import casadi
    >>> x = casadi.SX.sym("x", 1)
    >>> decay = casadi.Function("decay", [x], [-(x**3)])
    >>> found = reachable(decay, ([0.9], [1.1]), 1.0, step=0.02)
    >>> low, high = found.at_lower[-1, 0], found.at_upper[-1, 0]  # x(1) = x / sqrt(1 + 2 x^2)
    >>> bool(low <= 0.9 / 2.62**0.5 and 1.1 / 3.42**0.5 <= high < 0.605)
    True
    """
    if f.n_in() != 1 or f.n_out() != 1 or f.size_in(0) != f.size_out(0) or f.size2_in(0) != 1:
        raise InputError(f"f: expected a casadi.Function x -> dx/dt of one column each, got {f}")
    n = f.size1_in(0)
    lower, upper = (frozen(each, "start", (n,)) for each in start)
    if not np.all(lower <= upper):
        raise InputError("start: expected lower <= upper in every entry")
    names = tuple(states) or tuple(f"x{i + 1}" for i in range(n))
    if len(names) != n or len(set(names)) < n:
        raise InputError(f"states: expected {n} different names, got {states!r:.80}")
    horizon, step = positive(horizon, "horizon"), positive(step, "step")
    counts = tuple(whole(k, "parts", 1) for k in parts) or (1,) * n
    if len(counts) != n:
        raise InputError(f"parts: expected {n} whole numbers, got {parts!r:.80}")
    stepper = _Stepper(f.expand(), whole(order, "order", 1) * n)
    boxes = tracked("parts of the start", list(_split(lower, upper, counts)))
    tubes = [stepper.tube(_first(*box), horizon, step, names) for box in boxes]
    return reduce(_united, tubes)


def _split(lower: Array, upper: Array, counts: tuple[int, ...]) -> Iterator[tuple[Array, Array]]:
    """Yield boxes that cover a box, some along each axis; neighbours share their edges."""
    edges = [np.linspace(a, b, k + 1) for a, b, k in zip(lower, upper, counts, strict=True)]
    for own, a, b in zip(edges, lower, upper, strict=True):
        own[[0, -1]] = a, b
    for sides in product(*(pairwise(own) for own in edges)):
        low, high = np.array(sides).T
        yield low, high


def _first(lower: Array, upper: Array) -> Zonotope:
    box = Domain.box(lower, upper)
    return Zonotope(box.centre, box.generators[:, np.any(box.generators, axis=0)])


def _united(one: ReachableTube, other: ReachableTube) -> ReachableTube:
    """Return the tube that holds both, up to the end of the shorter one."""
    k = min(len(one.lower), len(other.lower))
    shorter = one if len(one.lower) == k else other
    return ReachableTube(
        one.states,
        shorter.times,
        np.minimum(one.lower[:k], other.lower[:k]),
        np.maximum(one.upper[:k], other.upper[:k]),
        np.minimum(one.at_lower[: k + 1], other.at_lower[: k + 1]),
        np.maximum(one.at_upper[: k + 1], other.at_upper[: k + 1]),
        one.why or other.why,
    )


class _Stepper:
    """Steps of zonotopes."""

    def __init__(self, f: casadi.Function, most: int):
        x = casadi.SX.sym("x", f.size1_in(0))
        self.f, self.most = f, most
        self.jacobian = casadi.Function("A", [x], [casadi.densify(casadi.jacobian(f(x), x))])
        self.wobble = np.zeros(f.size1_in(0))

    def tube(
        self, first: Zonotope, horizon: float, step: float, names: tuple[str, ...]
    ) -> ReachableTube:
        """Return the bounds up to the horizon, or as far as they go."""
        h = 2.0 ** math.floor(math.log2(min(step, horizon)))
        whole_steps = int(horizon // h)
        last = horizon - whole_steps * h
        sizes = [h] * whole_steps + [last] * (last > 0)
        times, boxes, over, why = [0.0], [first.box()], [], ""
        now: Zonotope | None = first
        with task("reachable tube", len(sizes)) as progress:
            for size in sizes:
                between, now = self._step(now, size)
                if now is None or not float(now.radius.max()) < LARGEST:
                    why = f"no bounds are found beyond {times[-1]:.4g} s"
                    break
                over.append(between)
                times.append(times[-1] + size)
                boxes.append(now.box())
                progress.step()
        n = len(names)
        (lower, upper), (at_lower, at_upper) = (
            np.array(each).reshape(-1, 2, n).transpose(1, 0, 2) for each in (over, boxes)
        )
        return ReachableTube(names, np.array(times), lower, upper, at_lower, at_upper, why)

    def _step(self, now: Zonotope, h: float) -> tuple[Any, Zonotope | None]:
        """Return the box over a step and the zonotope after it; (None, None): none was found."""
        c = now.c + 0.5 * h * np.array(self.f(now.c)).ravel()
        slope = np.array(self.f(c)).ravel()
        A = np.array(self.jacobian(c))
        if not (np.all(np.isfinite(slope)) and np.all(np.isfinite(A))):
            return None, None
        about = self._invariant(now, c, slope, A, h)
        if about is None:
            return None, None
        domain, form = about
        shift, rest = _remainder(form, slope, A, domain)
        after = self._moved(now, c, slope, A, h, shift, rest)
        return Zonotope(domain.centre, domain.generators).box(), after.reduced(self.most)

    def _invariant(
        self, now: Zonotope, c: Array, slope: Array, A: Array, h: float
    ) -> tuple[Domain, AffineForm] | None:
        """Return the set c + (G + h/2 A G) z + h/2 slope t + wobble w that holds all motions over
        the step, and f over it.
        """
        half, middle = 0.5 * h * slope, now.G + 0.5 * h * (A @ now.G)
        turned, m = middle - now.G, now.G.shape[1]
        wobble = np.maximum(self.wobble, 0.5 * h * np.abs(A) @ np.abs(half))
        # what is left of the start's centre and generators, with the rounding of its own sums
        left = np.abs(now.c - c + half) + 8 * EPS * (np.abs(now.c) + np.abs(c) + np.abs(half))
        left += 8 * EPS * (np.abs(middle) + np.abs(now.G)).sum(axis=1)
        for _ in range(TRIALS):
            generators = np.hstack([middle, half[:, None], np.diag(wobble)])
            domain = Domain(c, generators, (1,) * generators.shape[1])
            form = enclose(self.f, domain).value
            apart = np.abs(form.centre - slope) + EPS * (np.abs(form.centre) + np.abs(slope))
            own, others = form.slopes[:, :m], np.abs(form.slopes[:, m:]).sum(axis=1)
            # s times the slope less what the generators were turned by, at s = 0 or h
            turn = np.maximum(np.abs(turned), np.abs(h * own - turned) + 4 * EPS * h * np.abs(own))
            reach = left + turn.sum(axis=1) + h * (apart + others + form.rest)
            reach = (reach + TINY) * MARGIN
            if not np.all(np.isfinite(reach)):
                return None
            if np.all(reach <= wobble):
                self.wobble = WIDER * reach
                return domain, form
            wobble = np.maximum(wobble, WIDER * reach)
        return None

    def _moved(
        self, now: Zonotope, c: Array, slope: Array, A: Array, h: float, shift: Array, rest: Array
    ) -> Zonotope:
        """Return c + exp(Ah)(x - c) + the integral of exp(As) (slope + shift + rest)."""
        E, integral = flow(A, h)
        start = point(now.c[:, None]).plus(point(-c[:, None]))
        forced = point(slope[:, None]).plus(point(shift[:, None]))
        centre = point(c[:, None]).plus(E @ start).plus(integral @ forced)
        moved = E @ point(now.G)
        spread = integral_of_sizes(A, h) @ rest
        box = (moved.radius.sum(axis=1) + centre.radius[:, 0] + spread) * MARGIN + TINY
        return Zonotope(centre.middle[:, 0], np.hstack([moved.middle, np.diag(box)]))


def _remainder(form: AffineForm, slope: Array, A: Array, domain: Domain) -> tuple[Array, Array]:
    """Return (d, r): f(x) - slope - A (x - c) lies within r of d over the set."""
    linear = A @ domain.generators
    size = np.abs(A) @ np.abs(domain.generators)
    shift = form.centre - slope
    apart = np.abs(form.slopes - linear) + EPS * ((len(A) + 2) * size + np.abs(form.slopes))
    rounding = EPS * (np.abs(form.centre) + np.abs(slope))
    return shift, (apart.sum(axis=1) + form.rest + rounding + TINY) * MARGIN


def integral_of_sizes(A: Array, h: float) -> Array:
    """Return an upper bound of the integral of |exp(A s)|, entry by entry, from 0 to h."""
    _, integral = flow(np.abs(A), h)
    return (integral.middle + integral.radius) * MARGIN
