"""Polynomials in Bernstein form on an interval: products, restriction, elevation, in any
arithmetic.

A matrix polynomial of degrees (a, b) in two variables x, s in [0, 1] is an array (a + 1, b + 1, n,
m) of its Bernstein coefficients; one variable is b = 0. A polynomial lies in the convex hull of its
coefficients, so definite coefficients mean a definite polynomial on the whole interval. Every
function takes floats and exact rationals (NumPy object arrays) alike. Source: Farouki, "The
Bernstein polynomial basis: a centennial retrospective" (2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product as cartesian
from math import comb
from typing import Any

import numpy as np

Array = np.ndarray


def blossom(arguments: Sequence[Any]) -> Array:
    """Weights (d + 1,) of the Bernstein coefficients in the blossom at d local arguments
    (symmetric, affine in each).

    blossom(t, ..., t) gives the value at t; blossom(a, .., b, ..) the coefficients over [a, b].
    """
    weights: list[Any] = [1]
    for t in arguments:
        stay, move = [(1 - t) * w for w in weights], [t * w for w in weights]
        weights = [stay[0], *(s + m for s, m in zip(stay[1:], move[:-1], strict=True)), move[-1]]
    return np.array(weights)


def restriction(degree: int, a: Any, b: Any) -> Array:
    """Matrix (d + 1, d + 1) from the coefficients over [0, 1] to those over [a, b] (local
    coordinates).
    """
    return np.array([blossom([a] * (degree - k) + [b] * k) for k in range(degree + 1)])


def composition(degree: int, corners: Sequence[Sequence[Any]]) -> Array:
    """Array (d + 1, d + 1, d + 1): coefficients [i, k] in (x, s) of f(t(x, s)) from those of f,
    last axis.

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


def binomials(degrees: Sequence[int]) -> Array:
    """C(a, i) C(b, k) as an array (a + 1, b + 1, 1, 1)."""
    a, b = degrees
    return np.array(
        [[comb(a, i) * comb(b, k) for k in range(b + 1)] for i in range(a + 1)], dtype=object
    )[:, :, None, None]


def _weighted(F: Array) -> Array:
    weights = binomials((F.shape[0] - 1, F.shape[1] - 1))
    return F * (weights if F.dtype == object else weights.astype(float))


def _unweighted(F: Array) -> Array:
    weights = binomials((F.shape[0] - 1, F.shape[1] - 1))
    return (
        np.asarray(_exact_quotient(F, weights)) if F.dtype == object else F / weights.astype(float)
    )


# the integer 0 of an empty sum must not become the float 0.0
_exact_quotient = np.frompyfunc(
    lambda numerator, weight: numerator if numerator == 0 else numerator / weight, 2, 1
)


def multiply(F: Array, G: Array) -> Array:
    """Coefficients of the matrix product F G; degrees add."""
    Fw, Gw = _weighted(F), _weighted(G)
    shape = (F.shape[0] + G.shape[0] - 1, F.shape[1] + G.shape[1] - 1, F.shape[2], G.shape[3])
    out = np.zeros(shape, dtype=Fw.dtype)
    for i, k in np.ndindex(F.shape[:2]):
        out[i : i + G.shape[0], k : k + G.shape[1]] += Fw[i, k] @ Gw
    return _unweighted(out)


def elevate(F: Array, degrees: Sequence[int]) -> Array:
    """The same polynomial with coefficients of these higher degrees."""
    extra = (degrees[0] - F.shape[0] + 1, degrees[1] - F.shape[1] + 1)
    if extra == (0, 0):
        return F
    Fw, ones = _weighted(F), binomials(extra)
    out = np.zeros((degrees[0] + 1, degrees[1] + 1, *F.shape[2:]), dtype=F.dtype)
    for i, k in np.ndindex(ones.shape[:2]):
        out[i : i + F.shape[0], k : k + F.shape[1]] += int(ones[i, k, 0, 0]) * Fw
    return _unweighted(out)


def transpose(F: Array) -> Array:
    """F(x, s)' coefficient by coefficient."""
    return np.swapaxes(F, -1, -2)


def product_weights(a: int, b: int) -> Array:
    """Array (a + b + 1, a + 1, b + 1): the product's coefficient m is sum_ik W[m, i, k] f_i g_k."""
    W = np.zeros((a + b + 1, a + 1, b + 1))
    for i, k in np.ndindex(a + 1, b + 1):
        W[i + k, i, k] = comb(a, i) * comb(b, k) / comb(a + b, i + k)
    return W


def elevation_matrix(low: int, high: int) -> Array:
    """Matrix (high + 1, low + 1) from coefficients of degree `low` to those of degree `high`."""
    return product_weights(high - low, low).sum(axis=1)
