"""Output feedback for every model of an uncertain plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from symheli import UncertainStateSpace
from symheli.values.arrays import Array
from symheli.values.signal import Signal

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant

SCALE_DECADES = (0.0, -1.0, 1.0, -2.0, 2.0)
"""Scales of the block's channels that are tried, as decimal exponents relative to the scale that
makes the block as large as the performance; then those around the best.
"""
REFINED_DECADES = (-0.5, 0.5, -0.25, 0.25)
MAX_CORRECTIONS = 8
"""Largest number of corrections of gamma for one scale."""
GAMMA_TOLERANCE = 2e-3
"""Relative change of gamma below which the corrections end."""


def robust_plant(plant: Plant, start: float, least: Callable[[Plant], float]) -> Plant | None:
    """The open plant whose gain gamma, once reached, is that of every model of the set.

    With d = Delta v, |Delta| <= beta, channels d = gamma beta/s d', v' = s v among disturbances and
    performance: a gain of gamma from (w, d') to (z, v') is one of gamma from w to z for all Delta,
    by the small gain theorem; of a Delta of several parts with a scale s for each. For each s gamma
    is corrected until it is what it was (`least` gives the least gain of a plant, `start` is that
    of the nominal one); the best s is taken, first one for all parts, then part by part. None where
    none settles.
    """
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    if model.bound == 0:
        return replace(plant, model=plant.nominal)
    if not math.isfinite(start):
        return None
    centre, best = _even(plant), math.inf
    every = np.ones(len(centre))
    own = np.eye(len(centre)) if len(centre) > 1 else ()
    for which, decades in (
        *((every, group) for group in (SCALE_DECADES, REFINED_DECADES)),
        *((each, (*REFINED_DECADES, *SCALE_DECADES[1:3])) for each in own),
    ):
        around = centre
        for e in decades:
            s = around * 10 ** (e * which)
            gamma = _consistent(plant, s, start, least)
            if gamma < best:
                best, centre = gamma, s
        if math.isinf(best):
            return None
    return opened(plant, centre, best)


def _consistent(plant: Plant, s: Array, start: float, least: Callable[[Plant], float]) -> float:
    """Solve gamma = least(opened at gamma) by iteration from below; inf where it grows
    without end.
    """
    gamma = start
    for _ in range(MAX_CORRECTIONS):
        found = least(opened(plant, s, gamma))
        if not math.isfinite(found):
            return math.inf
        if found <= gamma * (1 + GAMMA_TOLERANCE):
            return max(found, gamma)
        gamma = found * (found / gamma) ** 0.5  # farther than the step: it converges slowly
    return math.inf


def opened(plant: Plant, s: Array, gamma: float) -> Plant:
    """Return the plant with the block's channels among its own: of each part v times s, d times
    gamma bound/s.
    """
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    d, v = model.perturbation_inputs, model.perturbation_outputs
    tiny = np.finfo(float).tiny ** 0.25
    into, out = {}, {}
    for (rows, columns), scale in zip(model.places, s, strict=True):
        into |= dict.fromkeys(d[rows], max(gamma * model.bound / scale, tiny))
        out |= dict.fromkeys(v[columns], 1.0 / max(scale, tiny))
    return replace(
        plant,
        model=model.model.scaled(into, out),
        disturbances=(*plant.disturbances, *d),
        performance=(*plant.performance, *v),
    )


def _even(plant: Plant) -> Array:
    """Return s of each part that makes its v as large as the performance, by their rows in the
    middle of the range.
    """
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    middle = model.model.at(*(s.middle for s in model.parameters))
    outputs = [str(y) for y in middle.outputs]

    def size(group: Sequence[Signal]) -> float:
        rows = [outputs.index(str(y)) for y in group]
        return float(np.linalg.norm(np.concatenate([middle.C, middle.D], axis=1)[rows]))

    z = size(plant.performance)
    each = [size(model.perturbation_outputs[columns]) for _, columns in model.places]
    return np.array([z / v if z > 0 and v > 0 else 1.0 for v in each])
