"""The semidefinite programs of gains to the peak of the outputs: storage and multipliers in
doubles, for the exact check.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy import optimize

from symheli.lpv.bases import Polynomial
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.symmetric import basis as symmetric_basis
from synthesis.numerics.program.affine_program import AffineProgram, BernsteinCell, cells
from synthesis.numerics.program.cone_program import Solver
from synthesis.robust.multipliers.loop import Plant, Wired, extended
from synthesis.robust.multipliers.peak_proof import ENERGY, PeakProof

BACKED = 1e-6, 1e-5, 1e-4, 1e-3, 1e-2
"""Relative distances from the optimum at which the largest margin of the inequalities is sought."""
SPARE = 1e-9
"""Relative size by which a gain is above the shares that give it."""
DECAYS, TOLERANCE = 12, 1e-3
"""Decays of the first search, and the accuracy of their logarithm in the second."""


class PeakSearch:
    """The programs of one loop, with outputs in units of `scale` and inputs of `sizes`."""

    def __init__(
        self,
        plant: Plant,
        dt: float | None,
        blocks: Sequence[Wired],
        kind: str,
        solver: Solver,
        scale: float,
        sizes: Array,
    ) -> None:
        """Prepare the matrices of the unknowns: P, both sets of coefficients, a, b."""
        self.plant, self.dt, self.blocks, self.kind = plant, dt, tuple(blocks), kind
        self.solver, self.scale = solver, scale
        self.loop = extended(plant, blocks, float)
        n = len(self.loop.A)
        self.counts = [n * (n + 1) // 2, *(k.count for k, _, _ in blocks)]
        self.units = self._units(sizes)
        self.total = self.counts[0] + 2 * sum(self.counts[1:]) + 2

    def _units(self, sizes: Array) -> Array:
        """Return units of (x, w)."""
        A, B = self.loop.A, self.loop.B
        into = np.where(sizes > 0, sizes, 1.0)
        n = len(A)
        grid = np.geomspace(1e-3, np.pi, 60) if self.plant.sampled else np.geomspace(1e-3, 1e3, 90)
        s = np.exp(1j * grid) if self.plant.sampled else 1j * grid
        X = np.linalg.solve(s[:, None, None] * np.eye(n) - A, B * into + 0j)
        peak = np.abs(X).max(axis=(0, 2), initial=0.0)
        return np.concatenate([np.where(peak > 0, peak, 1.0), into])

    def _proof(self, x: Array, decay: float, gain: float) -> PeakProof:
        """Return the numbers of the point x as a proof."""
        n, scale = len(self.loop.A), self.scale**2
        P = np.tensordot(x[: self.counts[0]], symmetric_basis(n), axes=1) if n else np.zeros((0, 0))
        back = 1 / self.units[:n]
        P = scale * back[:, None] * P * back
        first, second, start = [], [], self.counts[0]
        for own in (first, second):
            for (kind, _, _), count in zip(self.blocks, self.counts[1:], strict=True):
                own.append(kind.near(scale * x[start : start + count]))
                start += count
        shares = max(float(scale * x[-2]), 0.0), max(float(scale * x[-1]), 0.0)
        own = tuple(first), tuple(second), self.kind, decay, shares, gain
        return PeakProof(self.plant, self.dt, self.blocks, 0.5 * (P + P.T), *own)

    def _sides(self, decay: float) -> list[Array]:
        """Return both inequalities (1 + unknowns, N, N): the known part first, in units."""
        out: list[list[Array]] = [[], []]
        for k in range(self.total + 1):
            x = np.zeros(self.total)
            if k:
                x[k - 1] = 1.0 / self.scale**2
            proof = self._raw(x, decay)
            for own, F in zip(out, proof, strict=True):
                kept = self.units if len(F) == len(self.units) else self._inside
                own.append(kept[:, None] * F * kept)
        known = [own[0] / self.scale**2 for own in out]
        return [
            np.array([a, *(F - self.scale**2 * a for F in own[1:])])
            for a, own in zip(known, out, strict=True)
        ]

    @property
    def _inside(self) -> Array:
        n, outside = len(self.loop.A), set(self.plant.into)
        kept = [i for i in range(len(self.units)) if i - n not in outside]
        return self.units[kept]

    def _raw(self, x: Array, decay: float) -> tuple[Array, Array]:
        """Return both sides at x, without what rounds coefficients to their class."""
        n, scale = len(self.loop.A), self.scale**2
        P = np.tensordot(x[: self.counts[0]], symmetric_basis(n), axes=1) if n else np.zeros((0, 0))
        back = 1 / self.units[:n]
        parts, start = [], self.counts[0]
        for count in self.counts[1:] * 2:
            parts.append(scale * x[start : start + count])
            start += count
        first, second = parts[: len(self.blocks)], parts[len(self.blocks) :]
        own = tuple(first), tuple(second), self.kind, decay, (scale * x[-2], scale * x[-1]), 0.0
        proof = PeakProof(self.plant, self.dt, self.blocks, scale * back[:, None] * P * back, *own)
        return proof.sides(self.loop, first, second, float)

    def _costs(self, decay: float) -> list[Array]:
        """Return rows of x that the gain squared is not below."""
        rows = np.zeros((2, self.total))
        if self.kind == ENERGY:
            rows[0, -2] = rows[1, -1] = 1.0
            return list(rows)
        rows[0, -2:] = 1 / decay, 1.0
        return [rows[0]]

    def solved(self, decay: float, level: float | None) -> tuple[float, Array] | None:
        """Return (gain, point), or of a given gain (margin, point); None without an answer."""
        program, count = AffineProgram(), self.total + 1
        program.variable(np.eye(count)[:, None], Polynomial(0, 0.0, 1.0))
        (cell,) = cells([(0.0, 1.0)], [0])
        for F in self._sides(decay):
            unit = np.sqrt(np.abs(F).max(axis=0).diagonal())
            unit[unit == 0] = 1.0
            rows = np.zeros((count + 1, 1, *F.shape[1:]))
            rows[:count, 0] = -F / unit[:, None] / unit
            if level is not None:
                rows[-1, 0] = -np.eye(len(unit))
            program.positive(cell, rows)
        for row in self._costs(decay):
            own = np.zeros((count + 1, 1, 1, 1))
            own[1:-1, 0, 0, 0] = -row
            own[-1 if level is None else 0] = 1.0 if level is None else (level / self.scale) ** 2
            program.positive(cell, own)
        self._admit(program, cell)
        for share in np.eye(self.total)[-2:]:
            self._require(program, cell, share[:, None, None])
        if level is not None:
            own = np.zeros((count + 1, 1, 1, 1))
            own[0], own[-1] = 1.0, -1.0
            program.positive(cell, own)
        cost = np.zeros(count)
        cost[-1] = 1.0 if level is None else -1.0
        found = program.minimise(cost, self.solver)
        if found.x is None or not np.all(np.isfinite(found.x)):
            return None
        last = float(found.x[-1])
        return (self.scale * math.sqrt(max(last, 0.0)) if level is None else last), found.x[:-1]

    def _admit(self, program: AffineProgram, cell: BernsteinCell) -> None:
        """Impose what makes both sets of multipliers those of their classes."""
        start, size = self.counts[0], sum(self.counts[1:])
        for (kind, _, _), count in zip(self.blocks, self.counts[1:], strict=True):
            first, second = np.eye(self.total)[:, start : start + count], None
            second = np.eye(self.total)[:, start + size : start + size + count]
            each = [first, second] if kind.pointwise else [first, second, first - second]
            for unit in each:
                for amount in np.array([kind.amounts(e) for e in unit]).T:
                    self._require(program, cell, amount[:, None, None])
                matrices = [kind.matrices(e) for e in unit]
                for q in range(len(matrices[0])):
                    self._require(program, cell, np.array([M[q] for M in matrices]))
            start += count

    def _require(self, program: AffineProgram, cell: BernsteinCell, F: Array) -> None:
        root = np.sqrt(np.abs(F).max(axis=0).diagonal())
        root[root == 0] = 1.0
        rows = np.zeros((self.total + 2, 1, *F.shape[1:]))
        rows[1:-1, 0] = F / root[:, None] / root
        program.positive(cell, rows)

    def _best_decay(self, known: float | None) -> tuple[float, float] | None:
        """Return (decay, gain) of the least gain."""
        if self.kind == ENERGY or known is not None:
            decay = 0.0 if self.kind == ENERGY else float(known or 0.0)
            found = self.solved(decay, None)
            return None if found is None else (decay, found[0])
        rates = np.abs(np.linalg.eigvals(self.loop.A)) if len(self.loop.A) else np.ones(1)
        top = 0.0 if self.plant.sampled else math.log(4 * max(float(rates.max()), 1e-6))

        def gain(x: float) -> float:
            found = self.solved(min(math.exp(x), 1.0 if self.plant.sampled else math.inf), None)
            return math.inf if found is None else found[0]

        line = np.linspace(top - 7.0, top - 1e-3, DECAYS)
        values = [gain(float(x)) for x in line]
        k = int(np.argmin(values))
        if not math.isfinite(values[k]):
            return None
        ends = float(line[max(k - 1, 0)]), float(line[min(k + 1, len(line) - 1)])
        own = {"xatol": TOLERANCE}
        found = optimize.minimize_scalar(gain, bounds=ends, method="bounded", options=own)
        x = float(found.x) if found.fun < values[k] else float(line[k])
        return math.exp(x), min(float(found.fun), values[k])

    def found(self, decay: float | None, proven: Callable[[PeakProof], bool]) -> PeakProof | None:
        """Return the proof of the least gain that is confirmed; None where none is."""
        best = self._best_decay(decay)
        if best is None or not math.isfinite(best[1]):
            return None
        for distance in BACKED:
            level = best[1] * (1 + distance)
            point = self.solved(best[0], level)
            if point is None or point[0] <= 0:
                continue
            squares = [float(row @ point[1]) * self.scale**2 for row in self._costs(best[0])]
            gain = math.sqrt(max(squares)) * (1 + SPARE)
            proof = self._proof(point[1], best[0], gain)
            if proven(proof):
                return proof
        return None
