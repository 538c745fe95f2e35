"""Comparison of baseline and identified models on equal terms: predictions of the test flights, and
models at frozen airspeed.
"""

from __future__ import annotations

from dataclasses import dataclass

import symheli
from identification import compare_frozen
from identification.judge import compare_baseline
from identification.judge.beside_baseline import BesideBaseline
from identification.judge.frozen_models import FrozenModels
from studies.setup.accelerating_baseline import along_the_command
from studies.setup.axes import ALL, AXES, LATERAL, LATERAL_WITH_COLLECTIVE, LONGITUDINAL, Axis
from studies.setup.axis_models import HORIZON, rotor_mode
from studies.setup.flights import NOISES, StudyRecords
from studies.transition.baseline import Baseline
from studies.transition.identified import Identification
from symheli import Helicopter

FAST = 3.0
"""Frequency (rad/s) above which the fast modes are compared on their own: the slow modes lie below
1 rad/s.
"""

SPEEDS = (0.5, 1.0, 2.0, 3.0, 4.0, 5.5, 7.0, 8.5, 10.0, 11.5, 12.5)
"""Airspeeds held, m/s."""

DRIFT_LEFT_OUT = "baseline, cubic, trim drift left out"
"""Shown for what the drift is worth; no rival."""

RESPONSES_AT = 7.0
CHANNELS = {LONGITUDINAL.name: ("d_lon", "q"), LATERAL.name: ("d_lat", "p")}
"""The response that is shown: input and output."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedAxis:
    """Predictions of one axis of one test flight by all models."""

    axis: Axis
    noise: str
    found: BesideBaseline


@dataclass(frozen=True, kw_only=True, eq=False)
class FrozenAxis:
    """Exact, interpolated and identified models of one axis with airspeed held."""

    axis: Axis
    found: FrozenModels


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparisons:
    """All comparisons."""

    predictions: tuple[ComparedAxis, ...]
    frozen: tuple[FrozenAxis, ...]


def compare(
    heli: Helicopter, baseline: Baseline, flights: StudyRecords, identification: Identification
) -> Comparisons:
    """Every axis, with and without noise; frozen without."""
    cubic, spline = baseline.lpv["polynomial 3"], baseline.lpv["spline"]
    baselines = {
        "baseline, cubic": along_the_command(cubic, heli),
        DRIFT_LEFT_OUT: along_the_command(cubic, heli, drift=False),
        "baseline, spline": along_the_command(spline, heli),
    }
    predictions = []
    for noise in NOISES:
        for axis in AXES:
            rivals = {
                name: identification.of(which, noise).model for name, which in _rivals(axis).items()
            }
            found = compare_baseline(
                rivals, baselines, flights.test[noise], axis.outputs, horizon=HORIZON
            )
            predictions.append(ComparedAxis(axis=axis, noise=noise, found=found))
    exact = {v: symheli.linearize(heli, symheli.trim(heli, v)) for v in SPEEDS}
    frozen = [
        FrozenAxis(
            axis=axis,
            found=compare_frozen(
                {"baseline": cubic, "identified": identification.of(axis, NOISES[0]).model},
                exact,
                inputs=axis.inputs,
                outputs=axis.outputs,
                mode={v: rotor_mode(model, axis.mode) for v, model in exact.items()},
                scales=axis.sizes,
                channel=CHANNELS[axis.name],
                responses_at=RESPONSES_AT,
                fast=FAST,
            ),
        )
        for axis in AXES
    ]
    return Comparisons(predictions=tuple(predictions), frozen=tuple(frozen))


def _rivals(axis: Axis) -> dict[str, Axis]:
    rivals = {"LPV-ARX, two inputs": axis}
    if axis is LATERAL:
        rivals["LPV-ARX, other inputs measured"] = LATERAL_WITH_COLLECTIVE
    return rivals | {"LPV-ARX, MIMO": ALL}
