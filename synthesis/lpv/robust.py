"""Output feedback for every model of an uncertain plant."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from symheli.lpv import UncertainStateSpace

if TYPE_CHECKING:
    from synthesis.plant.plant import Plant

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
    by the small gain theorem. For each s gamma is corrected until it is what it was (`least` gives
    the least gain of a plant, `start` is that of the nominal one); the best s is taken. None where
    none settles.
    """
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    if model.bound == 0:
        return replace(plant, model=plant.nominal)
    if not math.isfinite(start):
        return None
    unit = _even(plant)
    best: tuple[float, float] | None = None
    for exponents in (SCALE_DECADES, REFINED_DECADES):
        centre = unit if best is None else best[1]
        for e in exponents:
            s = centre * 10**e
            gamma = _consistent(plant, s, start, least)
            if gamma < (math.inf if best is None else best[0]):
                best = gamma, s
        if best is None:
            return None
    gamma, s = best
    return opened(plant, s, gamma * model.bound / s)


def _consistent(plant: Plant, s: float, start: float, least: Callable[[Plant], float]) -> float:
    """Solve gamma = least(opened at gamma) by iteration from below; inf where it grows
    without end.
    """
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    gamma = start
    for _ in range(MAX_CORRECTIONS):
        found = least(opened(plant, s, gamma * model.bound / s))
        if not math.isfinite(found):
            return math.inf
        if found <= gamma * (1 + GAMMA_TOLERANCE):
            return max(found, gamma)
        gamma = found * (found / gamma) ** 0.5  # farther than the step: it converges slowly
    return math.inf


def opened(plant: Plant, out: float, into: float) -> Plant:
    """Return the plant with the block's channels among its own: v times `out`, d times `into`."""
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    d, v = model.perturbation_inputs, model.perturbation_outputs
    tiny = np.finfo(float).tiny ** 0.25
    sized = model.model.scaled(
        dict.fromkeys(d, max(into, tiny)), dict.fromkeys(v, 1.0 / max(out, tiny))
    )
    return replace(
        plant,
        model=sized,
        disturbances=(*plant.disturbances, *d),
        performance=(*plant.performance, *v),
    )


def _even(plant: Plant) -> float:
    """Return s that makes v as large as the performance, by their rows in the middle of the
    range.
    """
    model = plant.model
    assert isinstance(model, UncertainStateSpace)  # noqa: S101
    middle = model.model.at(*(s.middle for s in model.parameters))
    outputs = [str(y) for y in middle.outputs]
    rows = [
        np.concatenate([middle.C, middle.D], axis=1)[[outputs.index(str(y)) for y in group]]
        for group in (plant.performance, model.perturbation_outputs)
    ]
    z, v = (float(np.linalg.norm(M)) for M in rows)
    return z / v if z > 0 and v > 0 else 1.0
