"""The longitudinal loop whose gain hardly depends on how fast the airspeed may change."""

from __future__ import annotations

import numpy as np

import symheli
from studies.loops.lateral import HOLD
from studies.setup.axes import LONGITUDINAL
from symheli import Helicopter, LPVStateSpace

GUSTS = ("u_w", "w_w")
OUTPUTS = ("q", "theta")


def longitudinal_loop(
    heli: Helicopter, low: float = 0.0, high: float = 13.0, degree: int = 3, points: int = 27
) -> LPVStateSpace:
    """u w q theta a1 under attitude hold d_lon = HOLD theta: gusts u_w, w_w (m/s) -> q (rad/s),
    theta (rad).
    """
    inputs = ("d_lon", *GUSTS)
    family = symheli.sweep(heli, np.linspace(low, high, points), inputs=inputs)  # type: ignore[arg-type]
    longitudinal = family.select(LONGITUDINAL.states, inputs).interpolate("polynomial", degree)
    return longitudinal.feedback({("d_lon", "theta"): HOLD}).select(inputs=GUSTS, outputs=OUTPUTS)
