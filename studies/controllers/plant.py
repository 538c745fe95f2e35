"""The plant that the controllers of the study are designed for, and the one they are certified on.

All signals are deviations from the trim of the commanded airspeed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import symheli
from studies.controllers.design_choices import PERIOD, SAMPLED_DEGREE, DesignChoices
from symheli import Helicopter, LinearFamily, LinearModel, LPVStateSpace
from symheli.flight import Servo
from symheli.values.signal import Signal, indices, signals
from synthesis import Plant
from synthesis.design.plant import parts

STUDY = DesignChoices()


ROUNDING = 1e-9
"""Fraction of a feedthrough by which its change over airspeed is rounding."""


def baseline(heli: Helicopter, choices: DesignChoices = STUDY) -> LPVStateSpace:
    """The helicopter over airspeed with its controls and gusts, interpolated element by element."""
    speeds = np.linspace(choices.airspeeds[0], choices.airspeeds[1], choices.points).tolist()
    inputs = dict.fromkeys((*choices.controls, *choices.disturbances))
    family = symheli.sweep(heli, speeds, inputs=tuple(inputs))
    return disturbed(of_family(family, choices), choices)


def of_family(family: LinearFamily, choices: DesignChoices) -> LPVStateSpace:
    """Interpolate linear models along airspeed, with the requested states of them."""
    kept = family.select(choices.states) if choices.states else family
    return kept.interpolate("polynomial", choices.degree, rate=choices.acceleration)


def disturbed(model: LPVStateSpace, choices: DesignChoices) -> LPVStateSpace:
    """Add an input for the disturbance of a control, where requested."""
    both = [name for name in choices.disturbances if name in choices.controls]
    if not both:
        return model
    own = [model.inputs[i] for i in indices(both, model.inputs, "input")]
    return replace(parts.disturbed(model, own), residuals=None)


def actuator(servo: Servo, name: str, late: float) -> LinearModel:
    """Command to blade pitch `late` seconds later and through the servo, as 1/(1 + a s + b s^2)
    that agrees with it to the second power of s.

    The loops cross well below the servos. A balanced truncation to two states has half the lag
    there.
    """
    w, z = servo.natural_frequency, servo.damping
    expansion = np.array([1.0, late, late**2 / 2]), np.array([1.0, 2 * z / w, 1 / w**2])
    inverse = np.convolve(*expansion)[:3]
    if servo.zero is not None and servo.pole is not None:
        lead = 1 / servo.zero
        lag = np.array([1.0, 1 / servo.pole - lead, -lead * (1 / servo.pole - lead)])
        inverse = np.convolve(inverse, lag)[:3]
    _, a, b = inverse
    return LinearModel(
        np.array([[0.0, 1.0], [-1 / b, -a / b]]),
        np.array([[0.0], [1 / b]]),
        np.array([[1.0, 0.0]]),
        np.zeros((1, 1)),
        (Signal(f"{name}_lag1", "rad"), Signal(f"{name}_lag2", "rad/s")),
        (Signal(f"{name}_command", "rad"),),
        (Signal(name, "rad"),),
    )


def unweighted(model: LPVStateSpace, choices: DesignChoices = STUDY) -> Plant:
    """Return the plant with gusts, controls, and the measured states and commands as
    performance; what follows a command has its reference.
    """
    plant = Plant(
        model,
        disturbances=signals([choices.disturbance(name) for name in choices.disturbances]),
        performance=signals((*choices.measurements, *choices.controls)),
        controls=signals(choices.controls),
        measurements=signals(choices.measurements),
    )
    return plant.with_reference(choices.references) if choices.references else plant


def weighted(plant: Plant, choices: DesignChoices = STUDY) -> Plant:
    """Return the plant with every signal in its size, and noise on the measurements."""
    sizes = {name: 1 / size for name, size in choices.sizes_of_performance.items()}
    noise = {choices.error(name): choices.noise[name] for name in choices.measurements}
    return plant.weighted({**choices.sizes_of_disturbances, **sizes}).with_noise(noise)


def design_plant(
    model: LPVStateSpace, held: float = PERIOD / 2, choices: DesignChoices = STUDY
) -> Plant:
    """Return the plant of the design: continuous, with actuators of low order behind the delay and
    the half sample that a command is `held` for, where the model does not have that already.
    """
    late, servos = choices.delay + held, choices.actuation.servos or {}
    actuators = {u: actuator(servos[u], u, late) for u in choices.controls if u in servos}
    bare = [u for u in choices.controls if u not in servos]
    columns = indices(bare, model.inputs, "input")
    for u, i in zip(bare, columns, strict=True):
        if np.abs(model.D[1:, :, i]).max(initial=0) > ROUNDING * np.abs(model.D[:, :, i]).max():
            # no feedthrough, which the continuous model of a sampled one has; half a sample late
            corner = 2 / choices.period
            actuators[u] = parts.first_order(-corner, corner, f"{u}_hold", u, None)
    behind = unweighted(model, choices).with_servo(actuators)
    return weighted(behind.with_delay(late, bare, order=1) if bare and late else behind, choices)


def flown_plant(model: LPVStateSpace, choices: DesignChoices = STUDY) -> Plant:
    """Return the plant of the certificate: the servos unchanged, the delay exact, sampled; a
    sampled model stays unchanged.
    """
    return weighted(behind_servos(model, choices), choices)


def behind_servos(model: LPVStateSpace, choices: DesignChoices = STUDY) -> Plant:
    """Return that plant without sizes and noise."""
    actuation = choices.actuation.select(choices.controls)
    return unweighted(model, choices).behind(actuation, SAMPLED_DEGREE)


def closed(plant: Plant, controller: object) -> LPVStateSpace:
    """Return the loop, from gusts and noise to performance."""
    loop = plant.close(controller)
    assert isinstance(loop, LPVStateSpace)  # noqa: S101
    return loop
