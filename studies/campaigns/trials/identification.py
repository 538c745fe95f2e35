"""The chain from a flight to a model: simulation, identification, validation on another flight."""

from __future__ import annotations

import numpy as np

from identification import LPVARX, Polynomial, fit, scores
from identification.judge.against_constant import HORIZONS
from studies.campaigns.trial import Trial
from studies.campaigns.trials.vehicle import autopilot, helicopter
from studies.setup.axes import ALL, CHOICES, SCHEDULING
from studies.setup.axis_models import mode_misses
from studies.setup.flights import ACCELERATIONS, TOP, TransitionPlan
from symheli.errors import UnknownNameError
from symheli.lpv import BSpline, PiecewiseLinear

BASES = {
    "polynomial": lambda degree: Polynomial(degree, 0.0, TOP),
    "linear": lambda degree: PiecewiseLinear(tuple(np.linspace(0.0, TOP, degree + 1))),
    "spline": lambda degree: BSpline(2, tuple(np.linspace(0.0, TOP, max(degree, 2)))),
}
"""Bases of degree + 1 functions of airspeed each."""
MODE_MISS = "rotor mode miss"


def identification(
    *,
    vehicle: str = "xcell60",
    axis: str = "longitudinal",
    order: int = 3,
    basis: str = "polynomial",
    degree: int = 2,
    method: str = "ls",
    period: float = 0.02,
    noise_db: float = float("inf"),
    windy: bool = False,
    ramps: int = len(ACCELERATIONS),
    acceleration: float = 3.2,
    seed: int = 0,
) -> dict[str, float]:
    """Fits in percent of each output on a transition at `acceleration` (m/s^2) that the model has
    not seen, and the worst miss of the frozen rotor mode, percent.

    `noise_db`: sensor noise so many dB below each signal (inf: none); `period`: of the samples, s;
    `windy`: in the breeze and turbulence of the study; `ramps`: of the training flight.
    """
    heli, pilot = helicopter(vehicle), autopilot(vehicle, period)
    noise = None if np.isinf(noise_db) else noise_db
    plan = TransitionPlan(seed, period, ramps, noise, windy)
    training = plan.training(heli, pilot)
    test = plan.test(heli, pilot, acceleration)
    model = fit(structure(axis, order, basis, degree), training, method)
    judged = scores(model, test).by_horizon
    row = {f"{y}, {h}": float(fits[y]) for h, fits in judged.items() for y in fits}
    return row | {MODE_MISS: max(mode_misses(heli, model, CHOICES[axis].mode).values())}


def structure(axis: str, order: int, basis: str, degree: int) -> LPVARX:
    """LPV-ARX of an axis, with the offset and its rate, in a basis of degree + 1 functions."""
    for kind, name, known in (("axis", axis, CHOICES), ("basis", basis, BASES)):
        if name not in known:
            raise UnknownNameError(kind, name, known)
    return LPVARX(
        CHOICES[axis].outputs,
        CHOICES[axis].inputs,
        SCHEDULING,
        na=order,
        nb=order,
        delay=1,
        basis=BASES[basis](degree),
        offset=True,
        offset_rate=True,
    )


TRIAL = Trial(
    identification,
    {f"{y}, {h}": "%" for y in ALL.outputs for h in HORIZONS} | {MODE_MISS: "%"},
)
