"""Progress on standard error: bars with the remaining time on a terminal, elsewhere a line now and
then. What is over soon shows nothing.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from symheli.progress import Progress, watched

SOON = 1.0
"""Seconds after which a task is shown on a terminal."""
FIRST, EVERY = 2.0, 10.0
"""Seconds after which there is a first line where there is no terminal, and between two."""


@dataclass
class _Open:
    """A task under way, begun at `since` and at its last step when `stepped` (s)."""

    at: Progress
    since: float
    stepped: float

    def step(self, at: Progress, now: float) -> None:
        """Note where it is."""
        if at.done > self.at.done:
            self.stepped = now
        self.at = at

    def remaining(self, now: float) -> float | None:
        """Seconds, at the speed up to the last step; None where too little is known, or where the
        next step takes longer than all that should be left.
        """
        if not self.at.total or not self.at.total / 20 <= self.at.done <= self.at.total:
            return None
        left = (self.stepped - self.since) * (self.at.total - self.at.done) / self.at.done
        return left - (now - self.stepped) if left >= now - self.stepped else None


class _Shown(Protocol):
    """A way to show the open tasks, the outermost first."""

    def show(self, tasks: list[_Open], now: float) -> None:
        """Show the outermost task and the innermost one, with the remaining time of the outermost
        that has a number of steps.
        """
        ...

    def close(self) -> None:
        """Leave the screen as it was."""
        ...


class Display:
    """A listener that shows what has been going on for a while; a thread keeps the time, since a
    step may take minutes.
    """

    def __init__(self, shown: _Shown):
        self._shown = shown
        self._open: list[_Open] = []
        self._lock = threading.Lock()
        self._leave = threading.Event()
        self._thread: threading.Thread | None = None

    def __call__(self, progress: Progress) -> None:
        """Note where a task is."""
        now = time.monotonic()
        with self._lock:
            known = self._open[progress.depth :][:1]
            if progress.over:
                del self._open[progress.depth :]
            elif known and known[0].at.task == progress.task:
                known[0].step(progress, now)
            else:
                self._open[progress.depth :] = [_Open(progress, now, now)]
        if self._thread is None:
            self._thread = threading.Thread(target=self._tick, daemon=True, name="progress")
            self._thread.start()

    def close(self) -> None:
        """Show nothing more."""
        self._leave.set()
        if self._thread is not None:
            self._thread.join()
        self._shown.close()

    def _tick(self) -> None:
        while not self._leave.wait(0.2):
            with self._lock:
                tasks = list(self._open)
            self._shown.show(tasks, time.monotonic())


class Lines:
    """A line now and then, where something has changed."""

    def __init__(self) -> None:
        self._next, self._last = 0.0, ""

    def show(self, tasks: list[_Open], now: float) -> None:
        """The outermost task and the innermost one, with what the outermost that knows its steps
        will still take.
        """
        if not tasks or now < self._next or now - tasks[0].since < FIRST:
            return
        ends = tasks if len(tasks) < 3 else [tasks[0], tasks[-1]]
        line = "; ".join(str(one.at) for one in ends)
        if line == self._last:
            return
        left = next((task.remaining(now) for task in tasks if task.at.total), None)
        self._next, self._last = now + EVERY, line
        words = "" if left is None else f", about {duration(left)} left"
        sys.stderr.write(f"symheli: {line}{words}\n")  # at once: other threads write there, too
        sys.stderr.flush()

    def close(self) -> None:
        """Nothing to put back."""


class Bars:
    """A bar a task, below what is printed meanwhile."""

    def __init__(self) -> None:
        self._live: Any = None
        self._bars: list[tuple[_Open, Any]] = []

    def show(self, tasks: list[_Open], now: float) -> None:
        """Bars for the tasks that have been going on for a while, none for the others."""
        if self._live is None:
            if not tasks or now - tasks[0].since < SOON:
                return
            self._live = _live()
            self._live.start()
        wanted = [one for one in tasks if now - one.since >= SOON]
        same = 0
        while same < min(len(wanted), len(self._bars)) and self._bars[same][0] is wanted[same]:
            same += 1
        for _, bar in self._bars[same:]:
            self._live.remove_task(bar)
        del self._bars[same:]
        for one in wanted[same:]:
            bar = self._live.add_task("", total=None, count="", time="", note="")
            self._bars.append((one, bar))
        for one, bar in self._bars:
            left, spent = one.remaining(now), duration(now - one.since)
            self._live.update(
                bar,
                description="  " * one.at.depth + one.at.task,
                completed=one.at.done,
                total=one.at.total,
                count=one.at.count,
                time=spent if left is None else f"{spent}, about {duration(left)} left",
                note=one.at.note,
            )

    def close(self) -> None:
        """Remove the bars."""
        if self._live is not None:
            self._live.stop()


def duration(seconds: float) -> str:
    """Whole seconds, minutes, hours.

    >>> duration(7.2), duration(95.0), duration(4000.0)
    ('7 s', '1:35 min', '1:06 h')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02d} min"
    return f"{whole // 3600}:{whole % 3600 // 60:02d} h"


@contextmanager
def displayed() -> Iterator[None]:
    """Show the progress of the work within on standard error."""
    display = Display(Bars() if sys.stderr.isatty() else Lines())
    with watched(display):
        try:
            yield
        finally:
            display.close()


def _live() -> Any:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as RichProgress
    from rich.table import Column

    def text(form: str, style: str = "none") -> TextColumn:
        column = Column(no_wrap=True, overflow="ellipsis")
        return TextColumn(form, style, markup=False, table_column=column)

    return RichProgress(
        text("{task.description}"),
        BarColumn(bar_width=20),
        text("{task.fields[count]}"),
        text("{task.fields[time]}"),
        text("{task.fields[note]}", "dim"),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,
    )
