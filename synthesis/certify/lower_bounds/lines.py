"""Straight lines through a box of parameters, along which a single parameter moves; one time budget
for all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from symheli import LFT, Scheduling
from symheli.errors import InputError
from symheli.lpv.lft import Block
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.frozen import FrozenGain, grid_of, worst_over
from synthesis.certify.lower_bounds.lower_bound import (
    LowerBound,
    LowerBoundSearch,
    growing_trajectory,
    lower_bound,
)
from synthesis.certify.lower_bounds.paths import Budget
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.numerics.linear.norm import gain_at_poles, norm


class Line(NamedTuple):
    """The `model` along a line, how fast its parameter may move (per second), and the map `back` to
    p.
    """

    model: Any
    rate: float
    back: Callable[[Array], Array]

    def in_box(self, found: SchedulingTrajectory) -> SchedulingTrajectory:
        """Return a trajectory on the line as one of the box."""
        return SchedulingTrajectory(found.time, self.back(found.p))


def directions(m: int) -> list[Array]:
    """Return the diagonals of a box of m parameters, and its axes where there are several."""
    if not m:
        return []
    diagonals = [np.array((1.0, *signs)) for signs in product((1.0, -1.0), repeat=m - 1)]
    return diagonals + (list(np.eye(m)) if m > 1 else [])


def alone(p: Array) -> Array:
    """Return p (k,) where there is one parameter (k, 1)."""
    return p[:, 0] if p.shape[1] == 1 else p


def shared(
    lines: Iterable[Line], search: LowerBoundSearch | None
) -> Iterator[tuple[Line, LowerBoundSearch]]:
    """Yield every line with its share of the remaining time, while there is time; none without a
    search.
    """
    if search is None:
        return
    budget, lines = Budget(search.seconds), list(lines)
    for k, line in enumerate(tracked("searching along lines", lines)):
        if budget.over:
            return
        yield line, replace(search, seconds=budget.left / (len(lines) - k))


def growing_on(
    lines: Iterable[Line], search: LowerBoundSearch | None
) -> SchedulingTrajectory | None:
    """Return a p(t) on one of the lines along which the free state grows, None where none was
    found.
    """
    for line, share in shared(lines, search):
        found = growing_trajectory(line.model, line.rate, share)
        if found is not None:
            return line.in_box(found)
    return None


class BoxGain(NamedTuple):
    """The largest frozen `gain`, with the `p` (m,) and frequency `omega` (rad/s) at which it
    occurs; inf and NaN if unstable.
    """

    gain: float
    p: tuple[float, ...]
    omega: float


def frozen_box_gain(lft: LFT, *, tolerance: float = 1e-8) -> BoxGain:
    """Return the largest H-infinity norm of the frozen models over the box of an LFT.

    Parameters
    ----------
    lft : LFT
        The model; without channels 0 where every model of the grid is stable.
    tolerance : float
        Relative accuracy of each norm, from below; less than 1.

    Returns
    -------
    BoxGain
        `gain` (inf where a frozen model is unstable), `p` (m,) and `omega` (rad/s).

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> frozen_box_gain(lag.to_lft()).p
    (0.0,)
    """

    if not 0 < tolerance < 1:
        raise InputError(f"tolerance: expected a number between 0 and 1, got {tolerance!r:.60}")

    def at(delta: Array) -> tuple[float, float]:
        M, x = lft.matrix(delta), len(lft.states)
        return norm(M[:x, :x], M[:x, x:], M[x:, :x], M[x:, x:], lft.dt, tolerance)

    m = len(lft.blocks)
    points = {0: 1, 1: 61, 2: 15, 3: 7}.get(m, 3)
    axes = [np.linspace(-1.0, 1.0, points)] * m
    gamma, delta = worst_over(lambda d: at(d)[0], axes, _at_poles(lft, grid_of(axes)))
    omega = math.nan if math.isinf(gamma) else at(delta)[1]
    return BoxGain(gamma, _physical(lft, delta), omega)


def _at_poles(lft: LFT, grid: Array) -> Array:
    """Return `gain_at_poles` for each delta (K, m)."""
    M, x = lft.matrix(grid), len(lft.states)
    return gain_at_poles(M[:, :x, :x], M[:, :x, x:], M[:, x:, :x], M[:, x:, x:], lft.dt)


def box_lower_bound(lft: LFT, frozen: BoxGain, search: LowerBoundSearch | None) -> LowerBound:
    """Return the best lower bound over p that moves along a line through the box, its diagonals and
    its axes: jumping, and at rate limits.

    One parameter: its whole range. A search over jumps alone misses slower waves that are worse, so
    the limits of the parameters, where they have some, give a second try. `search` None: the frozen
    gain.
    """
    best = LowerBound(frozen.gain, None)
    limits = [s.limit / s.radius for s in lft.parameters if 0 < s.limit < math.inf]
    tries = [line for rate in (math.inf, *limits[:1]) for line in _lines(lft, rate)]
    for line, share in shared(tries, search):
        known = FrozenGain(frozen.gain, 0.0, frozen.omega)
        found = lower_bound(line.model, line.rate, frozen=known, search=share)
        if found.gain > best.gain:
            best = found._replace(trajectory=found.trajectory and line.in_box(found.trajectory))
        if math.isinf(best.gain):
            break
    return best


def box_growing_trajectory(
    lft: LFT, search: LowerBoundSearch | None
) -> SchedulingTrajectory | None:
    """Return a p(t) along such a line on which the free state grows, None where none was found."""
    return growing_on(_lines(lft, math.inf), search)


def along(lft: LFT, start: Array, end: Array) -> LFT:
    """Return the LFT with one parameter s in [-1, 1] that moves all the normalised parameters on a
    straight line from `start` to `end`.
    """
    middle, half = (
        np.repeat(0.5 * (start + end), lft.sizes),
        np.repeat(0.5 * (end - start), lft.sizes),
    )
    # w = (middle + half s) z
    loop = np.eye(lft.order) - lft.M11 * middle
    M11, M12 = np.linalg.solve(loop, lft.M11 * half), np.linalg.solve(loop, lft.M12)
    M21 = lft.M21 * half + (lft.M21 * middle) @ M11
    blocks = (Block(Scheduling("line", "1", -1.0, 1.0), lft.order),)
    return LFT(
        M11,
        M12,
        M21,
        lft.M22 + (lft.M21 * middle) @ M12,
        blocks,
        lft.states,
        lft.inputs,
        lft.outputs,
        lft.dt,
    )


def _lines(lft: LFT, rate: float) -> Iterator[Line]:
    middle, radius = np.array([(s.middle, s.radius) for s in lft.parameters]).reshape(-1, 2).T
    for d in directions(len(lft.blocks)):
        yield Line(
            along(lft, -d, d),
            rate,
            lambda s, d=d: alone(middle + np.multiply.outer(s, d) * radius),
        )


def _physical(lft: LFT, delta: Array) -> tuple[float, ...]:
    return tuple(float(s.middle + s.radius * d) for s, d in zip(lft.parameters, delta, strict=True))
