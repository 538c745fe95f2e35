"""What lies between the deviations of a helicopter and its blade pitch: a controller with states,
servos, and the clock of a sampled loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.flight import Servo
from symheli.flight.servo import one_each
from symheli.lpv import append
from symheli.lpv.tools import Actuation
from symheli.values.arrays import Array
from symheli.values.kinematics import INPUTS
from symheli.values.numbers import whole
from symheli.values.summary import summarized

STATE_SIZE = 0.05
"""Half width of equal weight of a controller's state, a held command and a servo, rad,"""
SPEED_SIZE = 0.5
"""and of a servo's speed, rad/s."""


class Bank(NamedTuple):
    """Servos side by side, without limits: s' = A s + B command, blade pitch C s, and the state
    `settled` of 1 rad each.
    """

    A: Array
    B: Array
    C: Array
    settled: Array
    names: tuple[str, ...]
    speeds: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class LoopEquipment:
    """The parts of a loop whose states are part of the deviation; by default none.

    Parameters
    ----------
    states : tuple of str
        Names of the controller's states.
    actuation : Actuation
        Servos, one for each control or none; period of a sampled controller and, of one, whole
        periods of delay between a sample and the command that is made of it.
    parts : int
        Intervals of the clock between whose ends P is linear.

    Raises
    ------
    InputError
        Numbers that do not fit, a delay without a period, servos of other controls.

    Examples
    --------
    >>> LoopEquipment(actuation=Actuation(delay=0.02, period=0.02)).count
    8
    """

    states: tuple[str, ...] = ()
    actuation: Actuation = field(default_factory=Actuation)
    parts: int = 1

    __repr__ = summarized

    def __post_init__(self) -> None:
        whole(self.parts, "parts", 1)
        self.actuation.samples  # noqa: B018 - raises for a delay of a part of a period
        if self.actuation.servos is not None:
            one_each(self.actuation.servos, [str(name) for name in INPUTS])
            if self.period and any(math.isfinite(s.rate) for s in self.actuation.servos.values()):
                raise InputError(
                    "a sampled command jumps: servos with a rate limit need continuous time"
                )

    @property
    def period(self) -> float:
        """Sample period of the controller, s; 0: continuous time."""
        return self.actuation.period or 0.0

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the commands that are held, and of those that wait."""
        if not self.period:
            return ()
        return tuple(f"{u}_{kind}" for kind in self._waits for u in INPUTS)

    @property
    def _waits(self) -> list[str]:
        return [*(f"waiting{i + 1}" for i in range(self.actuation.samples)), "held"]

    @cached_property
    def bank(self) -> Bank | None:
        """The servos' linear parts."""
        if self.actuation.servos is None:
            return None
        made = append(*(self.actuation.servos[str(u)].linear(str(u)) for u in INPUTS))
        settled = -np.linalg.solve(made.A, made.B)
        units = tuple(s.unit == "rad/s" for s in made.states)
        return Bank(made.A, made.B, made.C, settled, tuple(map(str, made.states)), units)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all further states: of the controller, held commands, servos."""
        return (*self.states, *self.held, *(self.bank.names if self.bank else ()))

    @property
    def count(self) -> int:
        """Number of further states."""
        return len(self.names)

    @property
    def sizes(self) -> Array:
        """Half widths of equal weight of the further states."""
        speeds = self.bank.speeds if self.bank else ()
        own = [False] * (len(self.states) + len(self.held)) + list(speeds)
        return np.where(own, SPEED_SIZE, STATE_SIZE)

    # --- the loop ---------------------------------------------------------------------------------

    def flow(self, gain: Array) -> Array:
        """Blade pitch and the rates of the further states (k, 4 + m, n + m) by all deviations.

        gain (k, 4 + c, n + c): commands, and the rates of the controller's c states (sampled: their
        next values), by the deviations of n states and those of the controller.
        """
        k, rows, n = gain.shape[0], gain.shape[1] - 4, gain.shape[2] - (gain.shape[1] - 4)
        out = np.zeros((k, 4 + self.count, n + self.count))
        start, hold = n + rows, n + rows + len(self.held)
        command = np.zeros((k, 4, n + self.count))
        if self.period:
            command[:, :, hold - 4 : hold] = np.eye(4)
        else:
            command[:, :, :start] = gain[:, :4]
            out[:, 4 : 4 + rows, :start] = gain[:, 4:]
        if self.bank is None:
            out[:, :4] = command
            return out
        A, B, C, *_ = self.bank
        out[:, :4, hold:] = C
        out[:, 4 + hold - n :] = B @ command
        out[:, 4 + hold - n :, hold:] += A
        return out

    def jump(self, gain: Array) -> Array | None:
        """R (n + m, n + m): deviations after a sample by those before; None in continuous time."""
        if not self.period:
            return None
        (own,) = gain
        rows = len(own) - 4
        n = own.shape[1] - rows
        start, hold = n + rows, n + rows + len(self.held)
        R = np.eye(n + self.count)
        R[n:hold] = 0.0
        R[n:start, :start] = own[4:]
        R[start : start + 4, :start] = own[:4]
        R[start + 4 : hold, start : hold - 4] = np.eye(hold - start - 4)
        return R

    def commands(self, gain: Array) -> Array:
        """The commands (k, 4, n + m) by all deviations, as the servos receive them."""
        rows = gain.shape[1] - 4
        n = gain.shape[2] - rows
        out = np.zeros((len(gain), 4, n + self.count))
        if self.period:
            end = n + rows + len(self.held)
            out[:, :, end - 4 : end] = np.eye(4)
        else:
            out[:, :, : n + rows] = gain[:, :4]
        return out

    @property
    def forward(self) -> tuple[Array, Array]:
        """Rates of the further states (m, 4) by the rate of the reference's controls, which the
        servos' deviations are measured from, and by what is added to the commands alone.
        """
        moved, added = np.zeros((self.count, 4)), np.zeros((self.count, 4))
        if self.bank is not None:
            moved[-len(self.bank.A) :] = -self.bank.settled
            added[-len(self.bank.A) :] = self.bank.B
        return moved, added

    def steps(self, travel: Array) -> Array:
        """Rates of the further states (m, q), each times a number within [-1, 1], by the steps in
        which servos resolve their commands.
        """
        if self.actuation.servos is None or self.bank is None:
            return np.zeros((self.count, 0))
        half = [
            t / s.steps if (s := self.actuation.servos[str(u)]).steps else 0.0
            for u, t in zip(INPUTS, travel, strict=True)
        ]
        out = np.zeros((self.count, 4))
        out[-len(self.bank.A) :] = self.bank.B * half
        return out[:, np.array(half) > 0]

    # --- words and files --------------------------------------------------------------------------

    def sentences(self, gain: Array, states: Sequence[str]) -> tuple[str, ...]:
        """What is modelled, for a controller `gain` of deviations of these states."""
        rows = gain.shape[1] - 4
        used = np.any(gain[:, :, : gain.shape[2] - rows], axis=(0, 1))
        known = [name for name, is_used in zip(states, used, strict=False) if is_used]
        own = f" and {rows} states of its own" if rows else ""
        clock = "in continuous time"
        if self.period:
            clock = (
                f"sampled every {self.period:g} s and held, {self.actuation.samples} periods after"
                " the sample"
            )
        servos = "no servos: blade pitch follows its command at once"
        if self.actuation.servos is not None:
            each = ", ".join(f"{u} {_words(self.actuation.servos[str(u)])}" for u in INPUTS)
            servos = f"servos {each}; they resolve their commands in the steps given, or better"
        return (f"a controller of {' '.join(known)}{own}, {clock}", servos)

    def written(self) -> dict[str, Any]:
        """As JSON holds it."""
        servos = None
        if self.actuation.servos is not None:
            servos = {
                str(u): {
                    name: value
                    for name, value in asdict(self.actuation.servos[str(u)]).items()
                    if value is not None and math.isfinite(value)
                }
                for u in INPUTS
            }
        return {
            "states": list(self.states),
            "servos": servos,
            "period": self.period,
            "delay": self.actuation.samples,
            "parts": self.parts,
        }

    @classmethod
    def read(cls, given: Mapping[str, Any]) -> LoopEquipment:
        """The equipment so written."""
        servos = given["servos"]
        if servos is not None:
            servos = {str(u): Servo(**own) for u, own in servos.items()}
        return cls(
            tuple(map(str, given["states"])),
            of_periods(servos, float(given["period"]), int(given["delay"])),
            int(given["parts"]),
        )


def of_periods(servos: Any, period: float, delay: int) -> Actuation:
    """Return the actuation of servos, a period in s (0: none), and a delay in whole periods."""
    own = Actuation.of(servos, period=period or None)
    if not whole(delay, "delay", 0):
        return own
    if own.period is None:
        raise InputError("a delay counts sample periods: give period too")
    return Actuation.of(own, delay * own.period)


def _words(servo: Servo) -> str:
    zero = "" if servo.zero is None else f" zero {servo.zero:g} pole {servo.pole:g}"
    rate = f" rate {servo.rate:g} rad/s" if math.isfinite(servo.rate) else " no rate limit"
    steps = f" {servo.steps} steps" if servo.steps else ""
    return f"{servo.natural_frequency:.3g} rad/s damping {servo.damping:g}{zero}{rate}{steps}"
