"""Static output feedback around an LPV model whose outputs may depend on the scheduling and on the
inputs.
"""

from __future__ import annotations

import numpy as np

from symheli.lpv.lower_feedback import ControllerMatrices, Positions, closed
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array


def close(lpv: LPVStateSpace, K: Array) -> LPVStateSpace:
    """The model with u = K y + r; see `LPVStateSpace.feedback`. All inputs stay, as r, and all
    outputs; only the feedthrough from the inputs that are driven to the outputs that are fed back
    is a loop.
    """
    driven, fed = (np.flatnonzero(np.any(K, axis=axis)).tolist() for axis in (1, 0))
    at = Positions(list(range(len(lpv.inputs))), driven, list(range(len(lpv.outputs))), fed)
    return closed(lpv, at, ControllerMatrices.static(K[np.ix_(driven, fed)], lpv.box))
