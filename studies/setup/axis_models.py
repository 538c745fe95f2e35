"""Identification of an axis, and how well its models predict and show the rotor modes."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import symheli
from identification import LPVARX, RecursiveLeastSquares, fit, scores
from identification.judge import Scores, pole_distance
from identification.methods import InstrumentalVariables
from identification.model import LPVARXModel
from studies.setup.axes import Axis
from symheli import FlightRecord, Helicopter, LinearModel
from symheli.errors import DataWarning

HORIZON = 1.0
"""Seconds ahead at which predictions are judged."""

FROZEN_SPEEDS = (2.0, 7.0, 12.0)

RATES = {"pitch/flap": "q", "roll/flap": "p"}
"""The angular rate of each rotor mode."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Scores of an identified model, and the miss of the frozen rotor mode (percent of its
    magnitude) at each of `FROZEN_SPEEDS`.
    """

    scores: Scores
    mode_miss: Mapping[float, float]


def rotor_mode(model: LinearModel, name: str) -> complex:
    """The eigenvalue (rad/s) of the pitch/flap or roll/flap mode of the exact linear model: the one
    in which the rate of pitch or roll participates most.

    With a stabiliser bar it is an oscillation, of which this is the half with positive frequency.
    A rotor that flaps fast (no bar) follows, and the mode is the damping of that rate: real.
    """
    values, right = np.linalg.eig(model.A)
    rate = [str(s) for s in model.states].index(RATES[name])
    share = np.abs(right[rate] * np.linalg.pinv(right)[:, rate])  # its participation factors
    foremost = values[int(np.argmax(share))]
    return complex(foremost.real, abs(foremost.imag))


def mode_misses(heli: Helicopter, model: LPVARXModel, mode: str) -> dict[float, float]:
    """Distance of the identified model's nearest eigenvalue to the exact rotor mode, percent of its
    magnitude, at frozen airspeeds.
    """
    exact = {v: symheli.linearize(heli, symheli.trim(heli, v)) for v in FROZEN_SPEEDS}
    return {v: pole_distance(model.at(v), rotor_mode(exact[v], mode)) for v in FROZEN_SPEEDS}


def judged(heli: Helicopter, axis: Axis, model: LPVARXModel, test: FlightRecord) -> Judged:
    """Validate `model` on a record that is not in the fit."""
    return Judged(
        scores=scores(model, test, horizon=HORIZON), mode_miss=mode_misses(heli, model, axis.mode)
    )


def instruments(axis: Axis) -> tuple[str, ...]:
    """The excitation signals of the axis's inputs, as a record names them."""
    return tuple(f"e_{name}" for name in axis.inputs)


def identify(
    axis: Axis, training: FlightRecord, method: str = "rls", order: int = 3, degree: int = 2
) -> LPVARXModel:
    """Fit `axis` to a training flight; "iv" takes the excitation of its inputs as instruments.

    What is added to the inputs is weak along the slow modes: the report says so where it shows what
    instruments find.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "the instruments are weak", DataWarning)
        return fit(
            axis.structure(order, degree),
            training,
            InstrumentalVariables(instruments(axis)) if method == "iv" else method,
        )


def update_time(structure: LPVARX, flight: FlightRecord) -> float:
    """Processor time (s) of one recursive update of all coefficients along a flight, lags and basis
    included.
    """
    online = RecursiveLeastSquares(structure).online()
    rows = structure.prepared(flight).columns(
        (*structure.outputs, *structure.inputs, *structure.parameters)
    )
    online.run(rows, history=False)
    begin = time.thread_time()
    online.run(rows, history=False)
    return (time.thread_time() - begin) / len(rows)
