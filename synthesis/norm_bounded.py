"""A norm-bounded block around a model, and its supply rate in the S-procedure.

For d = Delta v, |Delta| <= bound, and any lambda >= 0 the supply lambda (bound^2 v'v - d'd) is not
negative: a dissipation inequality that holds with it added holds for every such Delta, constant or
moving. Source: Boyd, El Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and
Control Theory" (1994), sections 5.1 and 6.3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symheli.lpv import LPVStateSpace, UncertainStateSpace
from synthesis.polynomial import structure

Array = np.ndarray


class NormBounded(NamedTuple):
    """The first `inputs` inputs d and the last `outputs` outputs v of a model: d = Delta v,
    |Delta|_2 <= bound, in units of d per unit of v.
    """

    inputs: int
    outputs: int
    bound: float

    def fault(self, lpv: LPVStateSpace) -> str | None:
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
        if not isinstance(self.bound, float) or not 0 <= self.bound < math.inf:
            return f"the bound of the block must be a finite number >= 0, got {self.bound!r:.60}"
        return None

    @property
    def sentence(self) -> str:
        """Sentence on the Delta for which a proof holds."""
        return (
            f"for every Delta ({self.inputs} x {self.outputs}) with |Delta|_2 <= {self.bound!r},"
            " constant or moving in any way, d = Delta v"
        )


def open_block(unc: UncertainStateSpace, *, channels: bool) -> tuple[LPVStateSpace, NormBounded]:
    """Return the model with its block open, inputs (d, u) and outputs (y, v), u and y only with
    `channels`; and the block.
    """
    u, y = (unc.inputs, unc.outputs) if channels else ((), ())
    model = unc.model.select(
        inputs=(*unc.perturbation_inputs, *u), outputs=(*y, *unc.perturbation_outputs)
    )
    return model, NormBounded(*unc.shape, unc.bound)
