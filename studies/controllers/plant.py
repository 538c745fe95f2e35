"""The plant that the controllers of the study are designed for, and the one they are certified on.

All signals are deviations from the trim of the commanded airspeed.
"""

from __future__ import annotations

import numpy as np

import symheli
from symheli import Helicopter, LinearModel, LPVStateSpace
from symheli.flight import XCELL_SERVOS, Servo
from symheli.values.signal import Signal, signals
from synthesis import Plant

TOP, RATE = 13.0, 3.0
"""Of the airspeed, m/s, and of its change, m/s^2."""

PERIOD, DELAY = 0.02, 0.02
"""Of the controller's samples, and from a command to its servo, s."""

CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")
GUSTS = ("u_w", "v_w", "w_w")
MEASUREMENTS = ("u", "v", "w", "p", "q", "r", "phi", "theta")

SIZES = {
    **dict.fromkeys(("u", "v", "w"), 2.0),
    **dict.fromkeys(("p", "q"), 2.0),
    "r": 0.3,
    **dict.fromkeys(("phi", "theta"), 0.2),
    **dict.fromkeys(("d_lon", "d_lat", "d_col"), 0.009),
    "d_ped": 0.03,
}
"""A deviation of this size (m/s, rad/s, rad) counts as 1; of a control that of the command."""

GUST = 2.0
"""A gust of this size (m/s) counts as 1."""

NOISE = {
    **dict.fromkeys(("u", "v", "w"), 0.9),
    **dict.fromkeys(("p", "q", "r"), 0.09),
    **dict.fromkeys(("phi", "theta"), 0.03),
}
"""Noise of a measurement (m/s, rad/s, rad) that counts as 1: three times what is flown, or the
controllers become faster than the servos.
"""

POINTS = 27
DEGREE = 3
SAMPLED_DEGREE = 3
"""Airspeeds linearized; degree in airspeed of the model and of the sampled one."""


def baseline(heli: Helicopter) -> LPVStateSpace:
    """The helicopter over airspeed with its controls and gusts, element-wise cubic."""
    speeds = np.linspace(0.0, TOP, POINTS).tolist()
    family = symheli.sweep(heli, speeds, inputs=(*CONTROLS, *GUSTS))
    return family.interpolate("polynomial", DEGREE, rate=RATE)


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


def unweighted(model: LPVStateSpace) -> Plant:
    """With gusts, controls, and the measured states and commands as performance."""
    return Plant(
        model,
        disturbances=signals(GUSTS),
        performance=signals((*MEASUREMENTS, *CONTROLS)),
        controls=signals(CONTROLS),
        measurements=signals(MEASUREMENTS),
    )


def weighted(plant: Plant) -> Plant:
    """With every signal in its size, and noise on the measurements."""
    sizes = {name: 1 / size for name, size in SIZES.items()}
    return plant.weighted({**dict.fromkeys(GUSTS, GUST), **sizes}).with_noise(NOISE)


def design_plant(model: LPVStateSpace, held: float = PERIOD / 2) -> Plant:
    """What is designed for: continuous, with actuators of low order behind the delay and the half
    sample that a command is `held` for, where the model does not have that already.
    """
    actuators = {u: actuator(XCELL_SERVOS[u], u, DELAY + held) for u in CONTROLS}
    return weighted(unweighted(model).with_servo(actuators))


def flown_plant(model: LPVStateSpace) -> Plant:
    """What is certified: the servos as they are, the delay exact, sampled at 50 Hz."""
    servos = {u: XCELL_SERVOS[u] for u in CONTROLS}
    sampled = unweighted(model).with_servo(servos).sampled(PERIOD, degree=SAMPLED_DEGREE)
    return weighted(sampled.with_delay(DELAY))


def closed(plant: Plant, controller: LPVStateSpace) -> LPVStateSpace:
    """The loop, from gusts and noise to performance."""
    loop = plant.close(controller)
    assert isinstance(loop, LPVStateSpace)  # noqa: S101
    return loop
