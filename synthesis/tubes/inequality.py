"""The matrix inequalities of an invariant ellipsoid and of a gain on it, in any arithmetic.

Deviations e follow de/dt = A e + E w + d, where F = [A E d] lies in a set: the corners of a cell of
commands, matrices times the symbols of the ellipsoid (|z| <= 1) and of the gust (|y| <= 1), and
terms left right' times a number in [-1, 1] each. If multipliers make all `conditions` positive
definite, V = e'P e falls wherever V = 1 and |w| <= 1 with the supply of `invariant`, and grows by
no more than the supply of `bounded` (S-procedure; Petersen's lemma). P may be linear in the
scheduling command, as the commanded airspeed, whose rate adds dP/dt.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import Number, matmul
from synthesis.numerics.program.affine_program import from_lower

ROUNDED_UP = 1 + 1e-12
"""Factor on bounds of the remainder that are computed in floating point, of some 20 roundings."""
ROUNDED = 1e-14
"""Bound of the rounding of sums of some 20 products, relative to the sum of their sizes."""


class MatrixSet(NamedTuple):
    """The set of F (n, q); q = n deviations, m gust components and 1 constant.

    corners (2, 2, 2, n, q): at the ends of the cell in its first three commands, as airspeed,
    acceleration and jerk, 1 for 2 where they are one; onto (n, r) times tube (n, r, q) and gust
    (m, r, q), the factors of the symbols; left (k, n)
    and weights (k, q, q): for each other term, x'F v <= |x'left| sqrt(v' weights v).
    """

    corners: Array
    onto: Array
    tube: Array
    gust: Array
    left: Array
    weights: Array

    def unit(self, factor: Array) -> Array:
        """D (r, r), in whose columns the rows of tube and gust are of the size of e = factor z."""
        own = self.onto.T @ factor
        return np.linalg.cholesky(own @ own.T)

    def scaled(self, factor: Array) -> MatrixSet:
        """The set in coordinates z, e = factor z."""
        n, q = self.corners.shape[-2:]
        inverse, right, unit = np.linalg.inv(factor), np.eye(q), self.unit(factor)
        right[:n, :n] = factor
        return MatrixSet(
            inverse @ self.corners @ right,
            inverse @ self.onto @ unit,
            np.linalg.solve(unit, self.tube @ right),
            np.linalg.solve(unit, self.gust @ right),
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
        row = np.where(matrix.any(axis=1), U[:, 0], 0.0) * np.sqrt(s[0]) * units[:n]
        column = V[0] * np.sqrt(s[0]) / units
        left.append(row)
        # not less than the exact product, in the order of matrices, by Gershgorin's theorem
        weights.append(column[:, None] * column + (ROUNDED_UP - 1) * np.diag(column**2))
        product = row[:, None] * column
        rest += (np.abs(matrix - product) + ROUNDED * np.abs(product)) * ROUNDED_UP
    return np.reshape(left, (-1, n)), np.reshape(weights, (-1, q, q)), rest


class Multipliers(NamedTuple):
    """tube S and gust T (r, r), terms (k, k) diagonal, wind mu (1, 1), decay alpha (a number; 0 in
    a gain): numbers, rationals or variables of an `AffineProgram`.
    """

    tube: Any
    gust: Any
    terms: Any
    wind: Any
    decay: Any


class Shares(NamedTuple):
    """X (n, n) >= P o inv(S) o'P, P o inv(T) o'P, P l inv(r) l'P at one end of a cell; o: onto."""

    tube: Any
    gust: Any
    terms: Any


class MovingEllipsoid(NamedTuple):
    """P (n, n) at the two ends of a cell in airspeed, or one that does not move; its `rate` by
    airspeed (None: 0); the accelerations at the ends of the cell.
    """

    ends: Sequence[Any]
    rate: Any
    accelerations: Sequence[Any]


def motion(nodes: Sequence[Any], width: Any, centre: Array, half: Array) -> MovingEllipsoid:
    """P over a cell, linear between the nodes of its interval, one or two, `width` m/s apart.

    centre, half: of the cell, in the share of the interval and in acceleration.
    """
    (s, a), (s_half, a_half) = centre, half
    if len(nodes) == 1:
        return MovingEllipsoid(nodes, None, [a])
    accelerations = [a - a_half, a + a_half] if a_half != 0 else [a]
    step = nodes[1] - nodes[0]
    ends = [nodes[0] + (s + side * s_half) * step for side in (-1, 1)]
    return MovingEllipsoid(ends, step / width, accelerations)


def invariant(by: Multipliers, shape: tuple[int, int], number: Number = float) -> Any:
    """The supply mu (1 - |w|^2) - alpha in (e, w, 1), for `shape` (n, q)."""
    wind, constant = _squares(shape, number)
    return by.wind * (constant - wind) + by.decay * _known(-constant, by.wind)


def bounded(
    price: Any, bias: Any, output: Array, shape: tuple[int, int], number: Number = float
) -> Any:
    """The supply |output e|^2 - price |w|^2 - bias in (e, w, 1); price, bias (1, 1)."""
    wind, constant = _squares(shape, number)
    q = shape[1]
    z = _known(_in_corner(output.T @ output, (q, q)), price)
    return z - price * wind - bias * constant


def conditions(
    P: MovingEllipsoid,
    shares: Sequence[Shares],
    over: MatrixSet,
    by: Multipliers,
    supply: Any,
    number: Number = float,
) -> tuple[list[Any], list[Any]]:
    """The matrices that must be positive definite, in two lists.

    For each end of the cell, with its shares X: [X_tube, P o; o'P, S], [X_gust, P o; o'P, T] and
    [X_terms, P l; l'P, r]. For each corner of the cell, as Bernstein coefficients of degree 2 in
    the scheduling command, of degree 1 where P or F does not change with it, minus

        [P A + A'P + alpha P + dP/dt, P E, P d; ., 0, 0; ., ., 0] + supply
        + sum of H'S H and H'T H over the symbols + sum of r times weights
        + [X_tube + X_gust + X_terms, 0; 0, 0].

    `number` converts a double into the arithmetic.
    """
    bounds = []
    for end, X in zip(P.ends, shares, strict=True):
        onto, left = (np.swapaxes(end @ side, -1, -2) for side in (over.onto, over.left.T))
        rows = (onto, onto, left)
        for own, row, multiplier in zip(X, rows, by[:3], strict=True):
            bounds.append(from_lower([[own], [row, multiplier]]))
    fixed = supply + _symbols(over, by)
    taken = [_in_corner(X.tube + X.gust + X.terms, fixed.shape[-2:]) for X in shares]
    falls = []
    for i, a in enumerate(P.accelerations):
        known = fixed if P.rate is None else fixed + _in_corner(a * P.rate, fixed.shape[-2:])
        for k in range(over.corners.shape[2]):
            F = over.corners[:, min(i, over.corners.shape[1] - 1), k]
            pairs = list(product(range(len(P.ends)), range(len(F))))
            M = [-(known + _motion(P.ends[e], F[f], by.decay) + taken[e]) for e, f in pairs]
            falls += [M[0], (M[1] + M[2]) * number(0.5), M[3]] if len(M) == 4 else M
    return bounds, falls


def _motion(P: Any, F: Array, decay: Any) -> Any:
    q = F.shape[-1]
    product = matmul(_in_corner(P, (q, len(F))), F)
    return product + np.swapaxes(product, -1, -2) + decay * _in_corner(P, (q, q))


def _symbols(over: MatrixSet, by: Multipliers) -> Any:
    """What the multipliers of the symbols and terms take."""
    M = sum(weight * by.terms[..., k : k + 1, k : k + 1] for k, weight in enumerate(over.weights))
    for symbols, multiplier in ((over.tube, by.tube), (over.gust, by.gust)):
        for H in symbols:
            M = M + matmul(matmul(H.T, multiplier), H)
    return M


def _squares(shape: tuple[int, int], number: Number) -> tuple[Array, Array]:
    """The matrices (q, q) of |w|^2 and of 1, of n deviations, for `shape` (n, q)."""
    n, q = shape
    size = [number(float(i >= n)) for i in range(q - 1)]
    zero = number(0.0)
    wind, constant = (np.full((q, q), zero) for _ in range(2))
    wind[range(q - 1), range(q - 1)] = size
    constant[-1, -1] = number(1.0)
    return wind, constant


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
