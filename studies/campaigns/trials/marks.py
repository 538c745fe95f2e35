"""The pass marks of the study from the flights of one seed."""

from __future__ import annotations

from functools import cache
from typing import Any

from studies.campaigns.trial import Trial
from studies.campaigns.trials.vehicle import autopilot, helicopter
from studies.setup import accelerating_baseline
from studies.setup.accelerating_baseline import ALONE, BOTH, MARKS
from studies.setup.axes import AXES, Axis
from studies.setup.axis_models import FROZEN_SPEEDS, identify, judged
from studies.setup.flights import NOISE_DB, NOISES, TransitionPlan

DECIBELS = dict(zip(NOISES, (None, NOISE_DB), strict=True))


def marks(*, vehicle: str = "xcell60", seed: int = 0) -> dict[str, float]:
    """Simulate, identify and validate without and with noise: fits in percent 1 s ahead, errors of
    the frozen rotor modes, and the fits of the baselines.
    """
    heli, row = helicopter(vehicle), {}
    for noise, decibels in DECIBELS.items():
        plan = TransitionPlan(seed, noise_db=decibels)
        training, test = (fly(heli, autopilot(vehicle)) for fly in (plan.training, plan.test))
        if decibels is None:
            fits = accelerating_baseline.fits(_baselines(vehicle), test)
            row |= {of_baseline(model, y): fit for (model, y), fit in fits.items()}
        for axis in AXES:
            result = judged(heli, axis, identify(axis, training, "ls"), test)
            row |= {ahead(axis, y, noise): result.scores.ahead[y] for y in axis.marks}
            if decibels is None:
                row |= {of_mode(axis, v): miss for v, miss in result.mode_miss.items()}
    return row


def ahead(axis: Axis, output: str, noise: str) -> str:
    """Return the name of a fit 1 s ahead."""
    return f"{output}, 1 s ahead, {noise} ({axis.name})"


def of_mode(axis: Axis, airspeed: float) -> str:
    """Return the name of the error of a frozen mode."""
    return f"{axis.mode} mode at {airspeed:g} m/s"


def of_baseline(model: str, output: str) -> str:
    """Return the name of a fit of a baseline 1 s ahead."""
    return f"{output}, {model}, 1 s ahead"


@cache
def _baselines(vehicle: str) -> Any:
    return accelerating_baseline.baselines(helicopter(vehicle))


TRIAL = Trial(
    marks,
    dict.fromkeys(
        [
            *(ahead(axis, y, noise) for noise in NOISES for axis in AXES for y in axis.marks),
            *(of_mode(axis, v) for axis in AXES for v in FROZEN_SPEEDS),
            *(of_baseline(model, y) for model in (BOTH, ALONE) for y in MARKS),
        ],
        "%",
    ),
)
