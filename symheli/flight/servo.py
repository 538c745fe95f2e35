"""Servos between the commanded and the real blade pitch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel
from symheli.values.signal import Signal


@dataclass(frozen=True, kw_only=True)
class Servo:
    """H(s) = (s/zero + 1)/(s/pole + 1) wn^2/(s^2 + 2 z wn s + wn^2) behind a limited, quantised
    command; output within the travel.

    Parameters
    ----------
    natural_frequency : float
        wn, rad/s.
    damping : float
        z, dimensionless.
    zero, pole : float, optional
        rad/s; both None: second order.
    rate : float
        Fastest change of the command it follows, rad/s of blade pitch; inf: no limit.
    steps : int, optional
        Positions from stop to stop it resolves; None: all.

    Raises
    ------
    InputError
        A number that is not positive, or a zero without a pole.

    References
    ----------
    Gavrilets (2015), Handbook of Unmanned Aerial Vehicles (the servos of the X-Cell).

    Examples
    --------
    >>> cyclic = symheli.Servo(natural_frequency=36.0, damping=0.5, zero=104.0, pole=33.0)
    >>> slow = symheli.AirspeedSchedule.transition(4.0, 5.0, acceleration=1.0, hold=0.5)
    >>> record = symheli.fly(heli, slow, servos=dict.fromkeys(map(str, heli.inputs), cyclic))
    >>> "d_lon_command" in record.signals
    True
    """

    natural_frequency: float
    damping: float
    zero: float | None = None
    pole: float | None = None
    rate: float = math.inf
    steps: int | None = None

    def __post_init__(self) -> None:
        if not (self.natural_frequency > 0 and self.damping > 0 and self.rate > 0):
            raise InputError(
                "a servo needs natural_frequency > 0 rad/s, damping > 0 and rate > 0 rad/s"
            )
        pair = [value for value in (self.zero, self.pole) if value is not None]
        if len(pair) == 1 or not all(value > 0 for value in pair):
            raise InputError("a servo's zero and pole are both given, > 0 rad/s, or both left out")
        if self.steps is not None and self.steps < 2:
            raise InputError(f"steps: expected at least 2 positions, got {self.steps}")

    def linear(self, name: str) -> LinearModel:
        """From the input `<name>_command` to the output `name` (rad), without limits; states
        `<name>_servo1` .. .
        """
        wn, z = self.natural_frequency, self.damping
        A, B, C = (
            np.array([[0, 1], [-(wn**2), -2 * z * wn]]),
            np.array([[0.0], [wn**2]]),
            np.array([[1.0, 0.0]]),
        )
        if self.zero is not None and self.pole is not None:
            # the lead-lag first: its output (1 - r) x + r command, r = pole/zero, drives the second
            # order
            r = self.pole / self.zero
            A = np.block([[A, (1 - r) * B], [np.zeros((1, 2)), np.array([[-self.pole]])]])
            B, C = np.vstack([r * B, [[self.pole]]]), np.hstack([C, [[0.0]]])
        states = tuple(
            Signal(f"{name}_servo{i + 1}", ("rad", "rad/s", "rad")[i]) for i in range(len(A))
        )
        return LinearModel(
            A,
            B,
            C,
            np.zeros((1, 1)),
            states,
            (Signal(f"{name}_command", "rad"),),
            (Signal(name, "rad"),),
        )


CYCLIC = Servo(natural_frequency=36.0, damping=0.5, zero=104.0, pole=33.0, steps=150)
"""Futaba S9402, loaded, of cyclic and collective. Source: G15, actuators (zero and pole printed in
s, meant rad/s; no rate limit given).
"""
TAIL = Servo(natural_frequency=2 * math.pi * 7.0, damping=0.6, steps=145)
"""Futaba S9450 of the tail: 0.3 deg steps over its travel. Source: G15, actuators."""
XCELL_SERVOS: Mapping[str, Servo] = {
    "d_lon": CYCLIC,
    "d_lat": CYCLIC,
    "d_col": CYCLIC,
    "d_ped": TAIL,
}
"""The servos of the X-Cell .60 by input."""


class ServoState(NamedTuple):
    """States of the linear parts (servo by servo) and the commands they follow (n,), rad."""

    x: tuple[np.ndarray, ...]
    followed: np.ndarray


class ServoBank:
    """Several servos stepped together: `init` at rest, then `step` every `dt` seconds."""

    def __init__(
        self, servos: Mapping[str, Servo], inputs: Sequence[str], travel: np.ndarray, dt: float
    ):
        """One servo for each of `inputs` with its `travel` (n,), rad, symmetric."""
        for name in servos:
            if name not in inputs:
                raise UnknownNameError("input", name, inputs)
        missing = [name for name in inputs if name not in servos]
        if missing:
            raise InputError(f"servos: none given for {', '.join(missing)}")
        self._servos = [servos[name] for name in inputs]
        self._models = [
            servo.linear(name).discretize(dt)
            for servo, name in zip(self._servos, inputs, strict=True)
        ]
        self._travel = np.asarray(travel, float)
        self._change = np.array([servo.rate * dt for servo in self._servos])
        self._quantum = np.array(
            [
                2 * t / s.steps if s.steps else 0.0
                for s, t in zip(self._servos, self._travel, strict=True)
            ]
        )

    def init(self, deflection: np.ndarray) -> ServoState:
        """Everything at rest at `deflection` (n,), rad."""
        x = tuple(
            d * np.linalg.solve(np.eye(len(m.A)) - m.A, m.B[:, 0])
            for m, d in zip(self._models, deflection, strict=True)
        )
        return ServoState(x, np.array(deflection, float))

    def step(self, state: ServoState, command: np.ndarray) -> tuple[ServoState, np.ndarray]:
        """The state after `dt` and the deflections (n,), rad, reached then, limited to the
        travel.
        """
        wanted = np.clip(command, -self._travel, self._travel)
        coarse = self._quantum > 0
        wanted[coarse] = np.round(wanted[coarse] / self._quantum[coarse]) * self._quantum[coarse]
        followed = state.followed + np.clip(wanted - state.followed, -self._change, self._change)
        x = tuple(
            m.A @ z + m.B[:, 0] * c for m, z, c in zip(self._models, state.x, followed, strict=True)
        )
        return ServoState(x, followed), self.deflection(ServoState(x, followed))

    def deflection(self, state: ServoState) -> np.ndarray:
        """Deflections (n,), rad."""
        out = np.array([m.C[0] @ z for m, z in zip(self._models, state.x, strict=True)])
        return np.clip(out, -self._travel, self._travel)
