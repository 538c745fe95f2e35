"""A lateral loop with a stability margin: one that a model identified from flights of minutes can
be judged by.

The attitude hold of `studies.loops.lateral` has b(P, C) = 0.004 in hover: no such model comes that
close. With sideways velocity, attitude and yaw rate fed back b is 0.33 in hover and 0.40 to 0.45
from 1 to 13 m/s.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studies.setup.axes import LATERAL
from symheli import LinearModel
from symheli.lpv import stability_margin

FEEDBACK = {("d_lat", "v"): -0.002, ("d_lat", "phi"): -0.03, ("d_ped", "r"): -0.04}
"""rad per m/s, rad per rad, rad per rad/s; the same at every airspeed."""

SIZES = {"d_lat": 0.01, "d_ped": 0.05, "v": 3.0, "p": 1.0, "r": 1.0, "phi": 0.3}
"""A change of this size (SI) counts as 1 in nu-gaps and in the margin."""


def margin(model: LinearModel, gains: Mapping[tuple[str, str], float] = FEEDBACK) -> float:
    """b(P, C) of the loop around a discrete model with the inputs and outputs of `LATERAL`."""
    plant = model.select(inputs=LATERAL.inputs, outputs=LATERAL.outputs)
    return stability_margin(
        plant,
        gains,
        input_scale=np.array([SIZES[u] for u in LATERAL.inputs]),
        output_scale=np.array([SIZES[y] for y in LATERAL.outputs]),
    )
