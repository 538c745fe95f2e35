"""Configuration of the kernel for a structure, and the layout of its memory; the same for C and
NumPy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.design.determined import largest
from identification.recursive.forgetting import Forgetting, numbers
from identification.structure.lpvarx import LPVARX, EquationGroup
from symheli.errors import InputError
from symheli.lpv import Product
from symheli.lpv.bases import Basis
from symheli.values.arrays import Array

LANES = 8
"""Number of elements to which rows are aligned and by which sums advance."""

HEADER, GROUP_HEADER = LANES, LANES
COUNT, MILLIONS, FILLED = 0, 1, 2
WEIGHT, TURN, DETERMINED, STEPS, FACTOR, SINCE = 0, 1, 2, 3, 4, 5
MILLION = 2**20
KINDS = ("output", "input", "offset", "increment")


def padded(n: int) -> int:
    """Return the number rounded up to whole LANES."""
    return -(-n // LANES) * LANES


@dataclass(frozen=True)
class Triangle:
    """A unit upper triangle of `n` rows and columns and, from `padded(n)` on, `m` more.

    The rows of a block of LANES begin at its first diagonal.
    """

    n: int
    m: int

    @property
    def wide(self) -> int:
        """Rows and columns with the empty ones."""
        return padded(self.n) + padded(self.m)

    @property
    def used(self) -> Array:
        """Which rows and columns are not empty."""
        return np.r_[: self.n, padded(self.n) : padded(self.n) + self.m]

    @property
    def size(self) -> int:
        """Numbers it takes."""
        return self.blocks[-1].stop

    @cached_property
    def blocks(self) -> tuple[slice, ...]:
        """Start of each block of LANES rows lies, row after row."""
        ends = np.cumsum(
            [LANES * (self.wide - start) for start in range(0, self.wide, LANES)]
        ).tolist()
        return tuple(slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True))

    def full(self, packed: Array) -> Array:
        """The whole as a square matrix (n + m, n + m)."""
        out = np.zeros((self.wide, self.wide), packed.dtype)
        for start, block in zip(range(0, self.wide, LANES), self.blocks, strict=True):
            out[start : start + LANES, start:] = packed[block].reshape(LANES, -1)
        return out[self.used[:, None], self.used]


@dataclass(frozen=True)
class GroupLayout:
    """Places of the parts of a group of n regressors and m outputs lie, `state` and `work` numbers
    after the start of the whole.
    """

    group: EquationGroup
    n: int
    m: int
    state: int
    work: int

    @cached_property
    def triangle(self) -> Triangle:
        """Triangle of the regressors and the outputs."""
        return Triangle(self.n, self.m)

    @cached_property
    def in_state(self) -> dict[str, slice]:
        """Slices of the state by name."""
        tall, high = padded(self.n), padded(self.m)
        sizes = {
            "header": GROUP_HEADER,
            "triangle": self.triangle.size,
            "d": self.triangle.wide,
            "theta": self.m * tall,
            "peak": tall,
            "energy": tall,
            "fed": tall,
            "recent": high,
            "usual": high,
            "power": high,
            "drift": high,
        }
        return _slices(sizes, self.state)

    @cached_property
    def in_work(self) -> dict[str, slice]:
        """Slices of the scratch by name."""
        tall, high, wide = padded(self.n), padded(self.m), self.triangle.wide
        return _slices(
            {
                "phi": tall,
                "x": wide,
                "s": wide,
                "gain": tall,
                "solution": tall * high,
                "innovation": high,
            },
            self.work,
        )

    @property
    def end(self) -> tuple[int, int]:
        """Behind the group, in state and scratch."""
        return self.in_state["drift"].stop, self.in_work["innovation"].stop


@dataclass(frozen=True, eq=False)
class Factor:
    """Functions of one parameter: `knots` (pieces + 1,), `bernstein` (pieces, functions, degree +
    1), `slack` for rounding at the ends.
    """

    knots: Array
    bernstein: Array
    slack: float

    @classmethod
    def of(cls, basis: Basis, dtype: type[np.floating]) -> Factor:
        """Raises `InputError` where the functions are not piecewise polynomial; lower degrees are
        raised to the highest.
        """
        pieces = basis.pieces()
        degree = max(piece.bernstein.shape[1] for piece in pieces) - 1
        knots = np.array([pieces[0].low, *(piece.high for piece in pieces)], dtype)
        rounding = 4 * float(np.finfo(dtype).eps) * max(abs(basis.low), abs(basis.high))
        slack = max(1e-9 * (basis.high - basis.low), rounding)
        return cls(
            knots, np.array([_raised(piece.bernstein, degree) for piece in pieces], dtype), slack
        )

    @property
    def arguments(self) -> tuple:
        """Functions, degree, pieces, slack, knots, Bernstein coefficients."""
        pieces, functions, order = self.bernstein.shape
        return functions, order - 1, pieces, self.slack, self.knots, self.bernstein


@dataclass(frozen=True, eq=False)
class KernelConfiguration:
    """A structure, a way of forgetting and a precision, as arrays; see rls.h for their meaning."""

    structure: LPVARX
    forgetting: Forgetting
    dtype: type[np.floating]

    @cached_property
    def entries(self) -> Array:
        """(entries, 4): kind, channel, lag, lag of p."""
        return np.array(
            [(KINDS.index(e.kind), e.channel, e.lag, e.p_lag) for e in self.structure.entries],
            np.int32,
        )

    @cached_property
    def factors(self) -> tuple[Factor, ...]:
        """Factors of the basis, one a scheduling parameter; none where its functions are not
        piecewise polynomial.
        """
        basis = self.structure.basis
        factors = basis.factors if isinstance(basis, Product) else (basis,)
        try:
            return tuple(
                Factor.of(factor, self.dtype) for factor in factors if isinstance(factor, Basis)
            )
        except InputError:
            return ()

    @cached_property
    def index(self) -> Array:
        """(functions, factors): the function of each factor that makes up each of the basis."""
        basis, count = self.structure.basis, len(self.factors)
        rows = basis.indices if isinstance(basis, Product) else [(j,) for j in range(basis.size)]
        return np.array(rows, np.int32)[:, :count].copy()

    @cached_property
    def largest(self) -> Array:
        """(functions,) how large each becomes over the range of the basis."""
        return largest(self.structure.basis).astype(self.dtype)

    @property
    def width(self) -> int:
        """Numbers kept of a sample: y, u, p, f(p)."""
        return (
            self.structure.ny
            + self.structure.nu
            + len(self.structure.parameters)
            + self.structure.basis.size
        )

    @property
    def sample(self) -> int:
        """Numbers the kernel takes of a sample: y, u, p, and f(p) where it does not know the
        functions.
        """
        return self.width - (self.structure.basis.size if self.factors else 0)

    @property
    def past(self) -> slice:
        """Place of the past in the state, newest sample first."""
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
            layout = GroupLayout(
                group, len(group.entries) * arx.basis.size, len(group.outputs), state, work
            )
            yield layout
            state, work = layout.end

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers in the state, numbers of scratch."""
        return self.groups[-1].end

    @cached_property
    def arguments(self) -> tuple:
        """Arguments of `Kernel`, compiled or not."""
        arx = self.structure
        groups = tuple(
            (
                len(g.outputs),
                np.array(g.outputs, np.int32),
                len(g.entries),
                np.array(g.entries, np.int32),
            )
            for g in arx.groups
        )
        return (
            arx.ny,
            arx.nu,
            len(arx.parameters),
            arx.memory,
            len(self.entries),
            self.entries,
            groups,
            arx.basis.size,
            tuple(f.arguments for f in self.factors),
            sum((f.knots.size + f.bernstein.size for f in self.factors), self.largest.size),
            self.index,
            self.largest,
            numbers(self.forgetting),
        )


def _raised(coefficients: Array, degree: int) -> Array:
    while (d := coefficients.shape[1] - 1) < degree:
        share = np.arange(d + 2) / (d + 1)
        coefficients = np.pad(coefficients, ((0, 0), (1, 0))) * share + np.pad(
            coefficients, ((0, 0), (0, 1))
        ) * (1 - share)
    return np.ascontiguousarray(coefficients)


def _slices(sizes: dict[str, int], start: int) -> dict[str, slice]:
    out = {}
    for name, size in sizes.items():
        out[name] = slice(start, start + size)
        start += size
    return out
