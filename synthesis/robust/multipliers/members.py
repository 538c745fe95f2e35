"""Lower bounds: gains of single members of a set of loops, linear and constant, over frequency.

Nothing is shared with the multipliers: a member closes the loop at each frequency.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import optimize

from symheli.values.arrays import Array
from synthesis.robust.multipliers.blocks import (
    Block,
    DelayBlock,
    OwnMultiplier,
    ParameterBlock,
    StaticBlock,
)
from synthesis.robust.multipliers.loop import Plant, closing
from synthesis.robust.structure import DynamicBlock

GRID = 300
"""Frequencies at which members are looked at first."""
VALUES, MOST = 9, 250
"""Values of each number of a member, and members that are looked at."""
DECADES = 2.0
SINGULAR = 1e14
"""Condition number of a loop from which on it counts as being on the limit of stability."""


class Member(NamedTuple):
    """Gain of a member, the number of each block (slope, delay in s, parameter; a phase in rad of
    dynamics; NaN of a block taken as zero), and the frequency, rad/s.
    """

    gain: float
    numbers: tuple[float, ...]
    omega: float


class Family(NamedTuple):
    """The members of a loop with these blocks, at channels `places` (inputs, outputs)."""

    plant: Plant
    blocks: Sequence[Block]
    places: Sequence[tuple[Sequence[int], Sequence[int]]]
    dt: float | None

    @property
    def ranges(self) -> list[tuple[float, float]]:
        """Ranges of the numbers of a member."""
        return [_range(block) for block in self.blocks]

    def delta(self, numbers: Sequence[float], omega: Array) -> Array:
        """Return the blocks (K, inputs, outputs) at frequencies (K,), rad/s."""
        out = np.zeros((len(omega), self.plant.B.shape[1], len(self.plant.C)), complex)
        for block, value, (into, of) in zip(self.blocks, numbers, self.places, strict=True):
            factor = None if math.isnan(value) else _factor(block, value, omega)
            if factor is not None and len(into) == len(of):
                for i, j in zip(into, of, strict=True):
                    out[:, i, j] = factor
        return out

    @property
    def nominal(self) -> Array:
        """The blocks (inputs, outputs) of the nominal member."""
        return self.delta([_nominal(b) for b in self.blocks], np.zeros(1))[0].real

    def closed(self, numbers: Sequence[float], omega: Array) -> Array:
        """Return the responses (K, inputs, f) of all inputs of the model and of its outputs (K,
        outputs, f) to f, stacked; by way of the nominal loop, as the model may have poles at these
        frequencies.
        """
        A, B, C, D = self.plant[:4]
        n, m = B.shape
        N = self.nominal
        K, L = closing(C, D, N)
        A, B, C, D = A + B @ K, B @ L, C + D @ K, D @ L
        s = np.exp(1j * omega * self.dt) if self.dt else 1j * omega
        G = C @ np.linalg.solve(s[:, None, None] * np.eye(n) - A, B + 0j) + D if n else D + 0j
        Delta = self.delta(numbers, omega) - N
        outside = np.zeros((m, len(self.plant.into)))
        outside[list(self.plant.into), range(len(self.plant.into))] = 1.0
        right = np.broadcast_to(outside + 0j, (len(omega), *outside.shape))
        left = np.eye(m) - Delta @ G
        singular = np.linalg.cond(left) > SINGULAR
        left[singular] = np.eye(m)
        w = np.where(singular[:, None, None], math.inf, np.linalg.solve(left, right))
        G = np.where(singular[:, None, None], 0.0, G)
        with np.errstate(invalid="ignore"):
            own = G @ w
            w = w + N @ own
        own[singular] = math.inf
        return np.concatenate([w, own], axis=1)

    def gains(self, numbers: Sequence[float], omega: Array) -> Array:
        """Return the largest singular values (K,) from f to y."""
        return self._largest(self.closed(numbers, omega))

    def _largest(self, own: Array) -> Array:
        """Return the largest singular values (K,) of the outputs' part; inf on the limit of
        stability.
        """
        rows = own[:, [self.plant.B.shape[1] + i for i in self.plant.out]]
        out = np.full(len(rows), math.inf)
        finite = np.flatnonzero(np.all(np.isfinite(rows), axis=(1, 2)))
        out[finite] = np.linalg.svd(rows[finite], compute_uv=False)[:, 0]
        return out

    def stable(self, numbers: Sequence[float]) -> bool:
        """Whether a member is stable, or has a delay or dynamics, for which it is not known."""
        if any(isinstance(b, DelayBlock | DynamicBlock) for b in self.blocks):
            return True
        return self._settles(self.delta(numbers, np.zeros(1))[0].real)

    def _settles(self, N: Array) -> bool:
        """Whether the loop with gains (inputs, outputs) in place of its blocks is stable."""
        A, B, C, D = self.plant[:4]
        poles = np.linalg.eigvals(A + B @ closing(C, D, N)[0])
        return bool(np.all(np.abs(poles) < 1 if self.dt else np.real(poles) < 0))

    def grid(self) -> Array:
        """Return frequencies, rad/s."""
        if self.dt:
            return np.r_[0.0, np.geomspace(1e-4, 1.0, GRID)] * np.pi / self.dt
        sizes = np.abs(np.linalg.eigvals(self.plant.A)) if len(self.plant.A) else np.ones(1)
        sizes = sizes[sizes > 0] if np.any(sizes) else np.ones(1)
        line = np.geomspace(sizes.min() / 10**DECADES, sizes.max() * 10**DECADES, GRID)
        return np.r_[0.0, line]

    def members(self) -> list[tuple[float, ...]]:
        """Return numbers of members over their ranges."""
        count = len(self.ranges)
        each = max(2, min(VALUES, int(MOST ** (1 / max(count, 1)))))
        lines = [np.linspace(a, b, each).tolist() if b > a else [a] for a, b in self.ranges]
        return list(itertools.islice(itertools.product(*lines), MOST))

    def worst(self) -> tuple[Member, Array]:
        """Return the member of the largest gain that was found, and the largest response of each
        input (m,) to f over all that were looked at.
        """
        omega, m = self.grid(), self.plant.B.shape[1]
        best, sizes = Member(-1.0, (), math.nan), np.zeros(m)
        if not self._settles(self.nominal):
            return Member(math.inf, tuple(map(_nominal, self.blocks)), math.nan), sizes
        for numbers in self.members():
            if not self.stable(numbers):
                return Member(math.inf, numbers, math.nan), sizes
            own = self.closed(numbers, omega)
            sizes = np.maximum(sizes, np.nan_to_num(np.abs(own[:, :m]).max(axis=(0, 2))))
            gains = self._largest(own)
            k = int(np.argmax(gains))
            if gains[k] > best.gain:
                best = Member(float(gains[k]), numbers, float(omega[k]))
        return self._refined(best), sizes

    def _refined(self, at: Member) -> Member:
        """Return the member and frequency that an ascent finds from here."""
        top = math.pi / self.dt if self.dt else math.inf
        ranges, step = self.ranges, 0.05

        def place(x: Array) -> tuple[tuple[float, ...], float]:
            own = tuple(
                float(np.clip(a + v * (b - a), a, b)) for v, (a, b) in zip(x, ranges, strict=False)
            )
            return own, float(min(at.omega * math.exp(x[-1]), top))

        def loss(x: Array) -> float:
            numbers, omega = place(x)
            if not self.stable(numbers):
                return 0.0
            return -float(self.gains(numbers, np.array([omega]))[0])

        begin = [
            (v - a) / (b - a) if b > a else 0.0
            for v, (a, b) in zip(at.numbers, ranges, strict=True)
        ]
        x0 = np.array([*begin, 0.0])
        simplex = np.vstack(
            [
                x0,
                *(
                    x0 + step * e * (1 if v < 0.5 else -1)
                    for v, e in zip(x0, np.eye(len(x0)), strict=True)
                ),
            ]
        )
        found = optimize.minimize(
            loss,
            x0,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "xatol": 1e-9, "fatol": 1e-12, "maxiter": 800},
        )
        numbers, omega = place(found.x)
        return max(at, Member(-float(found.fun), numbers, omega), key=lambda m: m.gain)


def _nominal(block: Block) -> float:
    """Return the number of the nominal member: the least slope, the middle of a parameter, else
    zero.
    """
    match block:
        case StaticBlock():
            return block.low
        case ParameterBlock():
            return (block.low + block.high) / 2
        case DelayBlock():
            return 0.0
    return math.nan


def _range(block: Block) -> tuple[float, float]:
    match block:
        case StaticBlock() | ParameterBlock():
            return block.low, block.high
        case DelayBlock():
            return 0.0, float(block.longest)
        case DynamicBlock():
            return -math.pi, math.pi
        case OwnMultiplier():
            return 0.0, 0.0


def _factor(block: Block, value: float, omega: Array) -> Array | None:
    """Return what multiplies v (K,); None of a block taken as zero."""
    match block:
        case StaticBlock() | ParameterBlock():
            return np.full(len(omega), value)
        case DelayBlock():
            late = np.exp(-1j * omega * value)
            if block.form == "delay":
                return late
            if block.form == "difference":
                return late - 1
            s = 1j * np.where(omega == 0, 1.0, omega)
            return np.where(omega == 0, -value, (late - 1) / s)
        case DynamicBlock():
            return (
                block.bound
                * np.exp(1j * value)
                * np.ones(len(omega))
                * (1.0 if len(block.inputs) == 1 == len(block.outputs) else 0.0)
            )
        case OwnMultiplier():
            return None
