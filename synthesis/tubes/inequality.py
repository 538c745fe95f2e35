"""The matrix inequality of an invariant ellipsoid, in any arithmetic.

Deviations e follow de/dt = A e + E w + d, where F = [A E d] lies in a set: a centre, matrices times
the symbols of the ellipsoid (|z| <= 1) and of the gust (|y| <= 1), and terms left right' times a
number in [-1, 1] each. If multipliers make `block` positive definite, V = e'P e falls wherever V =
1 and |w| <= 1 (S-procedure; Petersen's lemma).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from synthesis.lpv.affine_program import from_lower

Array = np.ndarray

ROUNDED_UP = 1 + 1e-12
"""Factor on bounds of the remainder that are computed in floating point, of some 20 roundings."""
ROUNDED = 1e-14
"""Bound of the rounding of sums of some 20 products, relative to the sum of their sizes."""


class MatrixSet(NamedTuple):
    """The set of F (n, q); q = n deviations, 3 gust components and 1 constant.

    centre (n, q); tube (n, n, q) and gust (3, n, q), the factors of the symbols; left (k, n) and
    weights (k, q, q): for each other term, x'F v <= |x'left| sqrt(v' weights v).
    """

    centre: Array
    tube: Array
    gust: Array
    left: Array
    weights: Array

    def scaled(self, factor: Array) -> MatrixSet:
        """The set in coordinates z, e = factor z."""
        n, q = self.centre.shape
        inverse, right = np.linalg.inv(factor), np.eye(q)
        right[:n, :n] = factor
        return MatrixSet(
            inverse @ self.centre @ right,
            inverse @ self.tube @ right,
            inverse @ self.gust @ right,
            self.left @ inverse.T,
            right.T @ self.weights @ right,
        )


def elementwise(rest: Array, units: Array) -> tuple[Array, Array]:
    """(left, weights) of matrices that are at most `rest` (n, q) in size, element by element.

    By Cauchy's inequality, row by row; `units` (q,) > 0 are sizes of deviations and inputs.
    """
    n, q = rest.shape
    used = np.flatnonzero(rest.any(axis=1))
    left = np.eye(n)[used] * units[:n][used, None]
    sizes = rest[used] / units[:n][used, None]
    total = (sizes * units).sum(axis=1, keepdims=True)
    diagonal = sizes * total / units * ROUNDED_UP
    return left, diagonal[:, :, None] * np.eye(q)


def rank_one(matrices: Array, units: Array) -> tuple[Array, Array, Array]:
    """(left, weights, rest): matrices (k, n, q) times numbers in [-1, 1], each by its largest
    singular vectors, and the sizes (n, q) of what that leaves.
    """
    n, q = matrices.shape[1:]
    left, weights, rest = [], [], np.zeros((n, q))
    for matrix in matrices:
        U, s, V = np.linalg.svd(matrix / units[:n, None] * units)
        row = U[:, 0] * np.sqrt(s[0]) * units[:n]
        column = V[0] * np.sqrt(s[0]) / units
        left.append(row)
        # not less than the exact product, in the order of matrices, by Gershgorin's theorem
        weights.append(column[:, None] * column + (ROUNDED_UP - 1) * np.diag(column**2))
        product = row[:, None] * column
        rest += (np.abs(matrix - product) + ROUNDED * np.abs(product)) * ROUNDED_UP
    return np.reshape(left, (-1, n)), np.reshape(weights, (-1, q, q)), rest


class Multipliers(NamedTuple):
    """tube S and gust T (n, n), terms (k, k) diagonal, wind mu (1, 1), decay alpha (a number):
    numbers, rationals or variables of an `AffineProgram`.
    """

    tube: Any
    gust: Any
    terms: Any
    wind: Any
    decay: Any


def block(P: Any, over: MatrixSet, by: Multipliers, one: Any = 1.0) -> Any:
    """The symmetric matrix that must be positive definite.

        -M
        P'   S         M = [P A + A'P + alpha P, P E, P d; ., -mu I, 0; ., ., mu - alpha]
        P'       T         + sum of H'S H and H'T H over the symbols + sum of r times weights
        l'P          r

    `one` is the number 1 of the arithmetic.
    """
    n, q = over.centre.shape
    tall = _in_corner(P, (q, n))
    product = tall @ over.centre
    gust, constant = (np.zeros((q, q), dtype=over.centre.dtype) for _ in range(2))
    for i in range(n, n + 3):
        gust[i, i] = -one
    gust[-1, -1], constant[-1, -1] = one, -one
    M = product + np.swapaxes(product, -1, -2) + by.wind * gust
    M = M + by.decay * (_in_corner(P, (q, q)) + _known(constant, P))
    for symbols, multiplier in ((over.tube, by.tube), (over.gust, by.gust)):
        for H in symbols:
            M = M + H.T @ multiplier @ H
    for k, weight in enumerate(over.weights):
        M = M + by.terms[..., k : k + 1, k : k + 1] * weight
    tall_left = np.swapaxes(tall @ over.left.T, -1, -2)
    tall = np.swapaxes(tall, -1, -2)
    return from_lower(
        [[-M], [tall, by.tube], [tall, None, by.gust], [tall_left, None, None, by.terms]]
    )


def _in_corner(P: Any, shape: tuple[int, int]) -> Any:
    """P in the upper left corner of zeros."""
    out = np.zeros((*P.shape[:-2], *shape), dtype=P.dtype)
    out[..., : P.shape[-2], : P.shape[-1]] = P
    return out


def _known(matrix: Array, like: Any) -> Any:
    """A known matrix in the form of an array of an `AffineProgram`, or as it is."""
    if like.ndim == 2:
        return matrix
    out = np.zeros((like.shape[0], 1, *matrix.shape))
    out[0] = matrix
    return out
