"""The plant of a design from an identified model: with gusts, and continuous."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.model import KinematicModel
from studies.controllers.design_choices import GUSTS, MEASUREMENTS, RATE, TOP
from studies.controllers.in_airspeed import of_degree
from symheli import LPVStateSpace, Scheduling
from symheli.values.arrays import Array
from symheli.values.signal import Signal, indices
from synthesis.design.plant.sampling import resampled

VELOCITIES = MEASUREMENTS[:3]
ACCELERATION = "acceleration_command"

DEGREE = 4
"""Degree in airspeed of the continuous model."""


def identified_model(model: KinematicModel) -> LPVStateSpace:
    """Continuous over airspeed, with controls and gusts, at no commanded acceleration."""
    sampled = model.to_state_space(held=moving_with_commands(model))
    airspeed = Scheduling("airspeed", "m/s", 0.0, TOP, rate=RATE)
    return of_degree(continuous(with_gusts(sampled)), DEGREE).with_scheduling(airspeed)


def moving_with_commands(model: KinematicModel) -> dict[str, float]:
    """The commanded acceleration, held at none, where the model is scheduled by it."""
    return {str(s): 0.0 for s in model.parameters if s == ACCELERATION}


def with_gusts(model: LPVStateSpace) -> LPVStateSpace:
    """The sampled model with gusts as inputs: forces know the velocity through the air alone, so a
    gust does what the opposite velocity does, but for being one.

    That holds where the trim has no angular velocity, which would turn a velocity.
    """
    moving = indices(VELOCITIES, model.states, "state")
    gusts = -model.A[:, :, moving]
    gusts[:, moving, range(len(moving))] += model.basis.constant()[:, None]
    none = np.zeros((*model.D.shape[:2], len(moving)))
    return replace(
        model,
        B=np.concatenate([model.B, gusts], axis=2),
        D=np.concatenate([model.D, none], axis=2),
        inputs=(*model.inputs, *(Signal(name, "m/s") for name in GUSTS)),
        trim=None,
        residuals=None,
    )


def continuous(model: LPVStateSpace) -> LPVStateSpace:
    """The continuous model that Tustin's rule samples to this one at every frozen p; the half
    sample that the controls are held for stays in it.
    """
    dt = model.dt
    assert dt is not None  # noqa: S101

    def change(A: Array, B: Array, C: Array, D: Array) -> tuple[Array, ...]:
        inverse = np.linalg.inv(A + np.eye(A.shape[-1]))
        shifted = A - np.eye(A.shape[-1])
        return (
            2 / dt * inverse @ shifted,
            2 / dt * inverse @ B,
            2 * C @ inverse,
            D - C @ inverse @ B,
        )

    return resampled(model, change, None)
