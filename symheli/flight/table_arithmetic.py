"""One step of a controller in a table, in single precision: controller.c line by line.

Every operation and its order are written out, so that the C code gives the same bits: sums run
along a row from the first column, and nothing is left to a library of linear algebra.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from symheli.values.summary import summarized

MAX_COUNT = 2**30
"""Count of samples that is never reached."""


class StepEvents(IntFlag):
    """Events of a step of a `TableController`, as flags.

    `SATURATED`: a command is at its limit. `PARAMETER`: the reading of the scheduling parameter was
    implausible and was ignored. `FALLBACK`: it was implausible for too long, and the controller
    moves to its fallback value. `HELD`: an input or a result was NaN or infinite; the previous
    commands are kept, and the state is unchanged.

    Examples
    --------
    >>> from symheli.flight import StepEvents
    >>> StepEvents.PARAMETER in StepEvents.PARAMETER | StepEvents.FALLBACK
    True
    """

    FINE = 0
    SATURATED = 1
    PARAMETER = 2
    FALLBACK = 4
    HELD = 8


class InitialCommand(IntEnum):
    """Initial value of a command: its trim, the command in force, or none as it is under way."""

    GROUND = 0
    IN_FORCE = 1
    UNDER_WAY = 2


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers of the arithmetic: `knots` (K,), `matrices` (K, n + ny, n + nu + ny) with [A B L; C D
    0] and, one an output, the ends of its command `low`, `high`, whether it `integrates`; float32.

    `fade` is the part of an offset that is left after a sample, `step` the most that the parameter
    in use moves in one, `gain` that of the filter before (1: none), `frozen` and `hold` count
    samples.
    """

    order: int
    knots: Array
    matrices: Array
    low: Array
    high: Array
    integrates: Array
    fade: np.float32
    step: np.float32
    gain: np.float32
    plausible: tuple[np.float32, np.float32]
    fallback: np.float32
    frozen: int
    hold: int

    @property
    def searches(self) -> int:
        """Halvings that find the interval of any parameter."""
        return int(np.ceil(np.log2(len(self.knots) - 1)))


@dataclass(frozen=True, eq=False)
class TableState:
    """State of a `TableController` between samples; every step returns a new one.

    Parameters
    ----------
    flown : array (ny,)
        Which axes are flown.
    x : array (n,)
        The states.
    command, offset : array (ny,)
        The commands in force, rad, and what is left of what they began with beside their own.
    entry : array (ny,)
        Of `InitialCommand`: how each command begins.
    started : bool
        Whether the parameter was followed before.
    reading, target, filtered, parameter_used : float32
        Of the parameter, in its unit: the last reading, where it leads, filtered, and where in the
        table the last step was.
    same, bad : int
        How often the reading stayed the same, and how many bad ones came in a row.
    status : StepEvents
        What the last step met with.

    Examples
    --------
    >>> lqr = symheli.flight.gain_scheduled_lqr(heli, 0.0, 8.0, dt=0.02, points=5)
    >>> table = symheli.TableController.of(lqr.scheduled_controller.model)
    >>> u, state = table.update(table.init(), np.zeros(8), np.zeros(8), np.zeros(4), 2.0)
    >>> round(float(state.parameter_used), 2), state.status
    (2.0, <StepEvents.FINE: 0>)
    """

    flown: Array
    x: Array
    command: Array
    offset: Array
    entry: Array
    started: bool = False
    reading: np.float32 = field(default=np.float32(np.nan))
    target: np.float32 = field(default=np.float32(0))
    filtered: np.float32 = field(default=np.float32(0))
    parameter_used: np.float32 = field(default=np.float32(0))
    same: int = 0
    bad: int = 0
    status: StepEvents = StepEvents.FINE

    __repr__ = summarized

    def __post_init__(self) -> None:
        for array in (self.flown, self.x, self.command, self.offset, self.entry):
            array.flags.writeable = False

    @classmethod
    def ground(cls, n: Numbers, flown: Array) -> TableState:
        """Return the state on the ground: filters and integrators at zero; commands begin at their
        trim.
        """
        zeros = np.zeros(len(n.low), np.float32)
        return cls(flown, np.zeros(n.order, np.float32), zeros, zeros, zeros.astype(int))

    def entering(self, command: Array) -> TableState:
        """The same, to begin at the command in force (ny,)."""
        return replace(self, command=command, entry=np.full(len(command), InitialCommand.IN_FORCE))


