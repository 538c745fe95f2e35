"""Classes of multipliers as linear spaces with conditions, for the search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.lft_matrices import parts
from symheli.values.arrays import Array
from synthesis.certify.lft.multipliers import SCALINGS
from synthesis.numerics.polynomial.symmetric import basis

MOST_CORNERS = 64
"""Largest number of corners: full block multipliers are for few parameters."""


class Condition(NamedTuple):
    """sum_k x_k matrices[k] must be positive definite; matrices (unknowns, s, s)."""

    matrices: Array


class Class(NamedTuple):
    """A class of multipliers: its basis Q, S, R (unknowns, n, n) each, and the conditions on the
    unknowns.
    """

    Q: Array
    S: Array
    R: Array
    conditions: tuple[Condition, ...]


def check_scaling(scaling: str, sizes: Sequence[int]) -> str:
    """Return the name; raise an error that lists the classes for another one, or for more corners
    than `MOST_CORNERS`.
    """
    if scaling not in SCALINGS:
        raise UnknownNameError("scaling", scaling, SCALINGS)
    if scaling == "full block" and 2 ** len(sizes) > MOST_CORNERS:
        raise InputError(
            f"full block multipliers need 2^{len(sizes)} corners; take scaling='DG' for so many"
            " parameters"
        )
    return scaling


def multiplier_class(scaling: str, sizes: Sequence[int]) -> Class:
    """Return the class as a linear space with conditions."""
    n = sum(sizes)
    blocks = [part for part in parts(sizes) if part.stop > part.start]
    if n == 0:
        none = np.zeros((0, 0, 0))
        return Class(none, none, none, ())
    if scaling == "small gain":
        one = np.eye(n)[None]
        return Class(-one, 0 * one, one, (Condition(np.ones((1, 1, 1))),))
    if scaling == "full block":
        return _full(n, blocks, sizes)
    D = np.concatenate([_embedded(basis(b.stop - b.start), n, b) for b in blocks])
    G = (
        np.concatenate([_embedded(_skew(b.stop - b.start), n, b) for b in blocks])
        if scaling == "DG"
        else np.zeros((0, n, n))
    )
    R, S = np.concatenate([D, 0 * G]), np.concatenate([0 * D, G])
    return Class(-R, S, R, tuple(Condition(R[:, b, b]) for b in blocks))


def _full(n: int, blocks: list[slice], sizes: Sequence[int]) -> Class:
    symmetric = basis(n)
    general = np.eye(n * n).reshape(n * n, n, n)
    k, g = len(symmetric), len(general)
    zero = np.zeros((k, n, n))
    Q, R = (
        np.concatenate([symmetric, zero, np.zeros((g, n, n))]),
        np.concatenate([zero, symmetric, np.zeros((g, n, n))]),
    )
    S = np.concatenate([zero, zero, general])
    concave = [Condition(-Q[:, b, b]) for b in blocks]
    return Class(Q, S, R, (*concave, *(Condition(_at(Q, S, R, delta)) for delta in corners(sizes))))


def corners(sizes: Sequence[int]) -> Iterator[Array]:
    """The diagonals of Delta (n,) at the corners of the box."""
    for signs in product((-1.0, 1.0), repeat=len(sizes)):
        yield np.repeat(np.array(signs), sizes)


def _at(Q: Array, S: Array, R: Array, delta: Array) -> Array:
    side = delta[:, None] * S
    return delta[:, None] * Q * delta + side + np.swapaxes(side, -1, -2) + R


def _embedded(matrices: Array, n: int, block: slice) -> Array:
    out = np.zeros((len(matrices), n, n))
    out[:, block, block] = matrices
    return out


def _skew(n: int) -> Array:
    """Basis (n (n - 1)/2, n, n) of the antisymmetric matrices."""
    rows, columns = np.triu_indices(n, 1)
    out = np.zeros((len(rows), n, n))
    k = np.arange(len(rows))
    out[k, rows, columns], out[k, columns, rows] = np.sqrt(0.5), -np.sqrt(0.5)
    return out
