"""Interruptible native code: an interrupt from the keyboard ends it at once, although one iteration
may take minutes; a panic becomes an error.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from symheli.errors import SolverError
from symheli.worker import ProcessEndedError, Worker, pickled

T = TypeVar("T")

MAX_WAIT = 1.0
"""Longest time for interrupted work to end, s."""


def in_thread(work: Callable[[threading.Event], T]) -> T:
    """Call work(stop) in a thread of its own, for work that releases Python's lock, and raise its
    exceptions here.

    An interrupt sets `stop`, at which the work must look often, and is raised here when it has
    ended, or `MAX_WAIT` later.
    """
    stop, done, outcome = threading.Event(), threading.Event(), []

    def run() -> None:
        try:
            outcome.append((work(stop), None))
        except BaseException as error:
            outcome.append((None, error))
        finally:
            done.set()

    threading.Thread(target=run, daemon=True, name="symheli solver").start()
    try:
        while not done.wait(0.2):  # on Windows a wait without timeout cannot be interrupted
            pass
    except BaseException:
        stop.set()
        done.wait(MAX_WAIT)  # Python ends badly where native code still runs
        raise
    value, error = outcome[0]
    if error is not None:
        raise error
    return value


def in_process(function: Callable[..., T], *arguments: Any) -> T:
    """Call function(*arguments) in a process of its own, for work that keeps Python's lock, and
    raise its exceptions here.

    The function is one of a module, arguments and result can be pickled. An interrupt ends the
    process. Raises `SolverError` where it ends without an answer.
    """
    try:
        with Worker() as worker:
            return worker(pickled(function, *arguments))
    except ProcessEndedError as error:
        raise SolverError(str(error)) from error


@contextmanager
def no_panic() -> Iterator[None]:
    """Raise `SolverError` for a panic of a solver written in Rust, which is no `Exception` and
    passes every `except Exception`.
    """
    try:
        yield
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise SolverError(f"the solver broke down: {error}") from error
