"""A record that comes again, at its own pace or another."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from studies.live.sample import Sample
from symheli import FlightRecord


class RecordSource:
    """The samples of a record, as if they came now; raises `EOFError` after the last.

    Parameters
    ----------
    record : FlightRecord
        What was recorded.
    name : str
        What messages call it.
    speed : float
        Times its own pace; inf as fast as it goes.
    """

    def __init__(
        self,
        record: FlightRecord,
        name: str,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.name, self._record, self._speed, self._clock = name, record, speed, clock
        self._next, self._begun = 0, math.nan
        self.signals, self.rate = tuple(map(str, record.signals)), 1.0 / record.dt

    def receive(self, timeout: float) -> Sequence[Sample]:
        """Return the samples that are due, waiting for the next at most so long (s)."""
        time_of = self._record.time
        if self._next == len(time_of):
            raise EOFError
        if math.isnan(self._begun):
            self._begun = self._clock()
        due = (time_of[self._next] - time_of[0]) / self._speed + self._begun
        left = due - self._clock()
        if left > timeout:
            time.sleep(timeout)
            return []
        time.sleep(max(left, 0.0))
        now = time_of[0] + (self._clock() - self._begun) * self._speed
        end = int(np.searchsorted(time_of, now, "right")) if math.isfinite(now) else len(time_of)
        end = max(end, self._next + 1)
        rows = range(self._next, end)
        self._next = end
        return [self._sample(k) for k in rows]

    def _sample(self, k: int) -> Sample:
        values = dict(zip(self.signals, self._record.values[k].tolist(), strict=True))
        return Sample(float(self._record.time[k]), values, self.name)

    def close(self) -> None:
        """Nothing is held."""
