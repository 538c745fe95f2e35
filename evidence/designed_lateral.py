"""A lateral controller designed for the X-Cell, and the plant that it flies on.

The design knows cubic fits and first-order servos; what flies is a table of 32-bit numbers at 50 Hz
on the exact linearizations, with the true servos, one sample of delay and the drift of the trim as
a disturbance.
"""

from __future__ import annotations

import numpy as np

import symheli
from studies.loops.exact_lateral import DEGREE, ExactLateral
from studies.loops.lateral import INPUTS
from studies.setup.axes import LATERAL
from symheli import Helicopter, LinearFamily, LinearModel, LPVStateSpace, Scheduling
from symheli.flight import XCELL_SERVOS
from symheli.lpv.bases import Patches
from symheli.lpv.tools import Matrices
from symheli.values.signal import Signal, signals
from synthesis import Controller, Plant, output_feedback

Array = np.ndarray

CONTROLS, MEASURED = LATERAL.inputs, LATERAL.outputs
GUST, DRIFT = "v_w", "drift_airspeed"
BACK_OFF = 1.3
"""Nearer to the least gamma the controller has poles that no sample of `DT` follows."""
DT = 0.02
ACCELERATION = 3.0
"""Largest |dV/dt|, m/s^2: the limit of the rate, and the size of the drift's input."""

WEIGHTS = {
    GUST: 2.0,
    DRIFT: ACCELERATION,
    "v": 1 / 2.0,
    "p": 1 / 2.0,
    "r": 1 / 0.3,
    "phi": 1 / 0.2,
    "d_lat": 1 / 0.01,
    "d_ped": 1 / 0.03,
}
"""A gust of 2 m/s; m/s, rad/s and rad that count as much as 1 of another."""
NOISE = {"v": 0.9, "p": 0.1, "r": 0.1, "phi": 0.03}
BANDWIDTH = 15.0
"""Of the servos that the design is told of, rad/s: with it the delay of the loop is made up for."""


def design_plant(heli: Helicopter, low: float = 0.0, high: float = 13.0) -> Plant:
    """Cubic element-wise fits in continuous time behind first-order servos."""
    return _weighted(_fitted(heli, low, high).with_servo({u: _first_order(u) for u in CONTROLS}))


def sampled_plant(heli: Helicopter, low: float = 0.0, high: float = 13.0) -> Plant:
    """The same fits behind the true servos every `DT` s, the commands one sample late: one
    polynomial, for many proofs.
    """
    servos = {u: XCELL_SERVOS[u] for u in CONTROLS}
    sampled = _fitted(heli, low, high).with_servo(servos).sampled(DT, degree=4)
    return _weighted(sampled.with_delay(DT))


def designed(heli: Helicopter, low: float = 0.0, high: float = 13.0) -> Controller:
    """Output feedback of seven states for |dV/dt| <= `ACCELERATION`."""
    return output_feedback(design_plant(heli, low, high), back_off=BACK_OFF)


def flying_plant(heli: Helicopter, low: float = 0.0, high: float = 13.0) -> Plant:
    """The exact linearizations behind the true servos every `DT` s, the commands one sample late.

    Polynomials between the corners of the model; `.residuals` of the model say what is missed in
    between.
    """
    exact = ExactLateral.of(heli, low, high)
    nodes, between = (_sampled(family, exact) for family in (exact.nodes, exact.between))
    fitted = Matrices(*(exact.basis.fit(nodes.airspeeds, getattr(nodes, M)) for M in "ABCD"))
    model = LPVStateSpace(
        exact.basis,
        *fitted,
        (Scheduling("airspeed", "m/s", low, high, ACCELERATION),),
        nodes.states,
        nodes.inputs,
        nodes.outputs,
        DT,
    )
    model = model.with_residuals(
        between.airspeeds, Matrices(*(getattr(between, M) for M in "ABCD"))
    )
    return _weighted(_plant(model).with_delay(DT))


def _fitted(heli: Helicopter, low: float, high: float) -> Plant:
    family = symheli.sweep(heli, np.linspace(low, high, 27), inputs=INPUTS)  # type: ignore[arg-type]
    lateral = family.select(LATERAL.states, INPUTS).interpolate("polynomial", 3, rate=ACCELERATION)
    return _plant(lateral.with_trim_drift())


def _first_order(control: str) -> LinearModel:
    """From the command to a control."""
    one = np.ones((1, 1))
    return LinearModel(
        *(-BANDWIDTH * one, BANDWIDTH * one, one, 0.0 * one),
        *(signals([f"{control}_lag"]), signals([f"{control}_command"]), signals([control])),
    )


def _plant(model: LPVStateSpace) -> Plant:
    return Plant(
        model,
        disturbances=signals([GUST, DRIFT]),
        performance=signals([*MEASURED, *CONTROLS]),
        controls=signals(CONTROLS),
        measurements=signals(MEASURED),
    )


def _weighted(plant: Plant) -> Plant:
    return plant.weighted(WEIGHTS).with_noise(NOISE)


def _sampled(family: LinearFamily, exact: ExactLateral) -> LinearFamily:
    """Each model with the drift -x0'(V) as an input, behind the servos, sampled."""
    slopes = _slopes(exact, family.airspeeds)
    servos = {u: XCELL_SERVOS[u].linear(u) for u in CONTROLS}
    models = [
        LinearModel(
            model.A,
            np.column_stack([model.B, -slope]),
            model.C,
            np.column_stack([model.D, np.zeros(len(model.D))]),
            model.states,
            (*model.inputs, Signal(DRIFT, "m/s^2")),
            model.outputs,
        )
        .driven_by(servos)
        .discretize(DT)
        for model, slope in zip(family.models, slopes, strict=True)
    ]
    return LinearFamily.from_models(family.airspeeds, models, family.kinks, family.parameter)


def _slopes(exact: ExactLateral, at: Array) -> Array:
    """x0'(V) (K, nx), of polynomials of twice the degree through the trims in between."""
    family = exact.between
    basis = Patches(2 * DEGREE, exact.basis.breaks)
    trims = family.known_trims("the drift of the trim")
    x = np.array([[point.x[s] for s in LATERAL.states] for point in trims])
    return basis(at, 1) @ basis.fit(family.airspeeds, x)
