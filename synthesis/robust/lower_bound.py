"""Lower bounds: blocks that close the loop, with their numbers.

Of full complex blocks alone, at one frequency, by the power iteration of Packard and Doyle; over
frequencies and real parameters by search. What is returned was checked by the eigenvalue it
claims, however it was found.

References
----------
Packard and Doyle, "The complex structured singular value", Automatica 29 (1993), section 8.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy import optimize

from symheli.values.arrays import Array
from synthesis.robust.exact_loop import Part
from synthesis.robust.structure import BlockLoop

ITERATIONS = 30
"""Steps of the power iteration from each start."""
FREQUENCIES = 60
"""Frequencies at which the response is looked at, between the poles and beyond."""
FEW, FEW_ITERATIONS = 16, 8
"""The same while real parameters are searched."""
ZOOMS = 7
"""Times that the frequencies about the best one are narrowed."""
STARTS = 2
"""Largest number of corners and draws of the real parameters from which the search descends."""
DRAWS = 12
"""Draws of the real parameters besides the middle and the corners."""
MAX_CORNERS = 64
"""Largest number of corners that are all tried."""
DESCENTS = 20
"""Evaluations of each descent a real parameter."""
ACCURACY, ROUGH = 1e-6, 1e-4
"""Relative accuracy of a level by bisection, and of one while real parameters are searched."""


class Closing(NamedTuple):
    """A level at which full blocks `delta` (nw, nz) of norm 1/level close the loop at a
    frequency.
    """

    level: float
    omega: float
    delta: Array


def closing_at(
    M: Array, parts: tuple[Part, ...], iterations: int = ITERATIONS
) -> tuple[Array, Array]:
    """Return (level, Q) for responses M (K, nz, nw): the spectral radius (K,) of M Q for a Q (K,
    nw, nz) of blocks of norm 1, as large as the iteration finds it, Q turned so that the eigenvalue
    is the level.
    """
    K, nz, nw = M.shape
    best, chosen = np.zeros(K), np.zeros((K, nw, nz), complex)
    if not (nz and nw):
        return best, chosen
    left, sizes, right = np.linalg.svd(M)
    if len(parts) == 1:
        return sizes[:, 0], right[:, 0].conj()[:, :, None] * left[:, None, :, 0].conj()
    back = np.swapaxes(M, 1, 2).conj()
    for start in (right[:, 0].conj(), np.ones((K, nw), complex)):
        b, w = start, start
        for _ in range(iterations):
            a = _unit((M @ b[..., None])[..., 0])
            z = _spread(a, w, parts, "rows", "columns")
            w = _unit((back @ z[..., None])[..., 0])
            b = _spread(w, a, parts, "columns", "rows")
        Q = np.zeros((K, nw, nz), complex)
        for part in parts:
            into, out = _unit(b[:, part.columns]), _unit(a[:, part.rows])
            Q[:, part.columns, part.rows] = into[:, :, None] * out[:, None, :].conj()
        values = np.linalg.eigvals(M @ Q)
        value = np.take_along_axis(values, np.argmax(np.abs(values), axis=1)[:, None], 1)[:, 0]
        size = np.abs(value)
        turn = np.where(size > 0, value / np.where(size > 0, size, 1.0), 1.0)
        better = size > best
        best = np.where(better, size, best)
        chosen = np.where(better[:, None, None], Q / turn[:, None, None], chosen)
    return best, chosen


def _unit(v: Array) -> Array:
    size = _size(v)
    return v / np.where(size > 0, size, 1.0)


def _size(v: Array) -> Array:
    return np.sqrt((np.real(v) ** 2 + np.imag(v) ** 2).sum(axis=-1, keepdims=True))


def _spread(v: Array, by: Array, parts: tuple[Part, ...], own: str, other: str) -> Array:
    """Return v with each block as long as that of `by`."""
    out = np.zeros((len(v), max(getattr(p, own).stop for p in parts)), complex)
    for part in parts:
        mine, theirs = getattr(part, own), getattr(part, other)
        out[:, mine] = _unit(v[:, mine]) * _size(by[:, theirs])
    return out


def worst_closing(loop: BlockLoop, refine: bool = False) -> Closing:
    """Return the largest level of a stable loop of full blocks over all frequencies, of few of them
    or, to `refine`, of many and those about the best.
    """
    paces = loop.paces
    slow, fast = (paces[0], paces[-1]) if len(paces) else (1.0, 1.0)
    count, steps = (FREQUENCIES, ITERATIONS) if refine else (FEW, FEW_ITERATIONS)
    line = np.unique(np.r_[np.geomspace(slow / 10, 10 * fast, count), paces])
    line = np.r_[0.0, line, math.inf]

    def at(omega: Array) -> tuple[Array, Array]:
        return closing_at(loop.responses(omega), loop.parts, steps)

    levels, deltas = at(line)
    k = int(np.argmax(levels))
    level, omega, delta = float(levels[k]), float(line[k]), deltas[k]
    for _ in range((ZOOMS if refine else 1) if 0 < k < len(line) - 1 else 0):
        finer = np.linspace(line[k - 1], min(line[k + 1], 2 * line[k]), FEW)
        levels, deltas = at(finer)
        k = int(np.argmax(levels))
        if levels[k] > level:
            level, omega, delta = float(levels[k]), float(finer[k]), deltas[k]
        line, k = finer, min(max(k, 1), len(finer) - 2)
    return Closing(level, omega, delta / max(level, np.finfo(float).tiny))


def best_reals(value: Callable[[Array], float], count: int) -> tuple[float, Array]:
    """Return the least value found over real parameters in [-1, 1]^count, and where."""
    if count == 0:
        return value(np.zeros(0)), np.zeros(0)
    rng = np.random.default_rng(0)
    corners = list(product((-1.0, 1.0), repeat=count)) if 2**count <= MAX_CORNERS else []
    tried = [np.zeros(count), *map(np.array, corners), *rng.uniform(-1, 1, (DRAWS, count))]
    values = [value(d) for d in tried]
    best, where = math.inf, tried[0]
    for k in np.argsort(values)[:STARTS]:
        found = optimize.minimize(
            lambda d: value(np.clip(d, -1.0, 1.0)),
            tried[k],
            method="Nelder-Mead",
            options={
                "maxfev": DESCENTS * count,
                "initial_simplex": np.vstack(
                    [
                        tried[k],
                        *(tried[k] - 0.3 * np.sign(tried[k] + 1e-9) * e for e in np.eye(count)),
                    ]
                ),
                "xatol": 1e-7,
                "fatol": 1e-9,
            },
        )
        for v, d in ((values[k], tried[k]), (float(found.fun), np.clip(found.x, -1.0, 1.0))):
            if v < best:
                best, where = v, d
    return best, where
