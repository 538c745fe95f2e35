"""Approximation with fewer copies of the parameters, and its error."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from symheli.errors import InputError
from symheli.lpv.balancing import REGULAR, balanced_gramians
from symheli.lpv.equilibration import equilibrate, significant
from symheli.lpv.lft.model import LFT
from symheli.lpv.lft.reduction import reduce
from symheli.lpv.lft_matrices import Block, parts
from symheli.values.arrays import Array
from symheli.values.numbers import positive, whole
from symheli.values.summary import summarized


class Truncation(NamedTuple):
    """A reduced `lft`, the largest `error` found on a dense grid of the box, and a proven `bound`
    on it (inf: none known).

    Both are spectral norms of the difference of [A B; C D] after rows and columns are scaled so
    that the largest dependence in each is about one: relative errors, whatever the units.
    """

    lft: LFT
    error: float
    bound: float

    __repr__ = summarized


def truncate(lft: LFT, error: float | None, order: int | None) -> Truncation:
    """Return the structured balanced truncation: copies with the smallest reachability and
    observability are removed first.

    Block-diagonal Gramians X >= M11 X M11' + M12 M12' and Y >= M11' Y M11 + M21' M21 make the error
    at most twice the sum of the singular values cut off, for any Delta of norm one. Source: Beck,
    Doyle and Glover, "Model reduction of multidimensional and uncertain systems", IEEE Trans.
    Automatic Control 41 (1996). Here they come from a linear fixed point that pays a factor m for m
    parameters; where that diverges the factor is dropped and nothing is proven.
    """
    if (error is None) == (order is None):
        raise InputError("give either the error allowed (>= 0) or the order wanted (>= 0)")
    allowed = None if error is None else positive(error, "error", or_zero=True)
    wanted = None if order is None else whole(order, "order")
    small = reduce(lft, 1e-12)
    if not small.order:
        return Truncation(small, 0.0, 0.0)
    row, column = equilibrate(_dependence(small))
    balanced, sigma, proven = _balanced(small, row, column)
    ranking = np.argsort(sigma)  # the least first
    grid = _grid(len(small.blocks))
    exact = lft.matrix(grid)

    def cut(count: int) -> tuple[LFT, float]:
        kept = np.sort(ranking[count:])
        smaller = _kept(balanced, kept)
        wrong = row[:, None] * (smaller.matrix(grid) - exact) * column
        return smaller, float(np.linalg.norm(wrong, 2, axis=(-2, -1)).max())

    count = 0 if wanted is None else max(0, small.order - wanted)
    while allowed is not None and count < small.order and cut(count + 1)[1] <= allowed:
        count += 1
    smaller, measured = cut(count)
    bound = 2.0 * float(sigma[ranking[:count]].sum()) if proven else np.inf
    return Truncation(smaller, measured, bound)


def _balanced(lft: LFT, row: Array, column: Array) -> tuple[LFT, Array, bool]:
    """The LFT with X = Y diagonal, that diagonal, and whether the Gramians prove the bound."""
    B, C = lft.M12 * column, row[:, None] * lft.M21
    sizes = lft.sizes
    proven = True
    grams = [_gramians(lft.M11, B, sizes, len(sizes)), _gramians(lft.M11.T, C.T, sizes, len(sizes))]
    if any(g is None for g in grams):
        proven = False
        grams = [_gramians(lft.M11, B, sizes, 1), _gramians(lft.M11.T, C.T, sizes, 1)]
    if any(g is None for g in grams):
        raise InputError(
            "no structured Gramians: the parameter loop is not contractive; narrow the ranges of"
            " the parameters"
        )
    each = [balanced_gramians(Y, X, REGULAR) for X, Y in zip(*grams, strict=True)]  # type: ignore[arg-type]
    into, out = block_diag(*(b.into for b in each)), block_diag(*(b.out for b in each))
    balanced = replace(lft, M11=into @ lft.M11 @ out, M12=into @ lft.M12, M21=lft.M21 @ out)
    return balanced, np.concatenate([b.values for b in each]), proven


def _gramians(M11: Array, B: Array, sizes: tuple[int, ...], factor: int) -> list[Array] | None:
    """Return the fixed point of X_i = factor (sum_j M_ij X_j M_ij' + B_i B_i'), None where it
    diverges.

    A positive semidefinite matrix of m block rows is at most m times its block diagonal: with
    factor m the inequality holds.
    """
    mask = np.zeros(M11.shape)
    for part in parts(sizes):
        mask[part, part] = 1.0
    constant = factor * mask * (B @ B.T)
    X = constant
    for _ in range(4000):
        new = constant + factor * mask * (M11 @ X @ M11.T)
        if not np.all(np.isfinite(new)) or np.abs(new).max() > 1e12 * np.abs(constant).max():
            return None
        if np.abs(new - X).max() <= 1e-14 * np.abs(new).max():
            return [new[part, part] for part in parts(sizes)]
        X = new
    return None


def _kept(lft: LFT, kept: Array) -> LFT:
    sizes = [int(np.sum((kept >= part.start) & (kept < part.stop))) for part in parts(lft.sizes)]
    blocks = tuple(Block(s, size) for s, size in zip(lft.parameters, sizes, strict=True))
    return replace(
        lft, M11=lft.M11[kept][:, kept], M12=lft.M12[kept], M21=lft.M21[:, kept], blocks=blocks
    )


def _dependence(lft: LFT) -> Array:
    """Largest change of each entry over the box, none where it is rounding."""
    change = np.abs(lft.matrix(_grid(len(lft.blocks))) - lft.M22).max(axis=0)
    return np.where(significant(change, lft.M22, 1e-12), change, 0.0)


def _grid(parameters: int) -> Array:
    points = {0: 1, 1: 201, 2: 25, 3: 11}.get(parameters, 5)
    return np.array(list(product(np.linspace(-1.0, 1.0, points), repeat=parameters)))
