"""The lateral loop whose gain depends on how fast the airspeed may change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

import symheli
from studies.setup.axes import LATERAL
from symheli import Helicopter, LPVStateSpace

OUTPUTS = ("r", "phi")
CHANNELS = {"gust": ("v_w",), "inputs": LATERAL.inputs}
INPUTS = (*CHANNELS["inputs"], *CHANNELS["gust"])
HOLD = -0.02
"""Attitude hold d_lat = HOLD phi, rad per rad."""

ATTITUDE_HOLD: Mapping[tuple[str, str], float] = {("d_lat", "phi"): HOLD}


def lateral_loop(
    heli: Helicopter,
    low: float = 0.0,
    high: float = 13.0,
    channel: Literal["gust", "inputs"] = "gust",
    degree: int = 3,
    points: int = 27,
    gains: Mapping[tuple[str, str], float] = ATTITUDE_HOLD,
) -> LPVStateSpace:
    """v p r phi b1 from `low` to `high` m/s under `gains` (the attitude hold), element-wise
    polynomials of `degree` through `points` airspeeds.

    channel "gust": lateral gust v_w (m/s) -> r (rad/s), phi (rad); "inputs": disturbances added to
    d_lat, d_ped (rad) -> the same.
    """
    family = symheli.sweep(heli, np.linspace(low, high, points), inputs=INPUTS)  # type: ignore[arg-type]
    return close(
        family.select(LATERAL.states, INPUTS).interpolate("polynomial", degree),
        channel,
        gains,
    )


def close(
    lateral: LPVStateSpace,
    channel: Literal["gust", "inputs"],
    gains: Mapping[tuple[str, str], float] = ATTITUDE_HOLD,
) -> LPVStateSpace:
    """`gains` (the attitude hold) around any lateral model (continuous or sampled) that has the
    channel's inputs, the outputs r and phi, and what is fed back.
    """
    return lateral.feedback(gains).select(inputs=CHANNELS[channel], outputs=OUTPUTS)
