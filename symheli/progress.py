"""Progress of long computations, reported to listeners.

A computation reports its tasks and their steps; `watched` sets the listener for everything that is
called within it, in the same thread. Without a listener a line on a terminal or in a notebook shows
what takes longer than two seconds (SYMHELI_PROGRESS=0: nothing); elsewhere a report costs next to
nothing.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from multiprocessing import parent_process
from typing import TypeVar

from symheli.errors import InputError
from symheli.values.tracking import watch_by

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

_listener: ContextVar[Listener | None] = ContextVar("listener")
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
    before = _listener.set(listener), _depth.set(0)
    try:
        yield
    finally:
        _listener.reset(before[0])
        _depth.reset(before[1])


class _Line:
    """A listener that shows the outermost and the innermost task in one line of standard error."""

    AFTER, EVERY, WIDEST = 2.0, 1.0, 110
    """Seconds until it is shown, and between two changes; characters of it at most."""

    def __init__(self) -> None:
        self._open: list[Progress] = []
        self._since, self._width = 0.0, 0
        self._over: threading.Event | None = None
        self._lock = threading.Lock()

    def __call__(self, progress: Progress) -> None:
        """Note where a task is; the outermost begins and ends the showing."""
        self._open = [*self._open[: progress.depth], *([] if progress.over else [progress])]
        if self._open and self._over is None:
            self._since, self._over = time.monotonic(), threading.Event()
            threading.Thread(target=self._show, args=(self._over,), daemon=True).start()
        elif not self._open and self._over is not None:
            with self._lock:
                self._over.set()
                self._over = None
                if self._width:
                    self._write("")

    def _show(self, over: threading.Event) -> None:
        wait = self.AFTER
        while not over.wait(wait):
            shown = "; ".join(map(str, dict.fromkeys([*self._open[:1], *self._open[-1:]])))
            with self._lock:
                if not over.is_set():
                    self._write(f"symheli: {shown}, {time.monotonic() - self._since:.0f} s")
            wait = self.EVERY

    def _write(self, text: str) -> None:
        text = text[: self.WIDEST]
        sys.stderr.write(f"\r{text:{self._width}}{'' if text else chr(13)}")
        sys.stderr.flush()
        self._width = len(text)


_line = _Line()


def _usual() -> Listener | None:
    """The line, in the main thread of a process of its own with a terminal or a notebook."""
    seen = sys.stderr.isatty() or "ipykernel" in sys.modules
    main = threading.current_thread() is threading.main_thread() and parent_process() is None
    return _line if seen and main and os.environ.get("SYMHELI_PROGRESS") != "0" else None


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
    try:
        listener = _listener.get()
    except LookupError:  # nobody has asked
        listener = _usual()
    begun = Task(Progress(title, 0, total, depth=depth, percent=percent), listener)
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


watch_by(tracked)
