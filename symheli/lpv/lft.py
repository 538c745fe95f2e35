"""Linear fractional transformations: a constant matrix closed by blocks of scheduling parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.arrays import Array, frozen
from symheli.lpv.bases import Polynomial
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.scheduling import Scheduling
from symheli.lpv.signal import Signal, signals

if TYPE_CHECKING:
    from symheli.lpv.lpv_state_space import LPVStateSpace


class Block(NamedTuple):
    """`size` copies of one parameter, normalised to delta = (p - middle)/radius in [-1, 1]."""

    scheduling: Scheduling
    size: int


@dataclass(frozen=True, eq=False)
class LFT:
    """M(delta) = M22 + M21 Delta (I - M11 Delta)^-1 M12 = [A B; C D], Delta = diag(delta_i I_ni), |delta_i| <= 1.

    The upper loop of a constant matrix with normalised scheduling parameters: `M11` (n, n), `M12` (n, nx + nu),
    `M21` (nx + ny, n), `M22` (nx + ny, nx + nu) with n = `order` = sum of the block sizes.
    """

    M11: Array
    M12: Array
    M21: Array
    M22: Array
    blocks: tuple[Block, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float | None = None

    def __post_init__(self) -> None:
        for group in ("states", "inputs", "outputs"):
            object.__setattr__(self, group, signals(getattr(self, group)))
        n = self.order
        rows, columns = len(self.states) + len(self.outputs), len(self.states) + len(self.inputs)
        for name, shape in (("M11", (n, n)), ("M12", (n, columns)), ("M21", (rows, n)), ("M22", (rows, columns))):
            object.__setattr__(self, name, frozen(getattr(self, name), name, shape))

    @property
    def order(self) -> int:
        """Total size of the parameter blocks."""
        return sum(block.size for block in self.blocks)

    @classmethod
    def from_polynomial(cls, lpv: LPVStateSpace) -> LFT:
        """M(delta) = M_0 + delta M_1 + ... + delta^d M_d by Horner's rule: order d (nx + nu), exact."""
        if not isinstance(lpv.basis, Polynomial):
            raise InputError("an LFT needs polynomial (or rational) dependence; interpolate with kind='polynomial' first")
        unit = Polynomial(lpv.basis.degree, -1.0, 1.0)
        same = lpv.basis.low == lpv.scheduling.low and lpv.basis.high == lpv.scheduling.high
        stacked = np.block([[lpv.A, lpv.B], [lpv.C, lpv.D]])
        if not same:
            inner = Polynomial(lpv.basis.degree, lpv.scheduling.low, lpv.scheduling.high)
            nodes = lpv.scheduling.middle + lpv.scheduling.radius * np.cos(np.pi * (np.arange(inner.size) + 0.5) / inner.size)
            stacked = inner.fit(nodes, np.tensordot(lpv.basis(nodes), stacked, axes=1))
        power = unit.to_monomial(stacked)
        d, columns = len(power) - 1, power.shape[2]
        # z_i = delta z_{i-1} with z_0 = the input: the blocks hold delta, delta^2, ... times the input
        M11 = np.kron(np.eye(d, k=-1), np.eye(columns))
        M12 = np.vstack([np.eye(columns), np.zeros(((d - 1) * columns, columns))]) if d else np.zeros((0, columns))
        M21 = np.hstack(list(power[1:])) if d else np.zeros((power.shape[1], 0))
        blocks = (Block(lpv.scheduling, d * columns),)
        return cls(M11, M12, M21, power[0], blocks, lpv.states, lpv.inputs, lpv.outputs, lpv.dt)

    def matrix(self, delta: object) -> Array:
        """[A B; C D] at the normalised parameters `delta`, one a block."""
        delta = np.atleast_1d(frozen(delta, "delta"))
        if delta.shape != (len(self.blocks),):
            raise InputError(f"expected {len(self.blocks)} normalised parameter(s), got shape {delta.shape}")
        D = np.repeat(delta, [block.size for block in self.blocks])
        return self.M22 + self.M21 @ (D[:, None] * np.linalg.solve(np.eye(self.order) - self.M11 * D, self.M12))

    def at(self, *p: float) -> LinearModel:
        """The model frozen at p (one value a block, physical units)."""
        if len(p) != len(self.blocks):
            raise InputError(
                f"expected {len(self.blocks)} parameter value(s) ({', '.join(b.scheduling.name for b in self.blocks)}), got {len(p)}"
            )
        delta = [
            (float(block.scheduling.check(value)) - block.scheduling.middle) / block.scheduling.radius
            for block, value in zip(self.blocks, p, strict=True)
        ]
        M, nx = self.matrix(delta), len(self.states)
        return LinearModel(M[:nx, :nx], M[:nx, nx:], M[nx:, :nx], M[nx:, nx:], self.states, self.inputs, self.outputs, dt=self.dt)

    def reduce(self, tolerance: float = 1e-12) -> LFT:
        """Minimal order for one parameter, exactly.

        M(delta) = M22 + sum_i delta^i M21 M11^(i-1) M12, so the order is the rank of the block Hankel matrix of
        its Markov parameters, and the singular vectors realize it (Ho-Kalman). Singular values below `tolerance`
        times the largest count as zero, as does dependence below `tolerance` times the entry itself.
        """
        if len(self.blocks) != 1:
            raise InputError("exact reduction is for one scheduling parameter; this LFT has " + str(len(self.blocks)))
        n = self.order
        rows, columns = self.M22.shape
        markov, power = [], self.M12
        while len(markov) < 2 * n + 1 and np.abs(power).max(initial=0) > 0:
            markov.append(self.M21 @ power)
            power = self.M11 @ power
        depth = len(markov) if np.abs(power).max(initial=0) == 0 else n
        markov += [np.zeros((rows, columns))] * (2 * depth - len(markov))
        if depth == 0:
            return replace(
                self,
                M11=np.zeros((0, 0)),
                M12=np.zeros((0, columns)),
                M21=np.zeros((rows, 0)),
                blocks=(Block(self.blocks[0].scheduling, 0),),
            )
        # what is below rounding of the constant part of an entry is not dependence on the parameter
        markov = [np.where(np.abs(M) > tolerance * np.abs(self.M22), M, 0.0) for M in markov]
        # states and channels of different size: balance rows and columns so that the rank is judged entry by entry
        size = np.abs(np.stack(markov)).max(axis=0)
        row_scale, column_scale = _equilibrate(size)
        scaled = [row_scale[:, None] * M * column_scale for M in markov]
        hankel = np.block([[scaled[i + j] for j in range(depth)] for i in range(depth)])
        shifted = np.block(
            [[scaled[i + j + 1] if i + j + 1 < len(scaled) else np.zeros((rows, columns)) for j in range(depth)] for i in range(depth)]
        )
        U, s, Vt = np.linalg.svd(hankel)
        r = int(np.sum(s > tolerance * s[0])) if s[0] > 0 else 0
        root = np.sqrt(s[:r])
        M11 = (U[:, :r].T @ shifted @ Vt[:r].T) / root[:, None] / root
        M12 = root[:, None] * Vt[:r, :columns] / column_scale
        M21 = U[:rows, :r] * root / row_scale[:, None]
        return replace(self, M11=M11, M12=M12, M21=M21, blocks=(Block(self.blocks[0].scheduling, r),))

    def star(self, other: LFT) -> LFT:
        """Redheffer star product in series: y = self(other(u)); the outputs of `other` feed the inputs of `self` by name order.

        States, and the parameter blocks of both, are kept side by side.
        """
        if len(self.inputs) != len(other.outputs) or self.dt != other.dt:
            raise InputError(
                f"series connection needs as many inputs ({len(self.inputs)}) as outputs of the other ({len(other.outputs)}) "
                "and one sample period"
            )
        n1, n2, x1, x2 = self.order, other.order, len(self.states), len(other.states)

        def split(lft: LFT, nx: int) -> tuple[Array, ...]:
            # rows: parameter loop, states, outputs; columns: parameter loop, states, inputs
            top, left = np.hstack([lft.M11, lft.M12]), np.hstack([lft.M21, lft.M22])
            whole, n = np.vstack([top, left]), lft.order + nx
            return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]

        A1, B1, C1, D1 = split(self, x1)
        A2, B2, C2, D2 = split(other, x2)
        A = np.block([[A1, B1 @ C2], [np.zeros((n2 + x2, n1 + x1)), A2]])
        whole = np.block([[A, np.vstack([B1 @ D2, B2])], [C1, D1 @ C2, D1 @ D2]])
        loop = [*range(n1), *range(n1 + x1, n1 + x1 + n2)]
        rest_rows = [i for i in range(whole.shape[0]) if i not in loop]
        rest_columns = [i for i in range(whole.shape[1]) if i not in loop]
        taken = set(self.states)
        states = (*self.states, *(Signal(s if s not in taken else f"{s}_2", s.unit) for s in other.states))
        return LFT(
            whole[np.ix_(loop, loop)], whole[np.ix_(loop, rest_columns)], whole[np.ix_(rest_rows, loop)],
            whole[np.ix_(rest_rows, rest_columns)], (*self.blocks, *other.blocks), states, other.inputs, self.outputs, self.dt,
        )  # fmt: skip


def _equilibrate(size: Array, sweeps: int = 5) -> tuple[Array, Array]:
    """Row and column factors that bring the largest entry of each to about one (zero rows and columns keep 1)."""
    row, column = np.ones(size.shape[0]), np.ones(size.shape[1])
    for _ in range(sweeps):
        scaled = row[:, None] * size * column
        peak = scaled.max(axis=1)
        row = np.where(peak > 0, row / np.sqrt(np.where(peak > 0, peak, 1)), row)
        scaled = row[:, None] * size * column
        peak = scaled.max(axis=0)
        column = np.where(peak > 0, column / np.sqrt(np.where(peak > 0, peak, 1)), column)
    return row, column
