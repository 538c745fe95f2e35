"""The states that a design needs: those without which the central controllers of frozen models no
longer keep their level on the whole plant.

In the coordinates of `ScaledPlant` the state that the loop neither has to estimate nor to control
is last, as its LQG characteristic value says (Jonckheere and Silverman, IEEE Trans. Automatic
Control 28 (1983); for H-infinity Mustafa and Glover, ibid. 36 (1991)). Servos and delays add such
states to a helicopter.
"""

from __future__ import annotations

import numpy as np

from symheli.lpv.bases.function_space import tensor_grid
from symheli.values.arrays import Array
from synthesis.design.lpv.scaled_plant import ScaledPlant
from synthesis.design.lti.hinf import central_gains
from synthesis.design.plant.generalized import Generalized
from synthesis.numerics.linear.norm import below

FEW_STATES = 12
"""Number of states up to which all are kept: their design takes seconds."""
NEGLIGIBLE = 0.01
"""Fraction of the sum of the characteristic values that the states left out may have together."""
NEAREST, ABOVE = 1.005, 1.02
"""Ratios to the worst optimum of the frozen models: of a level that fewer states must reach, too,
and of the level at which their controllers are tried on the whole plant.
"""
LOSS = 2e-3
"""Fraction of that level by which the loop with the whole plant may exceed it."""
POINTS = {1: 5, 2: 3}
"""Values of each parameter at which that is tried (more parameters: 2)."""


def enough_states(scaled: ScaledPlant, worst: Array | None) -> int:
    """Return the number of states to design with, for a worst frozen optimum of 1 at p = `worst`;
    all of them where no fewer serve.
    """
    values, whole = scaled.values, len(scaled.left)
    if values is None or whole <= FEW_STATES:
        return whole
    share = np.cumsum(values[::-1])[::-1] / values.sum()  # of each state and those after it
    axes = [
        np.linspace(s.low, s.high, POINTS.get(len(scaled.parameters), 2)) for s in scaled.parameters
    ]
    p = tensor_grid(axes)
    p = p if worst is None else np.vstack([worst[None], p])
    for states in range(int(np.argmax(np.r_[share, 0.0] <= NEGLIGIBLE)), whole):
        if states > 0 and _serves(scaled, scaled.first(states), p):
            return states
    return whole


def _serves(scaled: ScaledPlant, fewer: ScaledPlant, p: Array) -> bool:
    """Whether the plant with `fewer` states has an optimum near that of the whole, and its central
    controllers keep the level there.
    """
    for q in p:
        try:
            whole, part = (
                Generalized(*(M[0] for M in each.at(q[None]))) for each in (scaled, fewer)
            )
            near = central_gains(part, NEAREST, scaled.dt)
            gains = central_gains(part, ABOVE, scaled.dt)
        except np.linalg.LinAlgError:
            return False
        if near is None or gains is None:
            return False
        A, B, C, D = whole.closed(*gains)
        if not below(A, B, C, D, ABOVE * (1 + LOSS), scaled.dt):
            return False
    return True