def follow_parameter(n: Numbers, s: TableState, reading: np.float32, valid: bool) -> TableState:
    """Return the state whose parameter in use has moved towards a reading, or towards the
    replacement of an invalid one; its `status` concerns that alone.
    """
    status, target = StepEvents.FINE, s.target
    same = min(s.same + 1, MAX_COUNT - 1) if reading == s.reading else 0
    if valid and n.plausible[0] <= reading <= n.plausible[1] and same < n.frozen:
        bad = 0
        target = _clip(reading, n.knots[0], n.knots[-1])
    else:
        status |= StepEvents.PARAMETER
        bad = min(s.bad + 1, MAX_COUNT)
        if not s.started or bad > n.hold:
            status |= StepEvents.FALLBACK
            target = n.fallback
    if not s.started:
        filtered = used = target
    else:
        filtered = s.filtered + n.gain * (target - s.filtered) if n.gain < 1 else target
        change = _clip(filtered - s.parameter_used, -n.step, n.step)
        used = _clip(s.parameter_used + change, n.knots[0], n.knots[-1])
    return replace(
        s,
        started=True,
        reading=reading,
        target=target,
        filtered=filtered,
        parameter_used=used,
        same=same,
        bad=bad,
        status=status,
    )


def matrices_at(n: Numbers, p: np.float32) -> Array:
    """[A B L; C D 0], straight between the knots, p in their range."""
    below, above = 0, len(n.knots) - 1
    for _ in range(n.searches):
        middle = (below + above) // 2
        if middle > below and p >= n.knots[middle]:
            below = middle
        elif middle > below:
            above = middle
    weight = (p - n.knots[below]) / (n.knots[below + 1] - n.knots[below])
    return n.matrices[below] + weight * (n.matrices[below + 1] - n.matrices[below])


def commands(n: Numbers, s: TableState, error: Array, trim: Array, others: Array) -> TableState:
    """The state after one step at the parameter in use: its `command` is the answer, its `status`
    adds to that of `follow_parameter`.

    Parameters
    ----------
    n, s : Numbers, TableState
        The controller.
    error : array (nu,)
        Measured minus reference.
    trim, others : array (ny,)
        Commands of the trim, and those in force on the axes it does not fly.
    """
    flown = s.flown
    M, order, own = matrices_at(n, s.parameter_used), n.order, n.order + len(error)
    answer = _times(M[:, :own], np.concatenate([s.x, error]))
    before = np.where((s.entry == InitialCommand.GROUND) & np.isfinite(trim), trim, s.command)
    plain = np.where(n.integrates, before, trim) + answer[order:]
    wanted = plain + s.offset
    applied = _clip(wanted, n.low, n.high)
    entering = flown & (s.entry == InitialCommand.IN_FORCE)
    applied = np.where(entering, _clip(before, n.low, n.high), applied)
    applied = np.where(flown, applied, np.where(np.isfinite(others), others, before))
    wanted = np.where(entering, applied, wanted)
    excess = applied - wanted
    x = answer[:order]
    if order and (excess != 0).any():
        x = x + _times(M[:order, own:], excess)
    if not (np.isfinite(wanted).all() and np.isfinite(x).all()):
        return replace(
            s,
            command=np.where(flown, before, applied),
            entry=np.where(flown, s.entry, InitialCommand.IN_FORCE),
            status=s.status | StepEvents.HELD,
        )
    kept = np.where(entering, applied - plain, s.offset)
    return replace(
        s,
        x=x,
        command=applied,
        offset=n.fade * np.where(flown & ~n.integrates, kept, np.float32(0)),
        entry=np.where(flown, InitialCommand.UNDER_WAY, InitialCommand.IN_FORCE),
        status=s.status
        | (StepEvents.SATURATED if (flown & (excess != 0)).any() else StepEvents.FINE),
    )


def _times(M: Array, v: Array) -> Array:
    """M v, each sum from the first column to the last."""
    return np.add.accumulate(M * v, axis=1)[:, -1]


def _clip(value: Any, low: Any, high: Any) -> Any:
    """Limit to the ends; NaN stays."""
    return np.where(value < low, low, np.where(value > high, high, value))[()]
