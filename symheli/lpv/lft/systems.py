"""What may stand in an interconnection, as an LFT."""

from __future__ import annotations

from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.lft.model import LFT
from symheli.lpv.linear_model import LinearModel, is_control_system
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import frozen

System = Any
"""An LFT, a LinearModel, an LPVStateSpace of polynomial dependence or a system of python-control;
where signals go by order and not by name a number or a matrix too, a static gain. What has no
states goes with any sample period.
"""


def as_lft(system: System, *, by_name: bool = False) -> LFT:
    """The `System` as an LFT; raises `InputError` for anything else, for a bare gain `by_name`, and
    for dependence on a spline.
    """
    match system:
        case LFT():
            return system
        case LinearModel():
            return LFT.constant(system)
        case LPVStateSpace():
            return system.to_lft()
    if is_control_system(system):
        return LFT.constant(LinearModel.from_control(system))
    if not isinstance(system, int | float | np.number | np.ndarray | list):
        raise InputError(
            "expected an LFT, a LinearModel, an LPVStateSpace or a system of python-control to"
            f" connect, got {type(system).__name__}"
        )
    if by_name:
        raise InputError(
            "a bare gain has no names to connect it by: write it into sums={input: {signal: gain}},"
            " or name its signals with LinearModel.gain(matrix, inputs, outputs)"
        )
    gain = np.atleast_2d(frozen(system, "gain"))
    return LFT.constant(
        LinearModel.gain(
            gain,
            [f"u{i + 1}" for i in range(gain.shape[1])],
            [f"y{i + 1}" for i in range(gain.shape[0])],
        )
    )
