"""A norm-bounded block around a model, and its supply rate in the S-procedure.

For d = Delta v, |Delta| <= bound, and any lambda >= 0 the supply lambda (bound^2 v'v - d'd) is not
negative: a dissipation inequality that holds with it added holds for every such Delta, constant or
moving. Of Delta = diag(Delta_1, ...) each part has its own lambda; that of dynamics, whose supply
is not negative over time from rest only, does not depend on p. Source: Boyd, El Ghaoui, Feron and
Balakrishnan, "Linear Matrix Inequalities in System and Control Theory" (1994), sections 5.1, 6.3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from symheli.lpv.lpv_matrices import LPVMatrices
from symheli.values.arrays import Array
from synthesis.numerics.polynomial import structure


class NormBounded(NamedTuple):
    """The first `inputs` inputs d and the last `outputs` outputs v of a model: d = Delta v,
    |Delta|_2 <= bound, in units of d per unit of v. `parts`: of Delta = diag(Delta_1, ...), the
    (inputs, outputs, dynamic) of each; empty: one full matrix.
    """

    inputs: int
    outputs: int
    bound: float
    parts: tuple[tuple[int, int, bool], ...] = ()

    def fault(self, lpv: LPVMatrices) -> str | None:
        """Return why it is not a block of this model; None where it is."""
        found = structure.first(
            structure.whole(self.inputs, 1, "inputs of the block"),
            structure.whole(self.outputs, 1, "outputs of the block"),
        )
        if found:
            return found
        if self.inputs > len(lpv.inputs) or self.outputs > len(lpv.outputs):
            return (
                f"a block of {self.inputs} inputs and {self.outputs} outputs does not fit a model"
                f" with {len(lpv.inputs)} and {len(lpv.outputs)}"
            )
        for part in self.parts:
            if not (isinstance(part, tuple) and len(part) == 3 and isinstance(part[2], bool)):
                return f"a part of a block is (inputs, outputs, dynamic), got {part!r:.60}"
            if found := structure.first(*(structure.whole(n, 1, "a part") for n in part[:2])):
                return found
        sums = tuple(sum(part[i] for part in self.parts) for i in range(2))
        if self.parts and sums != (self.inputs, self.outputs):
            return f"the parts of the block make one of {sums}, not of {self[:2]}"
        if not isinstance(self.bound, float) or not 0 <= self.bound < math.inf:
            return f"the bound of the block must be a finite number >= 0, got {self.bound!r:.60}"
        return None

    @property
    def every_part(self) -> tuple[tuple[int, int, bool], ...]:
        """The blocks on the diagonal of Delta, of a full one that itself."""
        return self.parts or ((self.inputs, self.outputs, False),)

    def places(self, states: int, outputs: int) -> Iterator[tuple[Array, slice]]:
        """Yield the rows of d of each part among those of (x, d, u), and its v among the outputs
        of a model of this many states and outputs.
        """
        row, column = states, outputs - self.outputs
        for d, v, _ in self.every_part:
            yield row + np.arange(d), slice(column, column + v)
            row, column = row + d, column + v

    def multiplier_fault(self, values: Array) -> str | None:
        """Return why these are not Bernstein coefficients (count, parts) of the multipliers; None
        where they are.
        """
        if values.ndim != 2 or values.shape[1] != len(self.every_part):
            return f"expected a multiplier for each of {len(self.every_part)} parts"
        for (*_, dynamic), own in zip(self.every_part, values.T, strict=True):
            if dynamic and np.any(own != own[0]):
                return "the multiplier of dynamics does not depend on p"
        return None

    @property
    def sentence(self) -> str:
        """Sentence on the Delta for which a proof holds."""
        if self.parts:
            kinds = ("constant or moving in any way", "dynamics at rest at the start")
            each = ", ".join(f"Delta ({d} x {v}) {kinds[own]}" for d, v, own in self.parts)
            return (
                f"for every Delta = diag of {len(self.parts)} parts of gain <= {self.bound!r},"
                f" d = Delta v: {each}"
            )
        return (
            f"for every Delta ({self.inputs} x {self.outputs}) with |Delta|_2 <= {self.bound!r},"
            " constant or moving in any way, d = Delta v"
        )
