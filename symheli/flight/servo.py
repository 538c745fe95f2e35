"""Servos between the commanded and the real blade pitch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_model import LinearModel
from symheli.values.numbers import by_name, whole
from symheli.values.signal import Signal


@dataclass(frozen=True, kw_only=True)
class Servo:
    """A servo moves a control behind a limited, quantised command, its output within the travel.

    H(s) = (s/zero + 1)/(s/pole + 1) wn^2/(s^2 + 2 z wn s + wn^2).

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

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.Sensor : delay, sampling, bias and noise

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
        if self.steps is not None:
            whole(self.steps, "steps", 2)

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


def one_each(servos: Mapping[str, Servo], inputs: Sequence[str]) -> None:
    """Raises `InputError` where an input has no `Servo`, or one no input."""
    for name, servo in by_name(servos, "servos", "{signal: Servo}").items():
        if name not in inputs:
            raise UnknownNameError("input", name, inputs)
        if not isinstance(servo, Servo):
            raise InputError(f"servos[{name!r}]: expected a Servo, got {servo!r:.80}")
    if missing := [name for name in inputs if name not in servos]:
        raise InputError(f"servos: none given for {', '.join(missing)}")


ORDER = 3
"""Most states a servo has."""


class ServoState(NamedTuple):
    """States of the linear parts (n, 3), zeros where a servo has two, and the commands they follow
    (n,), rad.
    """

    x: np.ndarray
    followed: np.ndarray


class ServoBank:
    """Several servos stepped together: `init` at rest, then `step` every `dt` seconds.

    A (n, 3, 3), B, C and `settled`, the state that holds 1 rad (n, 3), `change` in a step and
    `resolution` (n,; 0: none), `travel` (n,): numbers of every servo, in rad.
    """

    def __init__(
        self, servos: Mapping[str, Servo], inputs: Sequence[str], travel: np.ndarray, dt: float
    ):
        """One servo for each of `inputs` with its `travel` (n,), rad, symmetric."""
        one_each(servos, inputs)
        bank, count = [servos[name] for name in inputs], len(inputs)
        self.A, self.B, self.C, self.settled = (
            np.zeros((count, ORDER, ORDER)),
            *(np.zeros((count, ORDER)) for _ in range(3)),
        )
        for i, (servo, name) in enumerate(zip(bank, inputs, strict=True)):
            m = servo.linear(name).discretize(dt)
            n = len(m.A)
            self.A[i, :n, :n], self.B[i, :n], self.C[i, :n] = m.A, m.B[:, 0], m.C[0]
            self.settled[i, :n] = np.linalg.solve(np.eye(n) - m.A, m.B[:, 0])
        self.travel = np.array(travel, float)
        self.change = np.array([servo.rate * dt for servo in bank])
        self.resolution = np.array(
            [2 * t / s.steps if s.steps else 0.0 for s, t in zip(bank, self.travel, strict=True)]
        )

    def init(self, deflection: np.ndarray) -> ServoState:
        """Everything at rest at `deflection` (n,), rad."""
        return ServoState(self.settled * deflection[:, None], np.array(deflection, float))

    def step(self, state: ServoState, command: np.ndarray) -> tuple[ServoState, np.ndarray]:
        """The state after `dt` and the deflections (n,), rad, reached then, limited to the
        travel.
        """
        followed = self._followed(state.followed, command)
        x = np.einsum("nij,nj->ni", self.A, state.x) + self.B * followed[:, None]
        moved = ServoState(x, followed)
        return moved, self.deflection(moved)

    def follow(self, commands: np.ndarray) -> np.ndarray:
        """Commands that the linear parts follow (k, n), rad, of commands (k, n): limited,
        quantised, and no faster than the servos.
        """
        out = np.empty_like(commands)
        last = commands[0]
        for k, command in enumerate(commands):
            out[k] = last = self._followed(last, command)
        return out

    def _followed(self, last: np.ndarray, command: np.ndarray) -> np.ndarray:
        wanted = np.clip(command, -self.travel, self.travel)
        coarse = self.resolution > 0
        grain = self.resolution[coarse]
        wanted[coarse] = np.round(wanted[coarse] / grain) * grain
        return last + np.clip(wanted - last, -self.change, self.change)

    def deflection(self, state: ServoState) -> np.ndarray:
        """Deflections (n,), rad."""
        return np.clip((self.C * state.x).sum(axis=1), -self.travel, self.travel)
