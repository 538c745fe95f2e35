"""Reduction of the copies of the parameters without change of the model."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from symheli.errors import InputError
from symheli.lpv.balancing import Balancing, balancing
from symheli.lpv.equilibration import equilibrate, peaks_to_one, significant
from symheli.lpv.lft.model import LFT
from symheli.lpv.lft_matrices import Block, parts
from symheli.values.arrays import Array

SAMPLES = 12
"""Number of points of the box at which the parameter-dependent part is evaluated."""
TOLERANCES = (1e-12, 1e-14)
"""Tolerances of the reductions that are tried where nothing may be lost."""
NEARLY = 1e-6
"""Largest error of an inverse of coordinates that one step of Newton's method mends."""
LOSS = 64 * np.finfo(float).eps
"""Largest change of what an entry has of the parameters, in units of the size that row and column
give that part or of its own terms, that is rounding of the reduction itself.
"""
NOTHING = np.zeros((0, 0))
"""First block of a diagonal that may have no other."""


def reduce(lft: LFT, tolerance: float | None) -> LFT:
    """See `LFT.reduce`."""
    if tolerance is None:
        return reduce_without_loss(lft)
    return _one_parameter(lft, tolerance) if len(lft.blocks) == 1 else _structured(lft, tolerance)


def reduce_without_loss(lft: LFT) -> LFT:
    """Return the same model with the copies that exact ranks leave, or with fewer where these
    change nothing that depends on a parameter by more than `LOSS` of its own size, and no parameter
    goes.

    The constant part has no say: in coordinates of entries that nearly cancel a dependence that is
    small beside it may decide stability.
    """
    found = reduce_exactly(lft)
    M11, M12, M21 = (M.astype(float) for M in found[:3])
    blocks = tuple(Block(b.scheduling, n) for b, n in zip(lft.blocks, found.sizes, strict=True))
    whole = replace(lft, M11=M11, M12=M12, M21=M21, M22=0 * lft.M22, blocks=blocks)
    delta = _samples(whole)
    values, bar = whole.matrix(delta), _rounding(whole, delta)
    for tolerance in TOLERANCES if whole.order else ():
        smaller = reduce(whole, tolerance)
        change = np.abs(smaller.matrix(delta) - values)
        dropped = any(a and not b for a, b in zip(whole.sizes, smaller.sizes, strict=True))
        if np.all(change <= bar) and not dropped:
            return replace(smaller, M22=lft.M22)
    return replace(_in_balanced_coordinates(whole, found), M22=lft.M22)


def _in_balanced_coordinates(lft: LFT, exact: ExactCopies) -> LFT:
    """Return the copies of one parameter in balanced coordinates, formed in rationals: only entries
    are rounded. The LFT itself where it has several parameters or is nearly not minimal.
    """
    if len(lft.blocks) != 1 or not lft.order:
        return lft
    into, out, _ = _balancing(lft)
    if not np.abs(into @ out - np.eye(lft.order)).max() < NEARLY:
        return lft
    T, near = _rational(out), _rational(into)
    back = (2 * _rational(np.eye(lft.order)) - near @ T) @ near  # a step of Newton's method
    M11, M12, M21 = back @ exact.M11 @ T, back @ exact.M12, exact.M21 @ T
    return replace(lft, M11=M11.astype(float), M12=M12.astype(float), M21=M21.astype(float))


class ExactCopies(NamedTuple):
    """M11, M12, M21 of an LFT in rationals, and the numbers of copies of its parameters."""

    M11: Array
    M12: Array
    M21: Array
    sizes: tuple[int, ...]


def reduce_exactly(lft: LFT) -> ExactCopies:
    """Return the copies that the inputs reach and the outputs show, by ranks in rational
    arithmetic: the same function of the parameters, to the last digit.
    """
    lft = _without_idle_copies(lft)
    copies = _units(lft).copies if lft.order else np.ones(0)
    M11 = _rational(copies[:, None] * lft.M11 / copies)
    found = ExactCopies(
        M11, _rational(copies[:, None] * lft.M12), _rational(lft.M21 / copies), lft.sizes
    )
    while True:
        seen = _reached_exactly(ExactCopies(found.M11.T, found.M21.T, found.M12.T, found.sizes))
        back = ExactCopies(seen.M11.T, seen.M21.T, seen.M12.T, seen.sizes)
        smaller = _reached_exactly(back)
        if smaller.sizes == found.sizes:
            return found
        found = smaller


