"""The scheduling range in cells, on each of which everything is a polynomial: nodes to compute it
at, and the map from values to Bernstein coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from symheli.lpv.bases.function_space import tensor_grid
from synthesis.polynomial.bernstein import blossom

Array = np.ndarray

MOST = 10
"""Highest degree in a parameter by which data on a cell are followed; what lies beyond is left to
the analysis of the closed loop.
"""
SMALL = 1e-10
"""A Chebyshev coefficient below this fraction of the largest entry of its own is rounding."""


class BernsteinCell(NamedTuple):
    """A box `low`, `high` (m,) of the parameters; `nodes` (K, m) inside it, and `to_bernstein`
    (q, K) from values there to Bernstein coefficients of degrees that take them exactly.
    """

    low: Array
    high: Array
    nodes: Array
    to_bernstein: Array


def cells(breaks: Sequence[Sequence[float]], degrees: Sequence[int]) -> list[BernsteinCell]:
    """One cell between every two breaks of each parameter, for polynomials of these degrees."""
    out = []
    for sides in product(*(list(pairwise(b)) for b in breaks)):
        axes = [_nodes(*side, d) for side, d in zip(sides, degrees, strict=True)]
        maps = [np.linalg.inv([blossom([x] * d) for x in _unit(d)]) for d in degrees]
        low, high = np.array(sides).T
        out.append(BernsteinCell(low, high, tensor_grid(axes), reduce(np.kron, maps)))
    return out


def degrees_of(
    data: Callable[[Array], Sequence[Array]], breaks: Sequence[Sequence[float]]
) -> tuple[int, ...]:
    """The degree in each parameter that `data` (arrays (K, ...) at p (K, m)) have on the widest
    cells, at most `MOST`.
    """
    sides = [max(pairwise(b), key=lambda side: side[1] - side[0]) for b in breaks]
    found = []
    for i, side in enumerate(sides):
        axes = [
            np.array([0.5 * (a + b)]) if k != i else _nodes(a, b, MOST)
            for k, (a, b) in enumerate(sides)
        ]
        x = 2 * _unit(MOST) - 1
        degree = 0
        for values in data(tensor_grid(axes)):
            c = np.abs(np.linalg.solve(chebyshev.chebvander(x, MOST), values.reshape(len(x), -1)))
            above = np.flatnonzero((c > SMALL * max(float(c.max(initial=0.0)), 1e-300)).any(axis=1))
            degree = max(degree, int(above.max(initial=0)))
        found.append(degree)
        del side
    return tuple(found)


def _unit(degree: int) -> Array:
    """Chebyshev points of [0, 1], degree + 1 of them."""
    return 0.5 - 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))


def _nodes(low: float, high: float, degree: int) -> Array:
    return low + (high - low) * _unit(degree)
