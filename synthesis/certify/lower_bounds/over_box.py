"""The largest value of a function over a box: the common search for every worst frozen model."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.optimize import minimize, minimize_scalar

Array = np.ndarray

STARTS = 3
"""Number of grid peaks, the highest first, from which an ascent starts."""


def grid_of(axes: Sequence[Array]) -> Array:
    """Return all points (K, m) of a grid."""
    return np.array(list(product(*axes)), dtype=float)


def worst_over(
    size: Callable[[Array], float], axes: Sequence[Array], values: Array | None = None
) -> tuple[float, Array]:
    """Return (value, p) of the largest `size(p)` found over the grid of the `axes` and by local
    searches from its highest peaks; the first infinite value ends it.

    `values` (K,) on the grid, where they are known already, or something close to them.
    """
    grid = grid_of(axes)
    if values is None:
        found = []
        for p in grid:
            found.append(size(p))
            if found[-1] == math.inf:
                return math.inf, p
        values = np.array(found)
        best = float(values.max()), grid[int(values.argmax())]
    else:
        k = int(values.argmax())
        if values[k] == math.inf:
            return math.inf, grid[k]
        best = size(grid[k]), grid[k]
    climb = _along_line if len(axes) == 1 else _in_box
    for k in _peaks(values.reshape([len(axis) for axis in axes]))[:STARTS] if len(axes) else ():
        p = climb(size, axes, grid[k])
        best = max(best, (size(p), p), key=lambda pair: pair[0])
    return best


def _along_line(size: Callable[[Array], float], axes: Sequence[Array], start: Array) -> Array:
    (axis,) = axes
    k = int(np.searchsorted(axis, start[0]))
    a, b = float(axis[max(k - 1, 0)]), float(axis[min(k + 1, len(axis) - 1)])
    result: Any = minimize_scalar(
        lambda p: -size(np.array([p])),
        bounds=(a, b),
        method="bounded",
        options={"xatol": 1e-6 * (b - a)},
    )
    return np.array([float(result.x)])


def _in_box(size: Callable[[Array], float], axes: Sequence[Array], start: Array) -> Array:
    low, high = (np.array([end(axis) for axis in axes]) for end in (np.min, np.max))
    step = np.array([(axis.max() - axis.min()) / (len(axis) - 1) for axis in axes])
    inward = np.where(start + step > high, -1.0, 1.0)
    result: Any = minimize(
        lambda p: -min(size(np.clip(p, low, high)), 1e300),
        start,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={
            "initial_simplex": np.vstack([start, start + np.diag(inward * step)]),
            "maxfev": 40 * len(axes),
            "xatol": 1e-7 * float((high - low).min()),
            "fatol": 1e-12,
        },
    )
    return np.clip(result.x, low, high)


def _peaks(values: Array) -> list[int]:
    """Return the flat indices that no neighbour on the grid exceeds, the largest first."""
    padded = np.pad(values, 1, constant_values=-np.inf)
    inner = tuple(slice(1, -1) for _ in values.shape)
    highest = np.ones(values.shape, dtype=bool)
    for shift in product((-1, 0, 1), repeat=values.ndim):
        highest &= values >= np.roll(padded, shift, axis=tuple(range(values.ndim)))[inner]
    flat = values.ravel()
    return sorted(np.flatnonzero(highest.ravel()).tolist(), key=lambda k: -flat[k])
