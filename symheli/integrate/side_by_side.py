"""Many flights cut into chunks, over the cores of this machine."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import closing
from typing import TypeVar

from symheli.codegen import Layout
from symheli.errors import InputError

SIDE_BY_SIDE = Layout(width=8, groups=4)
"""Flights in vector registers at a time: eight doubles fill the widest, four groups hide the
latency of roots and quotients (two take 1.4 times as long, six spill too much).
"""

Chunk = TypeVar("Chunk")
Result = TypeVar("Result")


def workers_of(workers: int | None) -> int:
    """Return the requested number of threads, or of the cores this process may use; `InputError`
    below 1.
    """
    if workers is None:
        usable = getattr(os, "sched_getaffinity", None)
        return len(usable(0)) if usable else os.cpu_count() or 1
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise InputError(f"workers must be at least 1, got {workers!r}")
    return workers


def as_done(
    executor: Executor, run: Callable[[Chunk], Result], chunks: Iterable[Chunk], ahead: int
) -> Generator[tuple[Chunk, Future[Result]], None, None]:
    """Yield each chunk with the finished future of `run(chunk)`, as they are done, at most `ahead`
    handed to the executor at a time. If the reader stops, those not begun are cancelled.
    """
    waiting = iter(chunks)
    running: dict[Future[Result], Chunk] = {}
    try:
        while True:
            for chunk in itertools.islice(waiting, ahead - len(running)):
                running[executor.submit(run, chunk)] = chunk
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future
    finally:
        for future in running:
            future.cancel()


def over_the_cores(
    run: Callable[[Chunk], Result],
    chunks: Sequence[Chunk],
    workers: int,
    stop: Callable[[], None],
) -> Iterator[tuple[Chunk, Result]]:
    """Each chunk with what `run` makes of it, as they are done. Where one fails, or the reader or
    Ctrl-C gives up, `stop` is called, the chunks under way are awaited and the rest is left.
    """
    with ThreadPoolExecutor(workers) as pool:
        try:
            with closing(as_done(pool, run, chunks, 2 * workers)) as answers:
                for chunk, future in answers:
                    yield chunk, future.result()
        except BaseException:
            stop()
            raise
