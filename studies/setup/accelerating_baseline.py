"""The baseline over airspeed and acceleration, beside the one over airspeed alone."""

from __future__ import annotations

import numpy as np

import symheli
from identification.judge import BaselineModel, compare_baseline
from studies.setup.axes import SCHEDULING
from studies.setup.axis_models import HORIZON
from studies.setup.flights import TOP
from symheli import FlightRecord, Helicopter, LPVStateSpace

ACCELERATIONS = (-4.0, -2.0, 0.0, 2.0, 4.0)
"""m/s^2, of the quasi-steady trims: the ramps of the study keep within them."""

POINTS = 27
"""Airspeeds from hover to `TOP`."""

ALONE, BOTH = "baseline over airspeed", "baseline over airspeed and acceleration"

MARKS = {"v": 80.0, "r": 85.0, "phi": 85.0, "w": 95.0}
"""Fit in percent, 1 s ahead, of the second: what the trim of an accelerated flight changes most."""

SCATTER = 10.0
"""Points by which a single flight may miss its mark; the median over the flights may not."""


def baselines(heli: Helicopter) -> dict[str, BaselineModel]:
    """Splines through exact linearizations, scheduled on the commanded airspeed and its
    derivative.
    """
    airspeeds = np.linspace(0.0, TOP, POINTS).tolist()
    alone = symheli.sweep(heli, airspeeds)
    both = symheli.steady.sweep_grid(heli, airspeeds, acceleration=ACCELERATIONS)
    return {
        ALONE: along_the_command(alone.interpolate("spline"), heli),
        BOTH: along_the_command(both.interpolate("spline"), heli),
    }


def fits(models: dict[str, BaselineModel], test: FlightRecord) -> dict[tuple[str, str], float]:
    """{(model, output): percent}, 1 s ahead on a flight."""
    found = compare_baseline({}, models, test, tuple(MARKS), horizon=HORIZON)
    return {(p.name, y): p.scores.ahead[y] for p in found.predictions for y in MARKS}


def along_the_command(lpv: LPVStateSpace, heli: Helicopter, *, drift: bool = True) -> BaselineModel:
    """A baseline driven by the helicopter's inputs, scheduled on the commanded airspeed as the
    identified models are.
    """
    inputs = tuple(map(str, heli.inputs))
    return BaselineModel(model=lpv, scheduling=SCHEDULING, inputs=inputs, drift=drift)
