"""Relaxations that turn "F(p) < 0 for every p in the box" into finitely many conditions on
Bernstein coefficients.

    bernstein   every coefficient negative (after raising the degree or subdividing): sufficient,
                exact in the limit
    sos         -F is a sum of squares weighted by products of t_i, 1 - t_i or t_i (1 - t_i), local
                parameters: sufficient; for one parameter necessary too, so exact. Never worse than
                the coefficients it starts from, each of which belongs to such a product
    vertices    negative at the corners, and convex along every axis: sufficient; exact for
                multi-affine F
    grid        negative on a grid: necessary only, proves nothing

Sum of squares: Scherer and Hol, "Matrix sum-of-squares relaxations for robust semi-definite
programs", Mathematical Programming 107 (2006); one parameter: Lukacs' theorem for matrices (Choi,
Lam and Reznick; Aylward, Itani and Parrilo 2007). Vertices: Gahinet, Apkarian and Chilali, "Affine
parameter-dependent Lyapunov functions and real parametric uncertainty", IEEE Trans. Automatic
Control 41 (1996).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import product
from math import comb, prod
from typing import NamedTuple

import numpy as np
from scipy import sparse

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.bernstein import blossom, elevation_matrix, restriction
from synthesis.numerics.polynomial.symmetric import length


class Conditions(NamedTuple):
    """Matrices that map the coefficients (K) of F to those of matrices that must be negative (below
    the margin), or positive.
    """

    negative: Array
    positive: Array


def coefficient_conditions(degrees: Sequence[int], elevation: int, subdivision: int) -> Conditions:
    """Bernstein relaxation: every coefficient over each of 2^subdivision parts a parameter, of
    degrees raised by `elevation`.
    """
    up = [elevation_matrix(d, d + elevation) if d else np.ones((1, 1)) for d in degrees]
    parts = 2**subdivision
    rows = []
    for index in product(*(range(parts) if d > 1 else (None,) for d in degrees)):
        # degrees 0 and 1 lose nothing: there is nothing to gain by cutting them
        cut = [
            restriction(len(E) - 1, j / parts, (j + 1) / parts) @ E if j is not None else E
            for j, E in zip(index, up, strict=True)
        ]
        rows.append(reduce(np.kron, cut))
    return Conditions(np.concatenate(rows), np.zeros((0, prod(d + 1 for d in degrees))))


def vertex_conditions(degrees: Sequence[int]) -> Conditions:
    """Vertex relaxation: the corners, and the Bernstein coefficients of the second derivative along
    each axis of degree 2 or more.
    """
    ends = [np.eye(d + 1)[[0, d] if d else [0]] for d in degrees]
    curved = []
    for i, d in enumerate(degrees):
        if d >= 2:
            second = np.diff(np.eye(d + 1), n=2, axis=0)
            curved.append(
                reduce(
                    np.kron, [second if j == i else np.eye(e + 1) for j, e in enumerate(degrees)]
                )
            )
    width = prod(d + 1 for d in degrees)
    return Conditions(reduce(np.kron, ends), np.concatenate([np.zeros((0, width)), *curved]))


def grid_conditions(degrees: Sequence[int], points: int) -> Conditions:
    """Grid relaxation: the values at `points` equidistant points of each parameter F depends on."""
    local = np.linspace(0.0, 1.0, points)
    values = [
        np.array([blossom([t] * d) for t in local]) if d else np.ones((1, 1)) for d in degrees
    ]
    return Conditions(reduce(np.kron, values), np.zeros((0, prod(d + 1 for d in degrees))))


class Squares(NamedTuple):
    """One weighted sum of squares: a Gram matrix of `size`, and `map` from its svec to the svec'd
    Bernstein coefficients.
    """

    size: int
    map: sparse.csc_matrix


def sums_of_squares(degrees: Sequence[int], N: int) -> Iterator[Squares]:
    """The terms of sum_c w_c(t) S_c(t) of these degrees, N x N; S_c is a sum of squares in a
    Bernstein basis.

    Even degree 2k: weight 1 with squares of degree k, or t (1 - t) with k - 1. Odd 2k + 1: t or 1 -
    t with squares of degree k. The products over the parameters (Schmuedgen's form).
    """
    choices = []
    for d in degrees:
        k = d // 2
        # (powers of t and of 1 - t in the weight, degree of the squares)
        choices.append([(1, 0, k), (0, 1, k)] if d % 2 else [(0, 0, k)] + [(1, 1, k - 1)] * (k > 0))
    for choice in product(*choices):
        yield _term(degrees, choice, N)


def _term(degrees: Sequence[int], choice: Sequence[tuple[int, int, int]], N: int) -> Squares:
    """Each entry of the Gram matrix feeds one Bernstein coefficient: the product of Bernstein
    polynomials is one, times a number.
    """
    basis = list(product(*(range(k + 1) for _, _, k in choice)))
    size = N * len(basis)
    columns, rows = np.tril_indices(size)
    strides = np.cumprod([1, *(d + 1 for d in degrees[:0:-1])])[::-1]
    a, b = np.array(basis)[rows // N], np.array(basis)[columns // N]
    place, weight = np.zeros(len(rows), dtype=int), np.ones(len(rows))
    for i, (d, (up, _, k)) in enumerate(zip(degrees, choice, strict=True)):
        own = np.array([comb(k, j) for j in range(k + 1)], dtype=float)
        whole = np.array([comb(d, j) for j in range(d + 1)], dtype=float)
        target = a[:, i] + b[:, i] + up
        place += strides[i] * target
        weight *= own[a[:, i]] * own[b[:, i]] / whole[target]
    u, v = np.minimum(rows % N, columns % N), np.maximum(rows % N, columns % N)
    entry = v * (v + 1) // 2 + u
    # an off-diagonal pair of the Gram matrix that meets on the diagonal of its block counts twice
    weight *= np.where((rows != columns) & (u == v), np.sqrt(2.0), 1.0)
    L = length(N)
    height = prod(d + 1 for d in degrees) * L
    return Squares(
        size,
        sparse.csc_matrix(
            (weight, (place * L + entry, np.arange(len(rows)))), shape=(height, len(rows))
        ),
    )
