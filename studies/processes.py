"""Calls side by side, each in a process of its own."""

from __future__ import annotations

import contextlib
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from types import TracebackType
from typing import Any

from symheli.errors import SymheliError
from symheli.integrate.side_by_side import workers_of

Call = Callable[[], Any]
"""A function of a module with its arguments (`functools.partial`), which can be pickled."""


UNREADABLE = (TypeError, ValueError, AttributeError, ImportError, IndexError, KeyError)
"""What goes wrong where an answer is no value of this project."""


class Processes:
    """`count` processes (default: one a core) that compute what is submitted, in that order; with
    one, the caller computes when it asks for the result.

    They import this project and nothing of the script that started them. Leaving the `with` block
    ends them; what is under way is lost where it is left by an exception, Ctrl-C too.
    """

    def __init__(self, count: int | None = None):
        self._count = workers_of(count)
        self._waiting: queue.SimpleQueue[tuple[str, bytes, Future[Any]] | None]
        self._waiting = queue.SimpleQueue()
        self._running: list[subprocess.Popen[bytes]] = []
        self._serving: list[threading.Thread] = []
        self._leaving = False

    def __enter__(self) -> Processes:
        return self

    def submit(self, calls: Sequence[Call]) -> list[Future[Any]]:
        """A result to come for each call; an exception of a call is raised by its `result()`."""
        futures: list[Future[Any]] = [Future() if self._count > 1 else _Here(c) for c in calls]
        if self._count > 1:
            for call, future in zip(calls, futures, strict=True):
                self._waiting.put((_name(call), pickle.dumps(call), future))
            while len(self._running) < self._count:
                self._start()
        return futures

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._leaving = True
        for process in self._running if kind is not None else ():
            process.kill()
        for _ in self._serving:
            self._waiting.put(None)
        for thread in self._serving:
            thread.join()
        for process in self._running:
            process.wait()

    def _start(self) -> None:
        process = subprocess.Popen(
            [sys.executable, "-m", "studies.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for this process, which ends them
        )
        self._running.append(process)
        self._serving.append(threading.Thread(target=self._serve, args=(process,), daemon=True))
        self._serving[-1].start()

    def _serve(self, process: subprocess.Popen[bytes]) -> None:
        """Hand one call after the other to a process, until there is none or it is gone."""
        assert process.stdin is not None  # noqa: S101
        assert process.stdout is not None  # noqa: S101
        while (given := self._waiting.get()) is not None:
            name, call, future = given
            try:
                process.stdin.write(call)
                process.stdin.flush()
                done, result = pickle.load(process.stdout)
            except (OSError, EOFError, pickle.PickleError, *UNREADABLE) as error:
                gone = not isinstance(error, UNREADABLE)
                future.set_exception(
                    SymheliError(
                        f"a process that computed {name} has ended ({error!r}): memory may have run"
                        " out; finished results are kept"
                        if gone
                        else f"what {name} answered cannot be read here: {error!r}"
                    )
                )
                process.kill()
                if not self._leaving:
                    self._start()  # the others go on
                break
            if done:
                future.set_result(result)
            else:
                future.set_exception(result)
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()


class _Here(Future[Any]):
    """What the caller computes himself when he asks."""

    def __init__(self, call: Call):
        super().__init__()
        self._call = call

    def result(self, timeout: float | None = None) -> Any:
        if not self.done():
            self.set_result(self._call())
        return super().result(timeout)


def _name(call: Call) -> str:
    return getattr(getattr(call, "func", call), "__name__", "a call")
