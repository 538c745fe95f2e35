"""A controller sampled by Tustin's rule, with what its loop keeps of the promise at frozen p."""

from __future__ import annotations

import math
from dataclasses import replace

from symheli import UncertainStateSpace
from symheli.errors import SynthesisError
from synthesis.design.loops.controller import Controller
from synthesis.design.loops.reduction import frozen_gain
from synthesis.design.plant.sampling import tustin

KEPT = 1.1
"""Gain of the sampled loop at frozen p over the promised one up to which the promise stays."""
MAX_HALVINGS = 12
"""Number of times the period is halved in the search for one that keeps the promise."""


def sampled(controller: Controller, dt: float) -> Controller:
    """Return the controller sampled every `dt` s; see `Controller.discretize`."""
    made = replace(controller, model=tustin(controller.model, dt))
    if controller.plant.dt is None and isinstance(controller.plant.model, UncertainStateSpace):
        return made  # its sampled loop is not known
    if controller.plant.dt not in (None, dt):
        return made  # closing it says that the periods differ
    gain, promised = frozen_gain(made), controller.promised
    if not math.isfinite(gain):
        if not math.isfinite(frozen_gain(controller)):
            return made  # nor is it before
        raise SynthesisError(
            f"sampled every {dt:g} s the closed loop is not stable at every frozen p:"
            f" {_enough(controller, dt)}, or design for plant.sampled({dt:g})"
        )
    if math.isnan(promised) or gain <= KEPT * promised:
        return made
    note = (
        f"sampled every {dt:g} s the largest gain of the loop at frozen p is {gain:.4g}, where"
        f" {promised:.4g} was promised: {_enough(controller, dt)}, or design for"
        f" plant.sampled({dt:g})"
    )
    return replace(made, promised=math.nan, optimum=None, notes=(*made.notes, note))


def _enough(controller: Controller, dt: float) -> str:
    """Advice on a period at which the loop keeps its promise, tried by halving."""
    limit = KEPT * controller.promised if math.isfinite(controller.promised) else math.inf
    for k in range(1, MAX_HALVINGS + 1):
        shorter = dt / 2**k
        gain = frozen_gain(replace(controller, model=tustin(controller.model, shorter)))
        if math.isfinite(gain) and gain <= limit:
            return f"{shorter:.3g} s keeps it"
    return "no shorter period that was tried keeps it"