def exact_units(lft: LFT) -> Array | None:
    """Return the units (n,) of the copies in which `reduce_exactly` leaves all of them: row i of M
    times the first, column i by it; None where it leaves fewer.
    """
    if reduce_exactly(lft).sizes != lft.sizes:
        return None
    return _units(lft).copies if lft.order else np.ones(0)


def _reached_exactly(own: ExactCopies) -> ExactCopies:
    """Return what the inputs reach alone, in coordinates that are some of the copies."""
    here = parts(own.sizes)
    spans = [_span(own.M12[rows]) for rows in here]
    while True:
        grown = [
            _span(
                np.hstack([V, *(own.M11[a, b] @ W for b, (W, _) in zip(here, spans, strict=True))])
            )
            for a, (V, _) in zip(here, spans, strict=True)
        ]
        if [len(k) for _, k in grown] == [len(k) for _, k in spans]:
            break
        spans = grown
    chosen = [a.start + k for a, (_, own_rows) in zip(here, spans, strict=True) for k in own_rows]
    V = block_diag(NOTHING, *(basis for basis, _ in spans))
    sizes = tuple(len(rows) for _, rows in spans)
    return ExactCopies((own.M11 @ V)[chosen], own.M12[chosen], own.M21 @ V, sizes)


def _span(columns: Array) -> tuple[Array, list[int]]:
    """Return a basis (n, r) of the columns and r rows in which it is the identity."""
    rest = [column for column in columns.T if any(column)]
    basis: list[Array] = []
    rows: list[int] = []
    for column in rest:
        for v, k in zip(basis, rows, strict=True):
            column = column - column[k] * v
        k = max(range(len(column)), key=lambda i: abs(column[i]))
        if column[k] != 0:
            column = column / column[k]
            basis = [v - v[k] * column for v in basis]
            basis, rows = [*basis, column], [*rows, k]
    return np.array(basis, dtype=object).reshape(len(basis), len(columns)).T, rows


def _rational(M: Array) -> Array:
    out = np.empty(M.shape, dtype=object)
    out.ravel()[:] = [Fraction(v) for v in M.ravel().tolist()]
    return out


def _rounding(lft: LFT, delta: Array) -> Array:
    """Changes of the entries (SAMPLES, nx + ny, nx + nu) that count as rounding at these points."""
    own = np.repeat(delta, lft.sizes, axis=-1)
    inverse = np.abs(np.linalg.inv(np.eye(lft.order) - lft.M11 * own[:, None, :]))
    terms = (np.abs(lft.M21) * np.abs(own)[:, None, :]) @ inverse @ np.abs(lft.M12)
    size = np.abs(lft.matrix(delta) - lft.M22).max(axis=0, initial=0.0)
    rows, columns = equilibrate(size)
    depends = np.any(size, axis=1)[:, None] & np.any(size, axis=0)
    return LOSS * np.maximum(terms, np.where(depends, 1 / (rows[:, None] * columns), 0.0))


def _without_idle_copies(lft: LFT) -> LFT:
    """Remove the copies that zeros of M cut off from its inputs or from its outputs; exact."""
    loop, reached, seen = lft.M11 != 0, np.any(lft.M12, axis=1), np.any(lft.M21, axis=0)
    for _ in range(lft.order):
        reached, seen = reached | (loop @ reached), seen | (loop.T @ seen)
    kept = [int(i) for i in np.flatnonzero(reached & seen)]
    sizes = [sum(here.start <= i < here.stop for i in kept) for here in parts(lft.sizes)]
    blocks = tuple(Block(b.scheduling, n) for b, n in zip(lft.blocks, sizes, strict=True))
    return replace(
        lft, M11=lft.M11[np.ix_(kept, kept)], M12=lft.M12[kept], M21=lft.M21[:, kept], blocks=blocks
    )


