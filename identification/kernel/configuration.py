"""What the kernel is told about a structure, and where in its memory everything lies; the same for C and NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.forgetting import Forgetting, numbers
from identification.structure import LPVARX, Group
from symheli.lpv import Basis
from symheli.lpv.arrays import Array

LANES = 8
"""Rows start, and sums run, in steps of so many numbers."""

HEADER, GROUP_HEADER = LANES, LANES
COUNT, MILLIONS, FILLED = 0, 1, 2
WEIGHT, TURN, DETERMINED, STEPS, FACTOR = 0, 1, 2, 3, 4
MILLION = 2**20
KINDS = ("output", "input", "offset", "increment")


def padded(n: int) -> int:
    """Rounded up to whole LANES."""
    return -(-n // LANES) * LANES


@dataclass(frozen=True)
class Triangle:
    """A unit upper triangle of `order` rows and `wide` columns; row i begins at the multiple of LANES at or before its diagonal."""

    order: int
    wide: int

    @property
    def size(self) -> int:
        """Numbers it takes."""
        return sum(self.wide - i // LANES * LANES for i in range(self.order))

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Where each row lies."""
        ends = np.cumsum([self.wide - i // LANES * LANES for i in range(self.order)]).tolist()
        return tuple(slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True))

    def full(self, packed: Array) -> Array:
        """As a square matrix (order, order)."""
        out = np.zeros((self.order, self.wide), packed.dtype)
        for i, row in enumerate(self.rows):
            out[i, i // LANES * LANES :] = packed[row]
        return out[:, : self.order]


@dataclass(frozen=True)
class GroupLayout:
    """Where the parts of a group of n regressors and m outputs lie, `state` and `work` numbers after the start of the whole."""

    group: Group
    n: int
    m: int
    state: int
    work: int

    @cached_property
    def triangle(self) -> Triangle:
        """Of order n + m."""
        return Triangle(self.n + self.m, padded(self.n + self.m))

    @cached_property
    def in_state(self) -> dict[str, slice]:
        """Slices of the state by name."""
        tall, high = padded(self.n), padded(self.m)
        sizes = {
            "header": GROUP_HEADER, "triangle": self.triangle.size, "d": self.triangle.wide, "theta": self.m * tall, "peak": tall,
            "energy": tall, "fed": tall, "recent": high, "usual": high,
        }  # fmt: skip
        return _slices(sizes, self.state)

    @cached_property
    def in_work(self) -> dict[str, slice]:
        """Slices of the scratch by name."""
        tall, wide = padded(self.n), self.triangle.wide
        return _slices({"phi": tall, "x": wide, "s": wide, "gain": tall, "innovation": padded(self.m)}, self.work)

    @property
    def end(self) -> tuple[int, int]:
        """Behind the group, in state and scratch."""
        return self.in_state["usual"].stop, self.in_work["innovation"].stop


@dataclass(frozen=True, eq=False)
class Configuration:
    """A structure, a way of forgetting and a precision, as arrays; see rls.h for their meaning."""

    structure: LPVARX
    forgetting: Forgetting
    dtype: type[np.floating]

    @cached_property
    def entries(self) -> Array:
        """(entries, 4): kind, channel, lag, lag of p."""
        return np.array([(KINDS.index(e.kind), e.channel, e.lag, e.p_lag) for e in self.structure.entries], np.int32)

    @cached_property
    def pieces(self) -> tuple[Array, Array]:
        """Knots (pieces + 1,) and Bernstein coefficients (pieces, functions, degree + 1) of the basis."""
        return bernstein(self.structure.basis, self.dtype)

    @property
    def slack(self) -> float:
        """How far p may leave the range by rounding, in its unit."""
        basis = self.structure.basis
        rounding = 4 * float(np.finfo(self.dtype).eps) * max(abs(basis.low), abs(basis.high))
        return max(1e-9 * (basis.high - basis.low), rounding)

    @property
    def width(self) -> int:
        """Numbers kept of a sample: y, u, p, f(p)."""
        return self.structure.ny + self.structure.nu + 1 + self.structure.basis.size

    @property
    def past(self) -> slice:
        """Where the past lies in the state, newest sample first."""
        return slice(HEADER, HEADER + (self.structure.memory + 1) * self.width)

    @cached_property
    def groups(self) -> tuple[GroupLayout, ...]:
        """One layout a group."""
        return tuple(self._groups())

    def _groups(self) -> Iterator[GroupLayout]:
        arx = self.structure
        state = HEADER + padded(self.past.stop - HEADER)
        work = padded(arx.n_regressors) + padded(arx.ny)
        for group in arx.groups:
            layout = GroupLayout(group, len(group.entries) * arx.basis.size, len(group.outputs), state, work)
            yield layout
            state, work = layout.end

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers in the state, numbers of scratch."""
        return self.groups[-1].end

    def columns(self, group: Group) -> Array:
        """Which of all regressors (n,) a group has."""
        size = self.structure.basis.size
        return (np.array(group.entries, int)[:, None] * size + np.arange(size)).reshape(-1)

    @cached_property
    def arguments(self) -> tuple:
        """What `Kernel` is made from, compiled or not."""
        arx = self.structure
        knots, coefficients = self.pieces
        groups = tuple((len(g.outputs), np.array(g.outputs, np.int32), len(g.entries), np.array(g.entries, np.int32)) for g in arx.groups)
        return (
            arx.ny, arx.nu, arx.memory, len(self.entries), self.entries, groups, arx.basis.size, coefficients.shape[2] - 1,
            coefficients.shape[0], knots, coefficients, self.slack, numbers(self.forgetting),
        )  # fmt: skip


def bernstein(basis: Basis, dtype: type[np.floating]) -> tuple[Array, Array]:
    """Knots (pieces + 1,) and coefficients (pieces, functions, degree + 1); lower degrees are raised to the highest."""
    pieces = basis.pieces()
    degree = max(piece.bernstein.shape[1] for piece in pieces) - 1
    knots = np.array([pieces[0].low, *(piece.high for piece in pieces)], dtype)
    return knots, np.array([_raised(piece.bernstein, degree) for piece in pieces], dtype)


def _raised(coefficients: Array, degree: int) -> Array:
    while (d := coefficients.shape[1] - 1) < degree:
        share = np.arange(d + 2) / (d + 1)
        coefficients = np.pad(coefficients, ((0, 0), (1, 0))) * share + np.pad(coefficients, ((0, 0), (0, 1))) * (1 - share)
    return np.ascontiguousarray(coefficients)


def _slices(sizes: dict[str, int], start: int) -> dict[str, slice]:
    out = {}
    for name, size in sizes.items():
        out[name] = slice(start, start + size)
        start += size
    return out
