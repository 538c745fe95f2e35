"""The inequality of a gain: for all (x, w) other than zero

    d(x'P x)/dt + sum z_k' M_k z_k + |y|^2 - g^2 |f|^2 < 0

(sampled: x(t+1)'P x(t+1) - x'P x), P symmetric and of any sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import matmul
from synthesis.robust.multipliers.loop import Extended


def motion(loop: Extended, P: Array, sampled: bool) -> Array:
    """Return the matrix of the change of x'P x, in (x, w)."""
    n, m = loop.B.shape
    move = np.hstack([loop.A, loop.B])
    if sampled:
        F = matmul(matmul(move.T, P), move)
        F[:n, :n] = F[:n, :n] - P
        return F
    F = np.zeros((n + m, n + m), dtype=move.dtype)
    F[:n] = matmul(P, move)
    return np.asarray(F + F.T)


def supplied(loop: Extended, forms: Sequence[Array]) -> Array:
    """Return the matrix of the sum of the forms of the blocks' signals."""
    parts = [matmul(matmul(Z.T, M), Z) for Z, M in zip(loop.Z, forms, strict=True)]
    n = sum(loop.B.shape)
    return sum(parts, np.zeros((n, n), dtype=loop.A.dtype))


def energy(loop: Extended, into: Sequence[int]) -> tuple[Array, Array]:
    """Return the matrices of |y|^2 and of |f|^2."""
    n, m = loop.B.shape
    E = np.zeros((n + m, n + m), dtype=loop.A.dtype)
    at = [n + i for i in into]
    E[at, at] = 1
    return matmul(loop.Y.T, loop.Y), E


def left_side(
    loop: Extended, P: Array, forms: Sequence[Array], into: Sequence[int], g2: Any, sampled: bool
) -> Array:
    """Return the matrix that is negative definite."""
    out, enters = energy(loop, into)
    return motion(loop, P, sampled) + supplied(loop, forms) + out - g2 * enters
