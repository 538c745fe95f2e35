"""Open the block of an uncertain model: the model without it, and the block."""

from __future__ import annotations

from symheli import LPVStateSpace, UncertainStateSpace
from synthesis.certify.statement.norm_bounded import NormBounded


def open_block(unc: UncertainStateSpace, *, channels: bool) -> tuple[LPVStateSpace, NormBounded]:
    """Return the model with its block open, inputs (d, u) and outputs (y, v), u and y only with
    `channels`; and the block.
    """
    u, y = (unc.inputs, unc.outputs) if channels else ((), ())
    model = unc.model.select(
        inputs=(*unc.perturbation_inputs, *u), outputs=(*y, *unc.perturbation_outputs)
    )
    return model, NormBounded(*unc.shape, unc.bound, tuple((d, v, own) for d, v, own in unc.parts))
