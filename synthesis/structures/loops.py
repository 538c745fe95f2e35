"""Loops of a structure over flight conditions, for descent on their largest gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from symheli.values.arrays import Array
from symheli.values.signal import indices
from synthesis.design.plant.generalized import Generalized, blocks
from synthesis.design.tuning.peaks import STEEP, LoopPeaks
from synthesis.structures.structure import TunableController

if TYPE_CHECKING:
    from synthesis.design.lpv.objectives import L2
    from synthesis.design.plant.plant import Plant


@dataclass(frozen=True, eq=False, kw_only=True)
class StructureLoops(LoopPeaks):
    """The plant at K conditions around the frame of a structure, whose gains close them.

    `shares` (K, n, g): of every free number in every gain; `low`, `high` (g,) hold where the shares
    are `bounded` (M, n, g); `units` (g,): of a gain, about its size.
    """

    shares: Array
    low: Array
    high: Array
    bounded: Array
    units: Array

    @classmethod
    def of(
        cls,
        plant: Plant,
        structure: TunableController,
        points: Array,
        specifications: Sequence[L2],
        units: Array,
        bounded: Array,
        decay: float = 0.0,
    ) -> StructureLoops:
        """At `points` (K, m) of the parameters; bounds hold at those and at `bounded` (M, m)."""
        channels = [
            (
                np.array(_own(one.disturbances, plant.disturbances, "disturbance")),
                np.array(_own(one.performance, plant.performance, "performance signal")),
                one.bound or 1.0,
            )
            for one in specifications
        ]
        return cls(
            open=_around_frame(plant, structure, points),
            channels=tuple(channels),
            dt=plant.dt,
            decay=decay,
            shares=shares(structure, points) * units,
            low=np.array([gain.low for gain in structure.gains]),
            high=np.array([gain.high for gain in structure.gains]),
            bounded=shares(structure, np.vstack([bounded, points])) * units,
            units=units,
        )

    def gains(self, x: Array) -> Array:
        """Gains (K, g) for free numbers x (n,)."""
        return np.einsum("n,kng->kg", x, self.shares)

    def matrix(self, x: Array) -> Array:
        """Diagonal matrices (K, g, g) of the gains."""
        return self.gains(x)[:, :, None] * np.eye(len(self.units))

    def pulled(self, condition: int, left: Array, right: Array) -> Array:
        """See `LoopPeaks.pulled`."""
        return self.shares[condition] @ np.real(left * right)

    def _exceeded(self, x: Array) -> tuple[Array, Array]:
        """By how much bounds are exceeded (M, g), in units; and of which sign."""
        gains = np.einsum("n,mng->mg", x, self.bounded)
        over, under = gains - self.high, self.low - gains
        return np.maximum(np.maximum(over, under), 0.0) / self.units, np.where(over > under, 1, -1)

    def beyond(self, x: Array) -> tuple[float, Array]:
        """Penalty of the bound that is exceeded most, and its slope."""
        if not np.any(np.isfinite(self.low) | np.isfinite(self.high)):
            return 0.0, np.zeros(len(x))
        beyond, sign = self._exceeded(x)
        m, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[m, j] <= 0:
            return 0.0, np.zeros(len(x))
        slope = STEEP * sign[m, j] * self.bounded[m, :, j] / self.units[j]
        return STEEP * float(beyond[m, j]), slope

    def within(self, x: Array, inside: Array) -> Array:
        """Return numbers whose gains keep every bound: as much of constant gains `inside` (n,)
        added as that takes, gain by gain.
        """
        x = x.copy()
        gains = np.einsum("n,mng->mg", x, self.bounded)
        centre = np.einsum("n,mng->mg", inside, self.bounded)
        target = np.clip(gains, self.low, self.high)
        far = np.abs(gains - centre)
        share = np.where(far > 0, np.abs(gains - target) / np.maximum(far, 1e-300), 0.0)
        for j in range(gains.shape[1]):
            own = np.any(self.bounded[:, :, j] != 0, axis=0)
            t = min(float(share[:, j].max()), 1.0)
            x[own] += t * (inside[own] - x[own])
        return x


def _own(given: Sequence[str] | None, known: Sequence[str], kind: str) -> list[int]:
    return list(range(len(known))) if given is None else indices(given, known, kind)


def _around_frame(plant: Plant, structure: TunableController, points: Array) -> Generalized:
    """Return the plant under the frame: from (disturbances, gain outputs) and gain outputs to
    (performance, gain inputs) and gain inputs, at points (K, m).
    """
    one = points[:, 0] if points.shape[1] == 1 else points
    P = plant.matrices(one)
    u = indices(structure.controls, plant.controls, "control")
    y = indices(structure.measurements, plant.measurements, "measurement")
    P = P._replace(
        B2=P.B2[..., u], D12=P.D12[..., u], C2=P.C2[..., y, :], D21=P.D21[..., y, :],
        D22=P.D22[..., y, :][..., u],
    )  # fmt: skip
    names = [gain.name for gain in structure.gains]
    frame = structure.frame
    rows = indices((*structure.controls, *names), frame.outputs, "output")
    columns = indices((*structure.measurements, *names), frame.inputs, "input")
    g, count = len(names), len(points)
    nw, nz = P.B1.shape[-1], P.C1.shape[-2]
    eye = np.eye(g)

    def wide(M: Array) -> Array:
        return blocks([[M, np.zeros((M.shape[-2], g))]])

    def tall(M: Array) -> Array:
        return blocks([[M], [np.zeros((g, M.shape[-1]))]])

    def corner(M: Array, block: Array) -> Array:
        ny, nu = M.shape[-2:]
        return blocks([[M, np.zeros((ny, g))], [np.zeros((g, nu)), block]])

    passing = Generalized(
        P.A, wide(P.B1), wide(P.B2), tall(P.C1), tall(P.C2),
        corner(P.D11, 0 * eye), corner(P.D12, eye), corner(P.D21, eye), corner(P.D22, 0 * eye),
    )  # fmt: skip
    stacked = [
        np.broadcast_to(M, (count, *M.shape))
        for M in (
            frame.A,
            frame.B[:, columns],
            frame.C[rows],
            frame.D[np.ix_(rows, columns)],
        )
    ]
    A, B, C, D = passing.closed(*stacked)
    B2, C2 = B[..., nw:], C[..., nz:, :]
    through, into = D[..., nz:, :], D[..., nw:]
    return Generalized(
        A, B, B2, C, C2, D, into, through, D[..., nz:, :][..., nw:],
    )  # fmt: skip


def shares(structure: TunableController, points: Array) -> Array:
    """Share (K, n, g) of every free number in every gain at points (K, m)."""
    count, g = len(points), len(structure.gains)
    out = np.zeros((count, structure.numbers, g))
    values = None
    if structure.basis is not None:
        values = structure.basis(points[:, 0] if points.shape[1] == 1 else points)
    at = 0
    for j, gain in enumerate(structure.gains):
        size = structure.numbers_of(gain)
        own = values if values is not None and gain.scheduled else np.ones((count, 1))
        out[:, at : at + size, j] = own
        at += size
    return out
