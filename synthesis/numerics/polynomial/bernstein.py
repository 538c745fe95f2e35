"""The linear maps between Bernstein coefficients on an interval: blossoms, restriction,
composition, products, elevation, in any arithmetic.

A polynomial lies in the convex hull of its coefficients, so definite coefficients mean a definite
polynomial on the whole interval; `PolynomialMatrix` is the type made of them. Floats and exact
rationals (NumPy object arrays) alike. Source: Farouki, "The Bernstein polynomial basis: a
centennial retrospective" (2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product as cartesian
from math import comb
from typing import Any

import numpy as np

from symheli.values.arrays import Array


def blossom(arguments: Sequence[Any]) -> Array:
    """Return the weights (d + 1,) of the Bernstein coefficients in the blossom at d local arguments
    (symmetric, affine in each).

    blossom(t, ..., t) gives the value at t; blossom(a, .., b, ..) the coefficients over [a, b].
    """
    weights: list[Any] = [1]
    for t in arguments:
        stay, move = [(1 - t) * w for w in weights], [t * w for w in weights]
        weights = [stay[0], *(s + m for s, m in zip(stay[1:], move[:-1], strict=True)), move[-1]]
    return np.array(weights)


def restriction(degree: int, a: Any, b: Any) -> Array:
    """Return the matrix (d + 1, d + 1) from the coefficients over [0, 1] to those over [a, b]
    (local coordinates).
    """
    return np.array([blossom([a] * (degree - k) + [b] * k) for k in range(degree + 1)])


def composition(degree: int, corners: Sequence[Sequence[Any]]) -> Array:
    """Return the array (d + 1, d + 1, d + 1) with coefficients [i, k] in (x, s) of f(t(x, s)) from
    those of f, last axis.

    t is bilinear with t = corners[e][f] (local coordinates of f) at x = e, s = f.
    """
    out: Any = [[0] * (degree + 1) for _ in range(degree + 1)]
    for choice in cartesian(cartesian((0, 1), (0, 1)), repeat=degree):
        i, k = sum(e for e, _ in choice), sum(f for _, f in choice)
        out[i][k] = out[i][k] + blossom([corners[e][f] for e, f in choice])
    if degree == 0:
        return np.array(out)
    return np.array(
        [
            [out[i][k] / (comb(degree, i) * comb(degree, k)) for k in range(degree + 1)]
            for i in range(degree + 1)
        ]
    )


def product_weights(a: int, b: int) -> Array:
    """Return the array W (a + b + 1, a + 1, b + 1): coefficient m of a product is sum_ik W[m, i, k]
    f_i g_k.
    """
    W = np.zeros((a + b + 1, a + 1, b + 1))
    for i, k in np.ndindex(a + 1, b + 1):
        W[i + k, i, k] = comb(a, i) * comb(b, k) / comb(a + b, i + k)
    return W


def elevation_matrix(low: int, high: int) -> Array:
    """Return the matrix (high + 1, low + 1) from coefficients of degree `low` to those of degree
    `high`.
    """
    return product_weights(high - low, low).sum(axis=1)
