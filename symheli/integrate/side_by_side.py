"""Many flights cut into chunks, over the cores of this machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

from symheli.codegen import Layout
from symheli.errors import InputError

SIDE_BY_SIDE = Layout(width=8, groups=4)
"""Flights in vector registers at a time: eight doubles fill the widest, four groups hide the
latency of roots and quotients (two take 1.4 times as long, six spill too much).
"""

Chunk = TypeVar("Chunk")
Result = TypeVar("Result")


def workers_of(asked: int | None) -> int:
    """The number of threads asked for, or the cores this process may use; `InputError` below 1."""
    if asked is None:
        usable = getattr(os, "sched_getaffinity", None)
        return len(usable(0)) if usable else os.cpu_count() or 1
    if isinstance(asked, bool) or not isinstance(asked, int) or asked < 1:
        raise InputError(f"workers must be at least 1, got {asked!r}")
    return asked


def over_the_cores(
    run: Callable[[Chunk], Result],
    chunks: Sequence[Chunk],
    workers: int,
    stop: Callable[[], None],
) -> Iterator[tuple[Chunk, Result]]:
    """Each chunk with what `run` makes of it, as they are done. Where one fails, or the reader or
    Ctrl-C gives up, `stop` is called, the chunks under way are awaited and the rest is left.
    """
    waiting = list(reversed(chunks))
    with ThreadPoolExecutor(workers) as pool:
        running: dict[Future[Result], Chunk] = {}
        try:
            while waiting or running:
                while waiting and len(running) < 2 * workers:
                    chunk = waiting.pop()
                    running[pool.submit(run, chunk)] = chunk
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        except BaseException:
            for future in running:
                future.cancel()
            stop()
            raise