def _one_parameter(lft: LFT, tolerance: float) -> LFT:
    """Minimal order, exactly.

    M(delta) = M22 + sum_i delta^i M21 M11^(i-1) M12, so the order is the rank of the block Hankel
    matrix of its Markov parameters, and the singular vectors realize it (Ho-Kalman). Singular
    values below `tolerance` times the largest count as zero, as does dependence that is not
    `significant`.
    """
    n = lft.order
    rows, columns = lft.M22.shape
    markov, power = [], lft.M12
    while len(markov) < 2 * n + 1 and np.abs(power).max(initial=0) > 0:
        markov.append(lft.M21 @ power)
        power = lft.M11 @ power
    depth = len(markov) if np.abs(power).max(initial=0) == 0 else n
    markov += [np.zeros((rows, columns))] * (2 * depth - len(markov))
    if depth == 0:
        return _projected(lft, [np.zeros((n, 0))], [np.zeros((n, 0))])
    depends = significant(np.abs(np.stack(markov)).max(axis=0), lft.M22, tolerance)
    markov = [np.where(depends, M, 0.0) for M in markov]
    # states and channels of different size: balance rows and columns so that the rank is judged
    # entry by entry
    size = np.abs(np.stack(markov)).max(axis=0)
    row_scale, column_scale = equilibrate(size)
    scaled = [row_scale[:, None] * M * column_scale for M in markov]
    hankel = np.block([[scaled[i + j] for j in range(depth)] for i in range(depth)])
    shifted = np.block(
        [
            [
                scaled[i + j + 1] if i + j + 1 < len(scaled) else np.zeros((rows, columns))
                for j in range(depth)
            ]
            for i in range(depth)
        ]
    )
    U, s, Vt = np.linalg.svd(hankel)
    r = int(np.sum(s > tolerance * s[0])) if s[0] > 0 else 0
    root = np.sqrt(s[:r])
    M11 = (U[:, :r].T @ shifted @ Vt[:r].T) / root[:, None] / root
    M12 = root[:, None] * Vt[:r, :columns] / column_scale
    M21 = U[:rows, :r] * root / row_scale[:, None]
    # what does not depend on the parameter is cut off from it to the last bit
    M12, M21 = (
        np.where(np.any(depends, axis=0), M12, 0.0),
        np.where(np.any(depends, axis=1)[:, None], M21, 0.0),
    )
    return _balanced(
        replace(lft, M11=M11, M12=M12, M21=M21, blocks=(Block(lft.blocks[0].scheduling, r),))
    )


def _balanced(lft: LFT) -> LFT:
    """Coordinates of the copies of one parameter in which its Hankel matrix is balanced, near the
    units the model came in.

    What a small gain proves depends on coordinates, of which these are as good as any: the same
    however the LFT was made.
    """
    if not lft.order:
        return lft
    into, out, _ = _balancing(lft)
    return replace(lft, M11=into @ lft.M11 @ out, M12=into @ lft.M12, M21=lft.M21 @ out)


def _balancing(lft: LFT) -> Balancing:
    """Return the coordinates of the copies of one parameter that balance its Hankel matrix."""
    power, size = lft.M12, np.zeros(lft.M22.shape)
    for _ in range(2 * lft.order):
        size, power = np.maximum(size, np.abs(lft.M21 @ power)), lft.M11 @ power
    height, width = lft.M22.shape
    rows, columns = peaks_to_one(size, np.ones(height), np.ones(width))
    reach, sight = [lft.M12 * columns], [rows[:, None] * lft.M21]
    for _ in range(lft.order - 1):
        reach.append(lft.M11 @ reach[-1])
        sight.append(sight[-1] @ lft.M11)
    return balancing(np.vstack(sight), np.hstack(reach))


def _structured(lft: LFT, tolerance: float) -> LFT:
    """Remove unreachable and unobservable parts, block by block, all blocks together.

    The subspaces of each parameter's copies that words in the M11 blocks reach (and, transposed,
    see) are the smallest realization for parameters that do not commute; parameters that do may
    allow fewer still. Source: Cockburn and Morton, "Linear fractional representations of uncertain
    systems", Automatica 33 (1997). Ranks are judged in coordinates in which rows, columns and
    copies are of one size, whatever the units.
    """
    lft = _without_rounding(lft, tolerance)
    units = _units(lft)
    lft = replace(
        lft,
        M11=units.copies[:, None] * lft.M11 / units.copies,
        M12=units.copies[:, None] * lft.M12,
        M21=lft.M21 / units.copies,
    )
    while True:
        seen = _reached(lft.M11.T, (units.rows[:, None] * lft.M21).T, lft.blocks, tolerance)
        smaller = _projected(lft, seen, seen)
        reached = _reached(smaller.M11, smaller.M12 * units.columns, smaller.blocks, tolerance)
        smaller = _projected(smaller, reached, reached)
        if smaller.order == lft.order:
            return smaller
        lft = smaller


