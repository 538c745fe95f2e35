"""Fewer copies of the parameters, the same model."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.arrays import Array
from symheli.lpv.equilibration import equilibrate, significant
from symheli.lpv.lft.model import LFT, Block, parts

SAMPLES = 12
"""Points of the box at which the size of what depends on the parameters is looked at."""


def reduce(lft: LFT, tolerance: float) -> LFT:
    """See `LFT.reduce`: what no input reaches and no output sees is removed, block by block, all blocks together.

    The subspaces of each parameter's copies that words in the M11 blocks reach (and, transposed, see) are the smallest
    realization for one parameter and for parameters that do not commute; parameters that do may allow fewer still. Source:
    Cockburn and Morton, "Linear fractional representations of uncertain systems", Automatica 33 (1997).

    Ranks are judged in coordinates in which rows, columns and copies are of one size, whatever the units. A loop whose powers
    end, that of a polynomial, is made strictly triangular again, so that what was a polynomial is one to the last bit.
    """
    lft = _without_rounding(lft, tolerance)
    units = _units(lft)
    lft = replace(lft, M11=units.copies[:, None] * lft.M11 / units.copies, M12=units.copies[:, None] * lft.M12, M21=lft.M21 / units.copies)
    while True:
        seen = _reached(lft.M11.T, (units.rows[:, None] * lft.M21).T, lft.blocks, tolerance)
        smaller = _projected(lft, seen, transposed=True)
        reached = _reached(smaller.M11, smaller.M12 * units.columns, smaller.blocks, tolerance)
        smaller = _projected(smaller, reached, transposed=False)
        if smaller.order == lft.order:
            return smaller
        lft = smaller


def steps(M11: Array) -> int | None:
    """Number of powers of the loop until they vanish whatever the parameters, by the pattern of its zeros; None where they go on."""
    left, pattern = np.ones(len(M11), dtype=bool), M11 != 0
    for k in range(len(M11) + 1):
        if not np.any(left):
            return k
        fed = left & np.any(pattern[:, left], axis=1)
        if np.array_equal(fed, left):
            return None
        left = fed
    return None


class _Units(NamedTuple):
    """Factors that bring the rows (nx + ny,) and columns (nx + nu,) of M, and the copies (n,), to one size."""

    rows: Array
    columns: Array
    copies: Array


def _samples(lft: LFT) -> Array:
    """Points of the box (SAMPLES, m), the same every time; nearer to its middle where the loop is singular."""
    delta = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, len(lft.blocks)))
    for shrink in (1.0, 0.7, 0.5, 0.2, 0.0):
        try:
            lft.matrix(shrink * delta)
        except InputError:
            continue
        return shrink * delta
    return 0.0 * delta


def _without_rounding(lft: LFT, tolerance: float) -> LFT:
    """Rows and columns of M in which no entry depends on the parameters by more than rounding are cut off from them."""
    change = np.abs(lft.matrix(_samples(lft)) - lft.M22).max(axis=0)
    depends = significant(change, lft.M22, tolerance)
    rows, columns = np.any(depends, axis=1), np.any(depends, axis=0)
    return replace(lft, M12=np.where(columns, lft.M12, 0.0), M21=np.where(rows[:, None], lft.M21, 0.0))


def _units(lft: LFT) -> _Units:
    delta = np.repeat(_samples(lft), lft.sizes, axis=-1)
    rows, columns = equilibrate(np.abs(lft.matrix(_samples(lft))).max(axis=0, initial=0.0))
    loop = np.eye(lft.order) - lft.M11 * delta[:, None, :]
    reach = np.abs(np.linalg.solve(loop, np.broadcast_to(lft.M12 * columns, (len(delta), *lft.M12.shape)))).max(axis=(0, 2), initial=0.0)
    back = np.swapaxes(np.eye(lft.order) - delta[:, :, None] * lft.M11, -1, -2)
    sight = np.broadcast_to((rows[:, None] * lft.M21).T, (len(delta), lft.order, len(rows)))
    see = np.abs(np.linalg.solve(back, sight)).max(axis=(0, 2), initial=0.0)
    both = (reach > 0) & (see > 0)
    copies = 0.5 * (np.log2(np.where(both, see, 1.0)) - np.log2(np.where(both, reach, 1.0)))
    return _Units(rows, columns, np.exp2(np.round(copies)))  # powers of two cost no rounding


class _Subspace(NamedTuple):
    """Orthonormal `basis` (n_i, r_i) of what inputs reach in a block, and the `level` (r_i,) of each direction.

    Where the powers of the loop end: the length of the longest words that reach it, so that the loop only leads upwards.
    """

    basis: Array
    level: Array

    def extended(self, columns: Array, level: int, threshold: float) -> _Subspace:
        """Together with the directions of `columns` it lacks."""
        rest = columns
        for _ in range(2):  # twice is enough for orthogonality to rounding
            rest = rest - self.basis @ (self.basis.T @ rest)
        if min(rest.shape) == 0:
            return self
        U, s, _ = np.linalg.svd(rest, full_matrices=False)
        new = U[:, s > threshold]
        return _Subspace(np.hstack([self.basis, new]), np.concatenate([self.level, np.full(new.shape[1], level)]))


def _reached(M11: Array, M12: Array, blocks: tuple[Block, ...], tolerance: float) -> list[_Subspace]:
    """What the inputs reach in each block."""
    part = parts([block.size for block in blocks])
    threshold = tolerance * float(np.abs(M12).max(initial=0.0))
    spaces = [_Subspace(np.zeros((block.size, 0)), np.zeros(0, dtype=int)) for block in blocks]
    end = steps(M11)
    words = [[M12[here] for here in part]]
    if end is not None:
        for _ in range(end - 1):
            words.append(
                [_compressed(np.hstack([M11[here, there] @ w for there, w in zip(part, words[-1], strict=True)])) for here in part]
            )
        for level in reversed(range(end)):
            spaces = [space.extended(w, level, threshold) for space, w in zip(spaces, words[level], strict=True)]
        return spaces
    spaces = [space.extended(w, 0, threshold) for space, w in zip(spaces, words[0], strict=True)]
    while True:
        images = [np.hstack([M11[here, there] @ s.basis for there, s in zip(part, spaces, strict=True)]) for here in part]
        reach = tolerance * float(np.abs(M11).max(initial=0.0))
        grown = [space.extended(image, 0, reach) for space, image in zip(spaces, images, strict=True)]
        if all(a.basis.shape == b.basis.shape for a, b in zip(grown, spaces, strict=True)):
            return grown
        spaces = grown


def _compressed(columns: Array) -> Array:
    """As few columns as rows with the same span and size."""
    if columns.shape[1] <= columns.shape[0]:
        return columns
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U * s


def _projected(lft: LFT, spaces: list[_Subspace], *, transposed: bool) -> LFT:
    """The LFT with the copies of these subspaces, of the loop or of its transpose."""
    T = _diagonal([space.basis for space in spaces])
    M11 = T.T @ lft.M11 @ T
    if steps(lft.M11) is not None:
        level = np.concatenate([space.level for space in spaces])
        upwards = level[:, None] > level
        M11 = np.where(upwards.T if transposed else upwards, M11, 0.0)
    blocks = tuple(Block(block.scheduling, space.basis.shape[1]) for block, space in zip(lft.blocks, spaces, strict=True))
    return replace(lft, M11=M11, M12=T.T @ lft.M12, M21=lft.M21 @ T, blocks=blocks)


def _diagonal(parts: list[Array]) -> Array:
    out = np.zeros((sum(p.shape[0] for p in parts), sum(p.shape[1] for p in parts)))
    i = j = 0
    for p in parts:
        out[i : i + p.shape[0], j : j + p.shape[1]] = p
        i, j = i + p.shape[0], j + p.shape[1]
    return out
