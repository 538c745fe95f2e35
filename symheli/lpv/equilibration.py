"""Zero and singular matrices in any units: decided after rows and columns are scaled."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array

SINGULAR = 1e12
"""An equilibrated matrix with a larger condition number counts as singular."""


NEGLIGIBLE_ENTRY = 1e-12
"""An entry smaller than this fraction of the largest of its row or column, after equilibration, is
treated as zero when the units are chosen.
"""


def equilibrate(size: Array) -> tuple[Array, Array]:
    """Return row and column factors that bring the largest entry of each to about one (zero rows
    and columns keep 1).

    They start from the least-squares fit of log size by -log row - log column, so that row * size *
    column is the same whatever the units of rows and columns. Source: Curtis and Reid, J. Inst.
    Maths Applics 10 (1972).
    """
    size = np.asarray(size, dtype=float)
    return peaks_to_one(size, *_logarithmic(size))


def peaks_to_one(size: Array, row: Array, column: Array, sweeps: int = 5) -> tuple[Array, Array]:
    """The factors nearest to `row` and `column`, by a few sweeps, with which the largest entry of
    each row and column is about one.
    """
    for _ in range(sweeps):
        scaled = row[:, None] * size * column
        peak = scaled.max(axis=1, initial=0.0)
        row = np.where(peak > 0, row / np.sqrt(np.where(peak > 0, peak, 1)), row)
        scaled = row[:, None] * size * column
        peak = scaled.max(axis=0, initial=0.0)
        column = np.where(peak > 0, column / np.sqrt(np.where(peak > 0, peak, 1)), column)
    return row, column


def _logarithmic(size: Array) -> tuple[Array, Array]:
    """Factors that minimise the squares of log(row * size * column) over the entries that are not
    zero, nor noise beside the others.
    """
    row, column = np.ones(size.shape[0]), np.ones(size.shape[1])
    counted = size > 0
    while np.any(counted):
        i, j = np.nonzero(counted)
        log, pattern = np.log(size[i, j]), counted.astype(float)
        # normal equations of log r_i + log c_j = -log size_ij
        normal = np.block(
            [[np.diag(pattern.sum(axis=1)), pattern], [pattern.T, np.diag(pattern.sum(axis=0))]]
        )
        right = -np.concatenate([np.bincount(i, log, len(row)), np.bincount(j, log, len(column))])
        factors = np.exp(np.linalg.lstsq(normal, right, rcond=None)[0])
        row, column = factors[: len(row)], factors[len(row) :]
        scaled = row[:, None] * size * column
        noise = counted & (
            scaled
            < NEGLIGIBLE_ENTRY
            * np.maximum(scaled.max(axis=1, keepdims=True), scaled.max(axis=0, keepdims=True))
        )
        if not np.any(noise):
            break
        counted &= ~noise
    return row, column


def significant(dependence: Array, constant: Array, tolerance: float) -> Array:
    """Entries whose `dependence` on the parameters is more than `tolerance` of the size their row
    and column give them.

    That size is one for all after rows and columns are scaled, so units play no part; what is below
    is rounding.
    """
    row, column = equilibrate(np.maximum(np.abs(constant), dependence))
    return row[:, None] * dependence * column > tolerance


def is_singular(M: Array) -> bool:
    """Whether a square matrix cannot be inverted in double precision, in any units of its rows and
    columns.
    """
    if not len(M):
        return False
    row, column = equilibrate(np.abs(M))
    return not np.linalg.cond(row[:, None] * M * column) <= SINGULAR


def loop_inverse(KD: Array) -> Array:
    """(I - KD)^-1 of a loop through feedthrough; exactly I where there is none. Raises `InputError`
    where it is singular.
    """
    eye = np.eye(len(KD))
    if not np.any(KD):
        return eye
    if is_singular(eye - KD):
        raise InputError(
            "the loop is not well posed: I - K D is singular; put an actuator or a delay between,"
            " or change the gain"
        )
    return np.linalg.inv(eye - KD)
