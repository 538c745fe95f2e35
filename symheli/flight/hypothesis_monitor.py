"""Whether the hypotheses of a certificate are met in flight, sample by sample: range and rate of
the parameter, commands within their limits, the sample period.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntFlag
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from symheli.errors import InputError
from symheli.flight.single_precision import MAX_NUMBER, NUMBER, checked_numbers, inward
from symheli.flight.table_controller import TableController, checked_limits
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from symheli.values.numbers import finite
from symheli.values.signal import Signal, signals
from symheli.values.summary import summarized

ROUNDING = 4
"""Units of the last place of the largest parameter that readings and their sums may be off by."""

MAX_WINDOW = 1000
"""Samples that a window may have: each is looked at in each step."""


class HypothesisEvents(IntFlag):
    """Hypotheses that a sample does not meet, as flags; `MET` where it meets all.

    `RANGE`: the parameter is outside the proven range. `RATE`: no motion within the proven rate
    explains the readings of the window. `SATURATED`: a command is at its limit or beyond.
    `PERIOD`: the time since the sample before is not the sample period. `MISSING`: a reading or a
    command is no finite number, or is not trusted. `UNKNOWN`: the window is not full yet, at the
    start and after a sample that was missing or off its period.

    Examples
    --------
    >>> from symheli.flight import HypothesisEvents
    >>> HypothesisEvents.RATE in HypothesisEvents.RATE | HypothesisEvents.UNKNOWN
    True
    """

    MET = 0
    RANGE = 1
    RATE = 2
    SATURATED = 4
    PERIOD = 8
    MISSING = 16
    UNKNOWN = 32


@dataclass(frozen=True, eq=False)
class HypothesisState:
    """State of a `HypothesisMonitor` between samples; every step returns a new one.

    Parameters
    ----------
    readings, elapsed : array (W,)
        Parameter at the samples before, newest first, and the seconds from each to the next.
    filled : int
        Number of them that are known.
    started : bool
        Whether there was a sample before.

    Examples
    --------
    >>> from symheli.flight import HypothesisMonitor
    >>> speed = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
    >>> HypothesisMonitor(speed, 0.02, {}).init().filled
    0
    """

    readings: Array
    elapsed: Array
    filled: int = 0
    started: bool = False

    __repr__ = summarized


@dataclass(frozen=True, eq=False)
class HypothesisMonitor:
    """A hypothesis monitor says at each sample whether what a certificate assumes is met, in 32-bit
    arithmetic.

    The rate is judged by all differences within a window: |p(k) - p(k-j)| <= rate (t(k) - t(k-j)) +
    noise for j = 1 .. W. This holds just where some p(t) that keeps to the rate passes all readings
    of the window within noise/2. What p does between two samples is not seen.

    Parameters
    ----------
    scheduling : Scheduling
        Parameter with its proven range and rate, a number.
    dt : float
        Sample period, s.
    limits : mapping of str to (float, float)
        Ends of each command, in its unit.
    outputs : sequence of str
        The commands, in order; default those of `limits`.
    window : float
        Length of the window, s; one sample at least.
    noise : float
        Peak-to-peak error of a reading, in the unit of the parameter; also the tolerance of the
        rate.
    jitter : float
        Fraction of the sample period by which a period may be off.

    Raises
    ------
    InputError
        For a rate that is another parameter, a range beyond 32 bits, limits that are not low <
        high, and times, noise or jitter that are not positive.

    See Also
    --------
    symheli.export.write_monitor : the monitor in C

    Examples
    --------
    >>> from symheli.flight import HypothesisMonitor
    >>> speed = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
    >>> monitor = HypothesisMonitor(speed, 0.02, {"d_lon": (-0.2, 0.2)}, window=0.02)
    >>> state = monitor.init()
    >>> for V in (5.0, 5.05, 5.2):
    ...     events, state = monitor.update(state, V, 0.02, [0.0])
    ...     print(events.name)
    UNKNOWN
    MET
    RATE
    """

    scheduling: Scheduling
    dt: float
    limits: Mapping[str, tuple[float, float]]
    outputs: tuple[Signal, ...] = ()
    window: float = 0.2
    noise: float = 0.0
    jitter: float = 0.05

    __repr__ = summarized

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", signals(self.outputs or tuple(self.limits)))
        object.__setattr__(self, "limits", checked_limits(self.limits, self.outputs))
        for name in ("dt", "window", "noise", "jitter"):
            finite(getattr(self, name), name)
        if isinstance(self.scheduling.rate, str):
            raise InputError(
                f"scheduling: the rate of {self.scheduling.name} is {self.scheduling.rate}; a"
                " monitor needs it as a number"
            )
        if not (self.dt > 0 and self.window > 0 and self.noise >= 0):
            raise InputError("dt and window: expected positive seconds, and noise >= 0")
        if not 0 < self.jitter < 1:
            raise InputError(f"jitter: expected a fraction within (0, 1), got {self.jitter:g}")
        if not self.window / self.dt <= MAX_WINDOW:
            raise InputError(
                f"window: expected {MAX_WINDOW} samples at most, got {self.window / self.dt:g}"
            )
        largest = max(abs(self.scheduling.low), abs(self.scheduling.high))
        if not largest < 0.1 * float(MAX_NUMBER):
            raise InputError(
                f"scheduling {self.scheduling.name}: its range ends at {largest:g}, too large for"
                " numbers of 32 bits: give it in another unit"
            )

    @classmethod
    def of(
        cls,
        table: TableController,
        proven: Scheduling | None = None,
        *,
        window: float = 0.2,
        noise: float = 0.0,
        jitter: float = 0.05,
    ) -> HypothesisMonitor:
        """Return the monitor of a controller: its period and limits, and the range and rate of its
        parameter.

        Parameters
        ----------
        table : TableController
            The controller that flies.
        proven : Scheduling, optional
            Range and rate of a certificate; default those for which the table was made. The range
            is cut to that of the table, which follows no farther.
        window, noise, jitter : float
            As above.

        Raises
        ------
        InputError
            For another parameter or unit than the table's, or a range without common values.
        """
        own = table.model.scheduling
        proven = own if proven is None else proven
        if (proven.name, proven.unit) != (own.name, own.unit):
            raise InputError(
                f"proven: the table is over {own.name} ({own.unit}), and what is proven over"
                f" {proven.name} ({proven.unit})"
            )
        low, high = max(own.low, proven.low), min(own.high, proven.high)
        if not low < high:
            raise InputError(
                f"proven: the table is over {own.low:g} to {own.high:g} {own.unit} of {own.name},"
                f" and what is proven over {proven.low:g} to {proven.high:g}: nothing in common"
            )
        common = Scheduling(own.name, own.unit, low, high, proven.rate)
        return cls(common, table.dt, table.limits, table.outputs, window, noise, jitter)

    @property
    def samples(self) -> int:
        """Number of samples of the window."""
        return max(1, math.ceil(self.window / self.dt - 1e-9))

    @cached_property
    def numbers(self) -> Mapping[str, np.float32]:
        """Numbers of the arithmetic, here and in C, each rounded to the strict side."""
        s = self.scheduling
        largest = NUMBER(max(abs(s.low), abs(s.high)))
        off = self.noise + ROUNDING * float(np.spacing(largest))
        return {
            "low": inward(s.low, math.inf),
            "high": inward(s.high, -math.inf),
            "rate": inward(min(float(s.limit), float(MAX_NUMBER)), -math.inf),
            "noise": inward(off, -math.inf),
            "shortest": inward(self.dt * (1 - self.jitter), math.inf),
            "longest": inward(self.dt * (1 + self.jitter), -math.inf),
        }

    @cached_property
    def ends(self) -> Array:
        """Ends of the commands (ny, 2), as a controller holds them."""
        given = [self.limits.get(str(y), (-math.inf, math.inf)) for y in self.outputs]
        pairs = [(inward(a, math.inf), inward(b, -math.inf)) for a, b in given]
        return np.array(pairs, NUMBER).reshape(-1, 2)

    def init(self) -> HypothesisState:
        """The state before the first sample."""
        return HypothesisState(np.zeros(self.samples, NUMBER), np.zeros(self.samples, NUMBER))

    def update(
        self,
        state: HypothesisState,
        parameter: float,
        elapsed: float,
        command: ArrayLike,
        *,
        valid: bool = True,
    ) -> tuple[HypothesisEvents, HypothesisState]:
        """Return the hypotheses that a sample does not meet, and the next state.

        Parameters
        ----------
        state : HypothesisState
            Of `init` or of the sample before.
        parameter : float
            As it is measured, in its unit.
        elapsed : float
            Seconds since the sample before, as measured; anything at the first.
        command : (ny,)
            The commands, in their units.
        valid : bool
            Whether who read the parameter trusts it.
        """
        with np.errstate(over="ignore"):  # infinity is handled below
            n, p, dt = self.numbers, NUMBER(parameter), NUMBER(elapsed)
            u = checked_numbers("command", command, len(self.outputs))
        events, filled = HypothesisEvents.MET, state.filled
        known = bool(valid and np.isfinite(p))
        kept = bool(n["shortest"] <= dt <= n["longest"])
        if not known:
            events |= HypothesisEvents.MISSING
        elif not n["low"] <= p <= n["high"]:
            events |= HypothesisEvents.RANGE
        if state.started and not kept:
            events |= HypothesisEvents.PERIOD
        if not (state.started and known and kept):
            filled = 0
        past = np.concatenate([[dt], state.elapsed[:-1]]).astype(NUMBER)
        if self._too_fast(p, state.readings[:filled], past[:filled]):
            events |= HypothesisEvents.RATE
        if filled < self.samples:
            events |= HypothesisEvents.UNKNOWN
        events |= self._commanded(u)
        readings = np.concatenate([[p], state.readings[:-1]]).astype(NUMBER)
        filled = min(filled + 1, self.samples) if known else 0
        return events, HypothesisState(readings, past, filled, True)

    def _too_fast(self, p: np.float32, readings: Array, elapsed: Array) -> bool:
        """Whether one of the differences to the readings before is more than the rate allows."""
        with np.errstate(all="ignore"):
            time = np.add.accumulate(elapsed, dtype=NUMBER)
            most = self.numbers["rate"] * time + self.numbers["noise"]
            return bool((~(np.abs(p - readings) <= most)).any())

    def _commanded(self, u: Array) -> HypothesisEvents:
        events = HypothesisEvents.MET
        if not np.isfinite(u).all():
            events |= HypothesisEvents.MISSING
        if ((u <= self.ends[:, 0]) | (u >= self.ends[:, 1])).any():
            events |= HypothesisEvents.SATURATED
        return events
