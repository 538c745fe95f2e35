"""Calls for processes, the most urgent first, and what is done here with their answers."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

from studies.setup.stored_stages import Stored
from symheli.integrate.side_by_side import workers_of
from symheli.progress import task, watched

_Answer = tuple[float, float, Stored]
"""Begin (s, `time.time`), seconds of the processor, and the result."""


class Span(NamedTuple):
    """A call that has ended: when it began and ended (s, `time.time`), how long the processor
    worked on it (s, processes that it started too), and whether that was in this process.
    """

    title: str
    begin: float
    end: float
    processor: float
    here: bool


@dataclass(frozen=True, kw_only=True)
class Call:
    """A call for a process, or for this one if `here`; `then` takes its answer, in this one.

    Those of larger `urgency` begin first, of equal ones the first that came.
    """

    title: str
    urgency: float
    work: Callable[[], Any]
    then: Callable[[Stored], None]
    here: bool = False


@dataclass
class Schedule:
    """Calls that wait, and those under way in the processes: one more than there are cores, so that
    no process waits for this one; one less than there are cores while this one computes.
    """

    processes: Executor
    watch: Callable[[Span], object]
    count: int = field(default_factory=lambda: workers_of(None))
    _waiting: list[Call] = field(default_factory=list)
    _running: dict[Future[_Answer], Call] = field(default_factory=dict)
    _at: Call | None = None

    def put(self, call: Call) -> None:
        """Add a call."""
        self._waiting.append(call)
        self._waiting.sort(key=lambda one: -one.urgency)  # stable

    @property
    def titles(self) -> tuple[str, ...]:
        """Titles of the calls under way, the most urgent first."""
        under_way = sorted(self._running.values(), key=lambda one: -one.urgency)
        return tuple(dict.fromkeys(one.title for one in (self._at, *under_way) if one is not None))

    @property
    def failed(self) -> str:
        """Title of the call, or of the answer, by which an exception left `run`."""
        return "" if self._at is None else self._at.title

    def run(self, idle: Callable[[], None] = lambda: None) -> None:
        """Answer every call, also those that are put meanwhile; `idle` is called after each call
        here and when there is nothing to do here.
        """
        while self._waiting or self._running:
            self._hand_out()
            own = next((one for one in self._waiting if one.here), None)
            if own is not None:
                self._waiting.remove(own)
                with task(own.title):
                    self._take(own, partial(_answered, own.work))
            if own is not None or not any(future.done() for future in self._running):
                idle()
            done, _ = wait(self._running, 0 if own else None, FIRST_COMPLETED)
            for future in done:
                self._take(self._running.pop(future), future.result)

    def _hand_out(self) -> None:
        """Give the processes calls until there is an answer to take."""
        away = [one for one in self._waiting if not one.here]
        most = self.count + (1 if len(away) == len(self._waiting) else -1)
        for call in away:
            if len(self._running) >= most or any(one.done() for one in self._running):
                break
            self._waiting.remove(call)
            self._running[self.processes.submit(_in_silence, call.work)] = call

    def _take(self, call: Call, answer: Callable[[], _Answer]) -> None:
        self._at = call
        begin, processor, found = answer()
        self.watch(Span(call.title, begin, begin + found.seconds, processor, call.here))
        call.then(found)
        self._at = None


def _answered(work: Callable[[], Any]) -> _Answer:
    at, begin = time.time(), sum(os.times()[:4])
    found = timed(work)
    return at, sum(os.times()[:4]) - begin, found


def _in_silence(work: Callable[[], Any]) -> _Answer:
    """The answer of another process, whose progress would cover that of this one on a terminal."""
    with watched(None):
        return _answered(work)


def timed(work: Callable[[], Any]) -> Stored:
    """Return the result of a function, and its time."""
    begin = time.perf_counter()
    result = work()
    return Stored(result=result, seconds=time.perf_counter() - begin)
