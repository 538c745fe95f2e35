"""The controllers of tubes: linear-quadratic regulators, an observer of states that are not known,
and any linear or LPV controller by the names of its signals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symheli import Helicopter
from symheli.errors import InputError
from symheli.flight.controller import deviations
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.riccati import regulator
from symheli.values.arrays import Array
from symheli.values.sample_period import same_period
from symheli.values.signal import indices, signals

STATE_SIZES = (1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1, 10.0, 10.0)
"""Deviations of equal weight in the default feedback: m/s, rad/s, rad; rotor speed, rad/s, and the
governor's integral, rad.
"""
CONTROL_SIZES = (0.1, 0.1, 0.1, 0.1)
"""Controls of the same weight as these deviations, rad."""
MOVING_SIZES = (0.5, *STATE_SIZES[1:])
"""Deviations of equal weight along a range of airspeeds, in the units of `STATE_SIZES`."""
MOVING_CONTROLS = (0.3, 0.1, 0.05, 0.1)
"""Controls of the same weight along a range, rad: the collective turns the flow at the tail, whose
share of the pitching moment jumps with the wake and the stall, and the longitudinal cyclic makes up
for it.
"""
SLOW_SIZES = (1.0, 1.0, 1.0, 2.0, 2.0, 0.5, 0.2, 0.2, 1.0, 1.0, 10.0, 10.0)
"""Deviations of equal weight where servos or a sample period limit how fast feedback may be."""
SLOW_CONTROLS = (0.02, 0.02, 0.02, 0.02)
"""Controls of the same weight there, rad."""
RATE_ERROR = 5.0
"""Of the rates of known states in the design of the observer, in units of their sizes per second,
"""
FLAP_ERROR = 1.0
"""and of the states it estimates."""


@dataclass(frozen=True)
class Choice:
    """Parts that a loop's controller is made of.

    gain: array (4, n) or (nodes, 4, n), a `LinearModel` or LPV controller from deviations to
    commands by name, or None, a regulator of the states `known` (None: the ten of the ideal
    governor). period: s, 0 in continuous time. slow: servos or sampling limit its speed. moving:
    along a range of airspeeds.
    """

    gain: Any = None
    known: Sequence[str] | None = None
    period: float = 0.0
    slow: bool = False
    moving: bool = False

    def __post_init__(self) -> None:
        if self.gain is not None and self.known is not None:
            raise InputError("known is of the default feedback: leave it out where gain is given")

    def at(self, heli: Helicopter, x: Array, u: Array, airspeed: float) -> LinearModel:
        """The controller at an airspeed whose trim is (x, u), from states to controls by name."""
        if self.gain is None:
            return self._estimating(heli, x, u)
        model = self.gain
        if not isinstance(model, LinearModel):
            model = deviations(model).at(airspeed)
        indices(model.inputs, heli.states, "state")
        indices(model.outputs, heli.inputs, "input")
        if model.states and not same_period(model.dt, self.period or None):
            raise InputError(
                f"the controller has the sample period {model.dt}, the loop {self.period or None};"
                " give period=..., and sample what is continuous, .discretize(dt)"
            )
        return model

    def gains(self, heli: Helicopter, x: Array, u: Array, airspeeds: Array) -> tuple[Array, Any]:
        """K (nodes, 4 + c, n + c) at airspeeds whose trims are (x, u), and the names of the
        controller's states.
        """
        k, n = len(airspeeds), len(heli.states)
        if self.gain is not None and not hasattr(self.gain, "outputs") and _is_array(self.gain):
            return _schedule(self.gain, k, n), ()
        made = [self.at(heli, *at) for at in zip(x, u, airspeeds, strict=True)]
        return np.stack([_placed(heli, m) for m in made]), tuple(map(str, made[0].states))

    def regulator(self, heli: Helicopter, x: Array, u: Array) -> Array:
        """K (4, n) of the linear-quadratic regulator."""
        A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
        states, controls = STATE_SIZES, CONTROL_SIZES
        if self.slow or self.moving:
            slow, moving = (SLOW_SIZES, SLOW_CONTROLS), (MOVING_SIZES, MOVING_CONTROLS)
            states, controls = slow if self.slow else moving
        Q, R = (np.diag(np.array(sizes) ** -2.0) for sizes in (states[: len(x)], controls))
        return -regulator(A, B, Q, R).K

    def _estimating(self, heli: Helicopter, x: Array, u: Array) -> LinearModel:
        """The regulator, with an observer of the unknown states of the model it is designed on."""
        rotor = {"Om", "om_i"} & set(heli.states)
        known = [s for s in heli.states if s not in rotor] if self.known is None else self.known
        own = {str(s) for s in indices_of(known, heli)}
        if rotor and not rotor & own:  # the rotor's speed is the governor's: designed without
            heli = replace(heli, governor="ideal")
            x = x[: len(heli.states)]
        A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
        K = self.regulator(heli, x, u)
        y = np.array([s in own for s in map(str, heli.states)])
        sizes = np.array(STATE_SIZES[: len(x)])
        names = [
            f"{s}_observer" for s, is_known in zip(heli.states, y, strict=True) if not is_known
        ]
        L = np.zeros((len(names), int(y.sum())))
        if names:
            Q, R = np.diag(FLAP_ERROR * sizes[~y]) ** 2, np.diag(RATE_ERROR * sizes[y]) ** 2
            L = regulator(A[np.ix_(~y, ~y)].T, A[np.ix_(y, ~y)].T, Q, R).K.T
        # z follows the unknown states minus L times the known ones; T takes it from all states
        T, by_known, by_own = (
            np.zeros(shape) for shape in ((len(L), len(x)), (len(x), L.shape[1]), (len(x), len(L)))
        )
        T[:, y], T[:, ~y] = -L, np.eye(len(L))
        by_known[y], by_known[~y], by_own[~y] = np.eye(L.shape[1]), L, np.eye(len(L))
        F = T @ (A + B @ K)
        states = [s for s, is_known in zip(heli.states, y, strict=True) if is_known]
        made = LinearModel(
            F @ by_own,
            F @ by_known,
            K @ by_own,
            K @ by_known,
            signals(names),
            tuple(states),
            tuple(heli.inputs),
        )
        return made.discretize(self.period) if self.period and names else made


def indices_of(known: Sequence[str], heli: Helicopter) -> list[Any]:
    """Names of known states, checked."""
    if isinstance(known, str) or not known:
        raise InputError(f"known must be a list of some of {', '.join(heli.states)}; got {known!r}")
    indices(known, heli.states, "state")
    return list(known)


def _is_array(given: Any) -> bool:
    return isinstance(given, np.ndarray | list | tuple)


def _placed(heli: Helicopter, model: LinearModel) -> Array:
    """(4 + c, n + c): the model by all states and controls of the helicopter."""
    n, c = len(heli.states), len(model.states)
    columns = [*indices(model.inputs, heli.states, "state"), *range(n, n + c)]
    rows = [*indices(model.outputs, heli.inputs, "input"), *range(4, 4 + c)]
    K = np.zeros((4 + c, n + c))
    K[np.ix_(rows, columns)] = np.block([[model.D, model.C], [model.B, model.A]])
    return K


def _schedule(gain: Any, nodes: int, n: int) -> Array:
    K = np.asarray(gain, float)
    if K.shape not in ((4, n), (nodes, 4, n)) or not np.all(np.isfinite(K)):
        raise InputError(
            f"gain must be 4 by {n} finite numbers, rad per SI unit, or as many for each of the"
            f" {nodes} nodes of the airspeed; got {K.shape}"
        )
    return np.broadcast_to(K, (nodes, 4, n)).copy()
