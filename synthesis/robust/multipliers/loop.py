"""The loop of a model with the filters of its blocks' multipliers, in doubles or in rationals."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import matmul
from synthesis.robust.multipliers.classes import Multipliers


class Wired(NamedTuple):
    """A class of multipliers, and the numbers of its channels among inputs d and outputs v."""

    kind: Multipliers
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


class Plant(NamedTuple):
    """A model: `B`, `D` for all inputs, those of `into` outside; `C`, `D` for all outputs, those of
    `out` outside.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    into: tuple[int, ...]
    out: tuple[int, ...]
    sampled: bool

    def exact(self) -> Plant:
        """Return the plant in rationals."""
        return self._replace(**{n: fractions(getattr(self, n)) for n in "ABCD"})


class Extended(NamedTuple):
    """dx/dt = A x + B w with the filters' states in x; w = (d, f) in the order of the model's
    inputs; rows `Z` on (x, w) of the filtered signals of each block, and `Y` of the outputs.
    """

    A: Array
    B: Array
    Z: tuple[Array, ...]
    Y: Array


def closing(C: Array, D: Array, N: Array) -> tuple[Array, Array]:
    """Return K, L of w = K x + L u where w = u + N (C x + D w); doubles.

    Raises `LinAlgError` where I - N D is singular.
    """
    L = np.linalg.inv(np.eye(len(N)) - N @ D)
    return L @ N @ C, L


def around_nominal(loop: Extended, plant: Plant, blocks: Sequence[Wired]) -> Extended:
    """Return the loop, in doubles, in the inputs w less what the nominal blocks make of the
    model's outputs: inequalities in (x, w) are those of the same x, and poles those of the nominal
    loop.
    """
    N = np.zeros((plant.B.shape[1], len(plant.C)))
    for kind, into, out in blocks:
        if len(into) == len(out):
            N[list(into), list(out)] = kind.nominal(float)
    own, L = closing(plant.C, plant.D, N)
    n, K = len(loop.A), np.zeros((len(N), len(loop.A)))
    K[:, : own.shape[1]] = own

    def turned(rows: Array) -> Array:
        return np.hstack([rows[:, :n] + rows[:, n:] @ K, rows[:, n:] @ L])

    motion = turned(np.hstack([loop.A, loop.B]))
    return Extended(motion[:, :n], motion[:, n:], tuple(map(turned, loop.Z)), turned(loop.Y))


def fractions(M: Any) -> Array:
    """Return doubles as rationals."""
    M = np.asarray(M, dtype=float)
    out = np.empty(M.shape, dtype=object)
    out.ravel()[:] = [Fraction(v) for v in M.ravel().tolist()]
    return out


def extended(plant: Plant, blocks: Sequence[Wired], number: Any) -> Extended:
    """Return the loop with filters; `number` is that of the plant's matrices, float or Fraction."""
    A, B, C, D = plant[:4]
    n, m = B.shape
    unit = np.zeros((m, n + m), dtype=A.dtype)
    unit[range(m), range(n, n + m)] = 1
    motion, rows = np.hstack([A, B]), np.hstack([C, D])
    parts = []
    for kind, inputs, outputs in blocks:
        j = list(outputs)
        slope = matmul(C[j], motion) if kind.moving else None
        base = kind.base(rows[j], unit[list(inputs)], slope, number)
        own = kind.filter(plant.sampled, number)
        parts.append([np.asarray(M, dtype=A.dtype) for M in own] + [base])
    sizes = [len(part[0]) for part in parts]
    ends = np.cumsum([n, *sizes])
    total = int(ends[-1])
    zero = np.zeros((total, total + m), dtype=A.dtype)
    zero[:n, :n], zero[:n, total:] = A, B
    Z = []
    wide = [*range(n), *range(total, total + m)]
    for (Af, Bf, Cf, Df, base), start, end in zip(parts, ends, ends[1:], strict=False):
        own = slice(int(start), int(end))
        zero[own, own] = Af
        zero[own, wide] += matmul(Bf, base)
        z = np.zeros((len(Cf), total + m), dtype=A.dtype)
        z[:, own] = Cf
        z[:, wide] += matmul(Df, base)
        Z.append(z)
    Y = np.zeros((len(plant.out), total + m), dtype=A.dtype)
    Y[:, wide] = rows[list(plant.out)]
    return Extended(zero[:, :total], zero[:, total:], tuple(Z), Y)
