"""Progress of long computations, reported to listeners; this module shows nothing itself.

A computation reports its tasks and their steps; `watched` sets the listener for everything that is
called within it, in the same thread. Without a listener a report costs next to nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import TypeVar

from symheli.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True)
class Progress:
    """Progress of a task.

    Parameters
    ----------
    task : str
        What is done, such as "trimming and linearizing".
    done, total : float
        Steps finished, and the number of all steps; None where that is not known.
    percent : bool
        Show the percentage instead of the number of steps.
    note : str
        What the last step found.
    depth : int
        Number of reported tasks that it is a part of.
    over : bool
        The task has ended, finished or not.

    Examples
    --------
    >>> from symheli.progress import Progress
    >>> str(Progress("flying", 3, 12)), str(Progress("study", 3, 12, percent=True))
    ('flying: 3 of 12', 'study: 25 %')
    """

    task: str
    done: float = 0
    total: float | None = None
    note: str = ""
    depth: int = 0
    over: bool = False
    percent: bool = False

    @property
    def count(self) -> str:
        """Steps done and their total, as far as it is known, or the percentage."""
        if self.total is None:
            return f"{self.done:g}" if self.done else ""
        if self.percent:
            return f"{100 * self.done / self.total:.0f} %"
        return f"{self.done:g} of {self.total:g}"

    def __str__(self) -> str:
        return f"{self.task}{self.count and f': {self.count}'}{self.note and f' ({self.note})'}"


Listener = Callable[[Progress], object]

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)
_depth: ContextVar[int] = ContextVar("depth", default=0)


@contextmanager
def watched(listener: Listener | None) -> Iterator[None]:
    """Report the progress of the work within this context to a listener; None: to nobody.

    It is called in the thread that works, when a task begins, with each step and when it ends; an
    exception it raises ends the work.

    Parameters
    ----------
    listener : callable or None
        Called with a `Progress`.

    Raises
    ------
    InputError
        Another listener.

    Examples
    --------
    >>> with symheli.progress.watched(lambda progress: print(progress) if progress.over else None):
    ...     trims = symheli.steady.trim_batch(heli, airspeed=[2.0, 5.0, 8.0])
    trimming: 3 of 3
    """
    if listener is not None and not callable(listener):
        raise InputError(f"listener: expected a function of a Progress, or None, got {listener!r}")
    before = _listener.get(), _depth.get()
    _listener.set(listener)
    _depth.set(0)
    try:
        yield
    finally:
        _listener.set(before[0])
        _depth.set(before[1])


class Task:
    """A task under way."""

    def __init__(self, begun: Progress, listener: Listener | None):
        self._at = begun
        self._listener = listener
        if listener is not None:
            listener(self._at)

    def to(self, done: float, note: str = "") -> None:
        """Report that `done` steps are finished."""
        if self._listener is not None:
            self._at = replace(self._at, done=done, note=note)
            self._listener(self._at)

    def step(self, note: str = "") -> None:
        """Report one more finished step."""
        self.to(self._at.done + 1, note)

    def end(self) -> None:
        """Report that the task has ended."""
        if self._listener is not None:
            self._listener(replace(self._at, over=True))


@contextmanager
def task(title: str, total: float | None = None, *, percent: bool = False) -> Iterator[Task]:
    """Run a task of `total` steps, ended however its block is left; with `percent` only the
    percentage is reported.
    """
    depth = _depth.get()
    begun = Task(Progress(title, 0, total, depth=depth, percent=percent), _listener.get())
    _depth.set(depth + 1)
    try:
        yield begun
    finally:
        _depth.set(depth)
        begun.end()


def tracked(title: str, items: Iterable[T], total: float | None = None) -> Iterator[T]:
    """Yield the items; a step is finished when the next one is requested."""
    if total is None and hasattr(items, "__len__"):
        total = len(items)  # type: ignore[arg-type]
    if total == 0:
        yield from items
        return
    with task(title, total) as own:
        for item in items:
            yield item
            own.step()