class _Units(NamedTuple):
    """Factors that bring the rows (nx + ny,) and columns (nx + nu,) of M, and the copies (n,), to
    one size.
    """

    rows: Array
    columns: Array
    copies: Array


def _samples(lft: LFT) -> Array:
    """Points of the box (SAMPLES, m), the same every time; nearer to its middle where the loop is
    singular.
    """
    delta = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, len(lft.blocks)))
    for shrink in (1.0, 0.7, 0.5, 0.2, 0.0):
        try:
            lft.matrix(shrink * delta)
        except InputError:
            continue
        return shrink * delta
    return 0.0 * delta


def _without_rounding(lft: LFT, tolerance: float) -> LFT:
    """Decouple rows and columns of M in which no entry depends on the parameters by more than
    rounding.
    """
    change = np.abs(lft.matrix(_samples(lft)) - lft.M22).max(axis=0)
    depends = significant(change, lft.M22, tolerance)
    rows, columns = np.any(depends, axis=1), np.any(depends, axis=0)
    return replace(
        lft, M12=np.where(columns, lft.M12, 0.0), M21=np.where(rows[:, None], lft.M21, 0.0)
    )


def _units(lft: LFT) -> _Units:
    delta = np.repeat(_samples(lft), lft.sizes, axis=-1)
    rows, columns = equilibrate(np.abs(lft.matrix(_samples(lft))).max(axis=0, initial=0.0))
    loop = np.eye(lft.order) - lft.M11 * delta[:, None, :]
    reach = np.abs(
        np.linalg.solve(loop, np.broadcast_to(lft.M12 * columns, (len(delta), *lft.M12.shape)))
    ).max(axis=(0, 2), initial=0.0)
    back = np.swapaxes(np.eye(lft.order) - delta[:, :, None] * lft.M11, -1, -2)
    sight = np.broadcast_to((rows[:, None] * lft.M21).T, (len(delta), lft.order, len(rows)))
    see = np.abs(np.linalg.solve(back, sight)).max(axis=(0, 2), initial=0.0)
    # what is only reached, or only seen, goes away: meanwhile it is of size one
    reached, seen = np.where(reach > 0, reach, 1.0), np.where(see > 0, see, 1.0)
    only = (reach > 0) != (see > 0)
    copies = np.where(only, 1.0, 0.5) * (np.log2(seen) - np.log2(reached))
    return _Units(rows, columns, np.exp2(np.round(copies)))  # powers of two cost no rounding


def _reached(M11: Array, M12: Array, blocks: tuple[Block, ...], tolerance: float) -> list[Array]:
    """Orthonormal bases (n_i, r_i) of what the inputs reach in each block."""
    part = parts([block.size for block in blocks])
    scale = max(float(np.abs(M12).max(initial=0.0)), 1e-300)
    bases = [
        _extended(np.zeros((block.size, 0)), M12[here], tolerance * scale)
        for block, here in zip(blocks, part, strict=True)
    ]
    reach = max(float(np.abs(M11).max(initial=0.0)), 1e-300)
    while True:
        grown = []
        for i, here in enumerate(part):
            images = [M11[here, there] @ bases[j] for j, there in enumerate(part)]
            grown.append(_extended(bases[i], np.hstack(images), tolerance * reach))
        if all(a.shape == b.shape for a, b in zip(grown, bases, strict=True)):
            return grown
        bases = grown


def _extended(basis: Array, columns: Array, threshold: float) -> Array:
    """The basis together with the directions of `columns` it lacks."""
    rest = columns
    for _ in range(2):  # twice is enough for orthogonality to rounding
        rest = rest - basis @ (basis.T @ rest)
    if min(rest.shape) == 0:
        return basis
    U, s, _ = np.linalg.svd(rest, full_matrices=False)
    return np.hstack([basis, U[:, s > threshold]])


def _projected(lft: LFT, left: list[Array], right: list[Array]) -> LFT:
    """The LFT with copies z_i = right_i z_i', left_i' right_i = I."""
    L, R = block_diag(NOTHING, *left), block_diag(NOTHING, *right)
    blocks = tuple(
        Block(block.scheduling, basis.shape[1])
        for block, basis in zip(lft.blocks, right, strict=True)
    )
    return replace(lft, M11=L.T @ lft.M11 @ R, M12=L.T @ lft.M12, M21=lft.M21 @ R, blocks=blocks)
