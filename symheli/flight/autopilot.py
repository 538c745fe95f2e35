"""A gain-scheduled LQR that keeps a flight near its commanded transition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.flight.controller import ScheduledController
from symheli.flight.servo import Servo
from symheli.helicopter import Helicopter
from symheli.lpv.actuation import Actuation
from symheli.lpv.bases.interpolating import PiecewiseLinear
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.riccati import regulator
from symheli.lpv.scheduling import Scheduling
from symheli.steady.airspeed_sweep import design_family
from symheli.values.arrays import frozen
from symheli.values.kinematics import INPUTS
from symheli.values.numbers import positive, whole
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized

UNMEASURED = ("a1", "b1")
SCALE = {
    "u": 1.5,
    "v": 1.5,
    "w": 1.0,
    "p": 1.0,
    "q": 1.0,
    "r": 0.7,
    "phi": 0.15,
    "theta": 0.15,
    "Om": 5.0,
    "om_i": 3.0,
}
"""Deviation of each state (SI) that counts as much as 0.01 rad of an input in the LQR weights."""
INPUT_SCALE = 0.01
SIZES = {**SCALE, **dict.fromkeys(INPUTS, INPUT_SCALE)}
"""Deviation of each state and input (SI) that counts as 1 in the LQR weights."""


@dataclass(frozen=True, eq=False)
class Autopilot:
    """An autopilot feeds back the measured states, u = u0 - K(V)(x - x0), with K straight between
    the airspeeds V of a table.

    Parameters
    ----------
    airspeeds : array (K,)
        Increasing, m/s; K >= 2.
    gains : array (K, 4, nx)
        rad per unit of the state, rows d_lon d_lat d_col d_ped.
    states : sequence of str
        Those measured.
    dt : float
        Sample period, s.
    radius : float, optional
        Largest closed-loop eigenvalue magnitude (one sample of delay included) over the design
        points, < 1, where it is known.

    Raises
    ------
    InputError
        Shapes that do not fit, airspeeds that do not increase, states that no sensor measures.

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.TableController : a controller to fly and to write in C
    synthesis.lqr : state feedback by Riccati equations

    Examples
    --------
    >>> autopilot = symheli.flight.gain_scheduled_lqr(heli, 0.0, 8.0, dt=0.02, points=5)
    >>> autopilot.gains.shape, autopilot.radius < 1
    ((5, 4, 8), True)
    """

    airspeeds: np.ndarray
    gains: np.ndarray
    states: tuple[Signal, ...]
    dt: float
    radius: float | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", signals(self.states))
        object.__setattr__(self, "airspeeds", frozen(self.airspeeds, "airspeeds", (None,)))
        shape = (len(self.airspeeds), len(INPUTS), len(self.states))
        object.__setattr__(self, "gains", frozen(self.gains, "gains", shape))

    def gain(self, airspeed: float) -> np.ndarray:
        """K (4, nx), linearly interpolated over airspeed."""
        return -self.scheduled_controller.model.matrices(
            np.clip(airspeed, self.airspeeds[0], self.airspeeds[-1])
        ).D

    @cached_property
    def scheduled_controller(self) -> ScheduledController:
        """The same gains as a controller scheduled by the commanded airspeed."""
        K = self.gains
        low, high = float(self.airspeeds[0]), float(self.airspeeds[-1])
        return ScheduledController(
            LPVStateSpace(
                PiecewiseLinear(tuple(self.airspeeds.tolist())),
                np.zeros((len(K), 0, 0)),
                np.zeros((len(K), 0, len(self.states))),
                np.zeros((len(K), len(INPUTS), 0)),
                -K,
                (Scheduling("airspeed", "m/s", low, high),),
                (),
                self.states,
                INPUTS,
                self.dt,
            )
        )


INPUT_SCALE_FACTORS = (1.0, 0.5, 0.25, 0.125)
"""Factors on the sizes of the inputs, in turn until the loop with servos and delay is stable."""


def gain_scheduled_lqr(
    heli: Helicopter,
    low: float,
    high: float,
    dt: float,
    points: int = 14,
    servos: Mapping[str, Servo] | Actuation | None = None,
    sizes: Mapping[str, float] | None = None,
) -> Autopilot:
    """Design an LQR at several airspeeds on the model with quasi-steady flapping.

    Each gain is checked on the full model (flapping states, servos where given, one sample of
    delay) and softened until stable there.

    Parameters
    ----------
    heli : Helicopter
        The model.
    low, high : float
        The range, m/s.
    dt : float
        Sample period, s.
    points : int
        Airspeeds, evenly from `low` to `high`.
    servos : mapping of str to Servo, or Actuation, optional
        By input; the delay of an Actuation, in whole samples, is in the full model too.
    sizes : mapping of str to float, optional
        Deviations of states and inputs (SI) that count as 1 in the weights, for those that shall
        not have the default one.

    Returns
    -------
    Autopilot
        For `fly`.

    Raises
    ------
    InputError
        No softening makes it stable, a sample period at which there is no LQR, or a size that is
        not positive.
    UnknownNameError
        A size of what is neither state nor input.

    References
    ----------
    Franklin, Powell and Workman (1998), Digital Control of Dynamic Systems, ch. 9.

    Examples
    --------
    >>> autopilot = symheli.flight.gain_scheduled_lqr(heli, 4.0, 6.0, dt=0.02, points=3)
    >>> slow = symheli.AirspeedSchedule.transition(4.0, 6.0, acceleration=2.0, hold=0.5)
    >>> record = symheli.fly(heli, slow, controller=autopilot)
    >>> bool(np.abs(record["phi"]).max() < 0.2)
    True
    """
    for name, size in (sizes or {}).items():
        if name not in SIZES:
            raise UnknownNameError("state or input", name, SIZES)
        positive(size, f"size of {name}")
    counting = {**SIZES, **(sizes or {})}
    actuation = Actuation.of(servos, period=dt)
    family = design_family(heli, np.linspace(low, high, whole(points, "points", 2)))
    design = family.residualize([s for s in UNMEASURED if s in family.states])
    designs, plants = (
        [design[k].discretize(dt) for k in range(len(design))],
        [actuation.discretize(family[k]) for k in range(len(family))],
    )
    radius = np.inf
    for softer in INPUT_SCALE_FACTORS:
        gains = np.stack([_lqr(model, counting, softer) for model in designs])
        radius = max(
            _closed_loop_radius(plant, K, design.states)
            for plant, K in zip(plants, gains, strict=True)
        )
        if radius < 1:
            return Autopilot(family.airspeeds, gains, design.states, dt, radius)
    raise InputError(
        f"the scheduled LQR is unstable on the full model at dt = {dt} s (eigenvalue {radius:.3f});"
        " sample faster"
    )


def _lqr(model: LinearModel, sizes: Mapping[str, float], softer: float) -> np.ndarray:
    Q = np.diag([1 / sizes[s] ** 2 for s in model.states])
    R = np.diag([1 / (softer * sizes[u]) ** 2 for u in model.inputs])
    try:
        return regulator(model.A, model.B, Q, R, dt=model.dt).K
    except InputError as error:
        raise InputError(
            f"no LQR at dt = {model.dt} s ({error}): the plant changes too little or too much"
            " between samples; choose dt near its time constants"
        ) from error


def _closed_loop_radius(plant: LinearModel, K: np.ndarray, measured: tuple[Signal, ...]) -> float:
    """Largest eigenvalue magnitude of u = -K x, at once and one sample late."""
    feedback = -K @ np.array([[float(s == t) for t in plant.states] for s in measured])
    nu = len(feedback)
    delayed = np.block([[plant.A, plant.B], [feedback, np.zeros((nu, nu))]])  # u(k) = -K x(k-1)
    return float(
        max(
            np.abs(np.linalg.eigvals(plant.A + plant.B @ feedback)).max(),
            np.abs(np.linalg.eigvals(delayed)).max(),
        )
    )
