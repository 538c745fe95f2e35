"""LPV beside LTI models of the same order from the flights of one seed."""

from __future__ import annotations

import math

from identification.judge import compare_constant
from identification.judge.against_constant import HORIZONS
from studies.campaigns.trial import Trial
from studies.campaigns.trials.vehicle import autopilot, helicopter
from studies.setup.axes import CHOICES, Axis
from studies.setup.flights import ACCELERATIONS, TransitionPlan

AXES = tuple(CHOICES.values())
MODELS = ("LPV", "LTI")


def pays(
    *,
    vehicle: str = "xcell60",
    noise_db: float = math.inf,
    windy: bool = False,
    ramps: int = len(ACCELERATIONS),
    seed: int = 0,
) -> dict[str, float]:
    """Return validation fits in percent of both models by axis, output and horizon; 1 where
    scheduling pays. `noise_db` inf: no noise.
    """
    heli, pilot, row = helicopter(vehicle), autopilot(vehicle), {}
    noise = None if math.isinf(noise_db) else noise_db
    plan = TransitionPlan(seed, ramps=ramps, noise_db=noise, windy=windy)
    training, test = plan.training(heli, pilot), plan.test(heli, pilot)
    for axis in AXES:
        found = compare_constant(axis.structure(), training, test, trim="moving")
        for model, one in zip(MODELS, found.models, strict=True):
            if one.held_out is not None:
                for h, fits in one.held_out.by_horizon.items():
                    row |= {fit_of(axis, y, h, model): float(fits[y]) for y in fits}
        row |= {paying(axis, y): float(found.pays(y)) for y in axis.outputs}
    return row


def fit_of(axis: Axis, output: str, horizon: str, model: str) -> str:
    """The name of a fit."""
    return f"{output}, {horizon}, {model} ({axis.name})"


def paying(axis: Axis, output: str) -> str:
    """The name of the verdict on an output."""
    return f"{output} pays ({axis.name})"


TRIAL = Trial(
    pays,
    {
        fit_of(axis, y, h, model): "%"
        for axis in AXES
        for y in axis.outputs
        for h in HORIZONS
        for model in MODELS
    }
    | {paying(axis, y): "1" for axis in AXES for y in axis.outputs},
)
