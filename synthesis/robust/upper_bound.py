"""Upper bounds for every frequency, by scalings that commute with the blocks.

At a frequency, M the response from w to z, blocks of norm at most 1/level cannot close the loop if

    W - M* Z M - i (G M - M* G*) > 0,   Z = diag(d_k I or D_k), W = level^2 Z (of the sizes of w)

with D_k > 0 and G_k Hermitian for a real number at several places, d_k > 0 for full dynamics. The
scalings found at one frequency hold as far as the left side stays positive definite, which is
decided in integers. Frequencies are taken until nothing is left between.

References
----------
Fan, Tits and Doyle, IEEE Trans. Automatic Control 36 (1991); Roos and Biannic, "Efficient
computation of a guaranteed stability domain for a high-order parameter dependent plant", American
Control Conference (2010), for the intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.symmetric import svec
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import ConeProgram, Solver, solve
from synthesis.robust.intervals import Check, Interval, LevelProof, Scalings
from synthesis.robust.structure import BlockLoop

LEAST_MARGIN = 1e-7
"""The left side counts as positive where its least eigenvalue is above this, for scalings <= 1."""
SAME = 1e-4
"""Relative distance of frequencies below which one that decides again is the same."""
MAX_FREQUENCIES = 60
"""Largest number of frequencies; beyond it nothing is proven."""
NARROW = 1e-9
"""Relative width of an interval of frequencies below which its level is raised."""
BISECTIONS = 14
"""Bisections of the level at one frequency."""
LEVEL_BITS, SCALING_BITS = 24, 40
"""Binary places of a level, and of the entries of scalings <= 1."""
FAR = 2.0**20
"""Frequency, in units of the fastest pole, at which scalings for all higher ones are checked."""
GROWTH = 1.001
"""Factor by which a level is raised above the least at the frequency that decides."""
MAX_LEVEL = 1e4
"""Largest level, in units of the start, that is looked for."""


class Upper(NamedTuple):
    """The level, the frequency that decides it, and its proof; inf and None where there is none."""

    level: float
    omega: float
    proof: Any


def proven_level(loop: BlockLoop, start: float, *, performance: bool) -> Upper:
    """Return the least level, from `start` on in steps of `GROWTH`, that no block exceeds at any
    frequency: of all blocks, or of the performance alone beside blocks of norm 1.

    Proven of `loop.exact`, in integers.
    """
    unit, check, rows, columns = _checked(loop, start, performance)
    transfer = check.transfer
    level, decides, step = _short(start / unit), math.nan, GROWTH
    known: list[tuple[float, Scalings]] = []
    while transfer.stable and level < MAX_LEVEL:
        failed, covered = _uncovered(loop, check, level, known)
        if failed is None:
            proof = LevelProof(level, rows, columns, loop.parts, performance, tuple(covered))
            return Upper(unit * level, decides, proof)
        # where a frequency decides again, scalings that are found do not hold far enough
        step = step**2 if abs(failed - decides) <= SAME * failed else GROWTH
        decides = failed
        least = level_at(transfer.response(failed), loop, level, performance)
        level = _short(max(least, level) * step) if math.isfinite(least) else math.inf
    return Upper(math.inf, decides, None)


def held_level(loop: BlockLoop, level: float, *, performance: bool) -> Upper:
    """Return the proof of one level, rounded up to fewer bits; inf and the frequency that has none
    where it is not found.
    """
    unit, check, rows, columns = _checked(loop, level, performance)
    own = _short(level / unit)
    if not check.transfer.stable:
        return Upper(math.inf, math.nan, None)
    failed, covered = _uncovered(loop, check, own, [])
    if failed is not None:
        return Upper(math.inf, failed, None)
    proof = LevelProof(own, rows, columns, loop.parts, performance, tuple(covered))
    return Upper(unit * own, math.nan, proof)


def _checked(loop: BlockLoop, level: float, performance: bool) -> tuple[float, Check, Array, Array]:
    """Return the unit of levels near this one, the check in its units, and those of z and w."""
    unit = 2.0 ** round(math.log2(level))
    rows, columns = loop.units(unit, performance)
    transfer = loop.in_rationals.transfer.scaled(rows, columns)
    return unit, Check.of(transfer, loop.parts, performance), rows, columns


def _short(level: float) -> float:
    """Return a level rounded up to fewer bits: the integers of the check stay short."""
    return math.ldexp(math.ceil(math.ldexp(level, LEVEL_BITS)), -LEVEL_BITS)


def level_at(M: Array, loop: BlockLoop, low: float, performance: bool) -> float:
    """Return the least level above `low` of a response, from above; inf beyond `MAX_LEVEL`."""
    high = 1.01 * low
    while scalings_at(M, loop, high, performance) is None:
        low, high = high, 2 * high
        if high > MAX_LEVEL:
            return math.inf
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        if high / low < 1 + 1e-5:
            break
        if scalings_at(M, loop, middle, performance) is None:
            low = middle
        else:
            high = middle
    return high


def _uncovered(
    loop: BlockLoop, check: Check, level: float, known: list[tuple[float, Scalings]]
) -> tuple[float | None, list[Interval]]:
    """Return a frequency at which the level has no scalings, None where every one is covered, and
    the intervals that are.
    """
    paces = loop.paces
    slow, fast = (float(paces[0]), float(paces[-1])) if len(paces) else (1.0, 1.0)
    waiting, covered, omega = [(0.0, math.inf)], [], 0.0

    def joined(omega: float, by: Scalings) -> tuple[float, float] | None:
        held = check.reach(by, min(omega, FAR * fast), level)
        if held is not None:
            covered.append(Interval(*held, by))
        return held

    for omega, found in known:
        if _touches(waiting, omega):
            waiting = _without(waiting, joined(omega, found))
    for _ in range(MAX_FREQUENCIES):
        if not waiting:
            return None, covered
        low, high = waiting.pop()
        omega = _inside(low, high, slow, fast)
        found = scalings_at(check.transfer.response(omega), loop, level, check.performance)
        if found is None:
            return omega, covered
        held = joined(omega, found)
        if held is None or held[1] - held[0] < NARROW * omega:
            return omega, covered
        known.append((omega, found))
        waiting = _without([*waiting, (low, high)], held)
    return omega, covered


def _touches(intervals: Sequence[tuple[float, float]], omega: float) -> bool:
    return any(low <= omega <= high for low, high in intervals)


def _inside(low: float, high: float, slow: float, fast: float) -> float:
    if low == 0.0 and math.isinf(high):
        return math.sqrt(slow * fast)
    if low == 0.0:
        return min(0.5 * high, 0.1 * slow) if high > 0.2 * slow else 0.0
    if math.isinf(high):
        return max(2 * low, 10 * fast) if low < 5 * fast else math.inf
    return math.sqrt(low * high)


def _without(
    intervals: Sequence[tuple[float, float]], held: tuple[float, float] | None
) -> list[tuple[float, float]]:
    if held is None:
        return list(intervals)
    out = []
    for low, high in intervals:
        for a, b in ((low, min(high, held[0])), (max(low, held[1]), high)):
            if a < b:
                out.append((a, b))
    return out


def _levelled(W: Array, loop: BlockLoop, level: float, performance: bool) -> Array:
    out = W.copy()
    for k, part in enumerate(loop.parts):
        if not performance or k == len(loop.parts) - 1:
            out[part.columns] = out[part.columns] * level**2
    return out


def scalings_at(M: Array, loop: BlockLoop, level: float, performance: bool) -> Scalings | None:
    """Return scalings <= 1 that show the level at one frequency; None where there are none."""
    nz, nw = M.shape
    basis = _basis(loop, nz, nw)
    # each column in units of its own, in which a response at a peak is no larger than another
    unit = 1 / np.hypot(1.0, np.linalg.norm(M, axis=0))
    F = [
        unit[:, None] * _left(M, Scalings(Z, _levelled(W, loop, level, performance), G)) * unit
        for Z, W, G in basis
    ]
    positive = [W for _, W, _ in basis]
    rows, sizes, right = [], [], []
    for each, limit in ((F, None), (positive, None), (positive, 1.0)):
        sign = -1.0 if limit is None else 1.0
        block = np.stack([sign * svec(_real(H)) for H in each], axis=1)
        margin = svec(np.eye(2 * nw)) if limit is None else 0 * svec(np.eye(2 * nw))
        rows.append(np.column_stack([block, margin]))
        right.append(0 * margin if limit is None else svec(np.eye(2 * nw)))
        sizes.append(2 * nw)
    cost = np.zeros(len(basis) + 1)
    cost[-1] = -1.0
    program = ConeProgram(
        cost, sparse.csc_matrix(np.vstack(rows)), np.concatenate(right), tuple(sizes), 0
    )
    found = solve(program, Solver("CLARABEL"))
    if found.x is None or found.answer is not Answer.SOLVED or found.x[-1] <= LEAST_MARGIN:
        return None
    x = found.x[:-1]
    x = np.ldexp(np.rint(np.ldexp(x, SCALING_BITS)), -SCALING_BITS)
    return Scalings(*(np.tensordot(x, np.stack([each[i] for each in basis]), 1) for i in range(3)))


def _left(M: Array, by: Scalings) -> Array:
    """Return the left side of the inequality for a response M; of `by` W has the level."""
    turned = by.G @ M
    return by.W - M.conj().T @ by.Z @ M - 1j * (turned - turned.conj().T)


def _basis(loop: BlockLoop, nz: int, nw: int) -> list[tuple[Array, Array, Array]]:
    out = []
    for part in loop.parts:
        n = part.rows.stop - part.rows.start
        if not part.real:
            Z, W, G = np.zeros((nz, nz)), np.zeros((nw, nw)), np.zeros((nw, nz))
            Z[part.rows, part.rows] = np.eye(n)
            W[part.columns, part.columns] = np.eye(part.columns.stop - part.columns.start)
            out.append((Z + 0j, W + 0j, G + 0j))
            continue
        for H in _hermitian(n):
            Z, W, G = (np.zeros(s, complex) for s in ((nz, nz), (nw, nw), (nw, nz)))
            Z[part.rows, part.rows], W[part.columns, part.columns] = H, H
            out.append((Z, W, G))
        for H in _hermitian(n):
            Z, W, G = (np.zeros(s, complex) for s in ((nz, nz), (nw, nw), (nw, nz)))
            G[part.columns, part.rows] = H
            out.append((Z, W, G))
    return out


def _hermitian(n: int) -> list[Array]:
    """Return a basis of the Hermitian matrices."""
    out = []
    for i in range(n):
        for j in range(i + 1):
            H = np.zeros((n, n), complex)
            H[i, j] = H[j, i] = 1.0
            out.append(H)
            if i != j:
                H = np.zeros((n, n), complex)
                H[i, j], H[j, i] = 1j, -1j
                out.append(H)
    return out


def _real(H: Array) -> Array:
    """Return the real symmetric matrix that is definite where H is."""
    real, imaginary = np.real(H), np.imag(H)
    return np.block([[real, -imaginary], [imaginary, real]])
