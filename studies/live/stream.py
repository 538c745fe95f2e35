"""From samples as they come to rows at even times: what is late, lost, repeated, out of order, not
a number, or of another vehicle is named, and never learnt from.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from studies.live.sample import Sample
from symheli.errors import InputError
from symheli.values.arrays import Array

LONGEST_GAP = 2.5
"""Sample periods between two samples up to which rows between them are interpolated."""
JUMP = 2.0
"""Seconds by which the sender's clock may leave that of this machine between two samples."""
HOLE = 5.0
"""Seconds without a sample after which rows begin anew instead of being unknown one by one."""
LARGEST = 1e4
"""Value in SI beyond which a signal of a vehicle is taken for damage."""
MOST_ROUNDED = 0.2
"""The same of a clock in single precision, at most."""
ROUNDING = 1e-6
"""Fraction of a period by which a time may miss a row's."""


class StreamState(Enum):
    """State of the stream after the last sample."""

    WAITING = "nothing has come yet"
    GOOD = "samples come as they should"
    SILENT = "no sample for more than half a second"
    LOST = "samples are missing: rows between them are unknown"
    REPEATED = "the sender's clock stands still (paused, or a sample came again): left out"
    REORDERED = "a sample came after a later one and is left out"
    CLOCK_JUMP = "the sender's clock jumped: the recursion starts with new lags"
    NOT_A_NUMBER = "a value is missing, not finite or beyond 1e4: the row is unknown"
    COARSE_CLOCK = "the sender's clock has too few digits: begin its flight anew"
    OTHER_VEHICLE = "another sender is heard and left out"


class Row(NamedTuple):
    """Values (signals,) at one even time (s), NaN where they are not known."""

    time: float
    values: Array


class Stream:
    """Rows of `signals` every `dt` seconds on the sender's clock, by straight lines between its
    samples.

    Parameters
    ----------
    signals : sequence of str
        Columns of the rows.
    dt : float
        Period of the rows, s.

    Raises
    ------
    InputError
        For a period that is not positive.
    """

    def __init__(self, signals: Sequence[str], dt: float):
        if not (math.isfinite(dt) and dt > 0):
            raise InputError(f"dt: expected a period > 0 s, got {dt!r}")
        self.signals, self.dt = tuple(signals), dt
        self.state, self.counts = StreamState.WAITING, Counter[StreamState]()
        self.sender: str | None = None
        self._next = 0
        self._start = math.nan
        self._last: tuple[float, Array] | None = None
        self._received = -math.inf
        self._seen = np.zeros(len(self.signals), bool)
        self._steps: deque[float] = deque([dt], maxlen=50)

    @property
    def period(self) -> float:
        """Median time between the last samples on the sender's clock, s."""
        return float(np.median(self._steps))

    @property
    def missing(self) -> list[str]:
        """Signals of which no number has come yet."""
        return [name for name, seen in zip(self.signals, self._seen, strict=True) if not seen]

    def take(self, sample: Sample, received: float) -> list[Row]:
        """Return the rows that the sample completes; `received` (s) on this machine's clock."""
        self.sender = self.sender or sample.sender
        if sample.sender != self.sender:
            return self._is(StreamState.OTHER_VEHICLE)
        time = float(sample.time)
        if not math.isfinite(time):
            return self._is(StreamState.NOT_A_NUMBER)
        values = np.array([float(sample.values.get(name, math.nan)) for name in self.signals])
        values[~(np.abs(values) <= LARGEST)] = math.nan
        self._seen |= np.isfinite(values)
        if self._last is None:
            return self._begin(time, values, received)
        before, old = self._last
        step, waited = time - before, received - self._received
        if step == 0.0:
            self._received = received
            return self._is(StreamState.REPEATED)
        if abs(step - waited) > JUMP or step > HOLE:
            self._begin(time, values, received)
            lost = abs(step - waited) <= JUMP
            self._is(StreamState.LOST if lost else StreamState.CLOCK_JUMP)
            return [Row(time, values)]
        if step < 0.0:
            return self._is(StreamState.REORDERED)
        self._last, self._received = (time, values), received
        self._steps.append(step)
        rows = list(self._between(before, old, time, values))
        if any(np.isnan(row.values).any() for row in rows):
            known = bool(np.isfinite(old).all() and np.isfinite(values).all())
            self._is(StreamState.LOST if known else StreamState.NOT_A_NUMBER)
        else:
            coarse = all(self._coarse(t) for t in (before, time))
            self._is(StreamState.COARSE_CLOCK if coarse else StreamState.GOOD)
        return rows

    def _rounding(self, time: float) -> float:
        """Return by how much, s, a time may miss a row's: both are rounded where the clock is in
        single precision, and a row that waited for the next sample would be a sample late.
        """
        single = np.float32(time)
        digits = float(np.spacing(single)) if float(single) == time else 0.0
        return max(min(1.5 * digits, MOST_ROUNDED * self.dt), ROUNDING * self.dt)

    def _coarse(self, time: float) -> bool:
        """Whether a time is in single precision, with too few digits for the period."""
        single = np.float32(time)
        return float(single) == time and bool(np.spacing(single) > 0.2 * self.dt)

    def idle(self, now: float) -> None:
        """Say that nothing came until `now` (s), on this machine's clock."""
        if self._last is not None and now - self._received > 0.5:
            self.state = StreamState.SILENT

    def _begin(self, time: float, values: Array, received: float) -> list[Row]:
        self._start, self._next = time, 1
        self._last, self._received = (time, values), received
        whole = bool(np.isfinite(values).all())
        self._is(StreamState.GOOD if whole else StreamState.NOT_A_NUMBER)
        return [Row(time, values)]

    def _between(self, before: float, old: Array, time: float, new: Array) -> Iterator[Row]:
        """Yield the rows after one sample up to the next."""
        far = time - before > LONGEST_GAP * self.dt
        near = self._rounding(time)
        while (at := self._start + self._next * self.dt) <= time + near:
            part = min((at - before) / (time - before), 1.0)
            if abs(at - time) <= near:
                values = new
            elif far:
                values = np.full(len(new), math.nan)
            else:
                values = old + part * (new - old)
            yield Row(at, values)
            self._next += 1

    def _is(self, state: StreamState) -> list[Row]:
        self.state = state
        self.counts[state] += 1
        return []
