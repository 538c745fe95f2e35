"""Calls side by side, each in a process of its own."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any

from symheli.errors import InputError
from symheli.integrate.side_by_side import workers_of
from symheli.worker import ProcessEndedError, Worker, pickled


class Processes(ThreadPoolExecutor):
    """An executor of `count` processes (default: one a core), each a `Worker`.

    A process that ends under its call fails that call alone: another takes its place. Leaving the
    `with` block by an exception, Ctrl-C too, ends all processes at once.
    """

    def __init__(self, count: int | None = None):
        super().__init__(workers_of(count), thread_name_prefix="process")
        self._own = threading.local()
        self._lock = threading.Lock()
        self._workers: list[Worker] = []
        self._leaving = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """A result to come; `InputError` for what cannot be sent to another process."""
        try:
            call = pickled(fn, *args, **kwargs)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise InputError(
                f"a call cannot be sent to another process ({error}): define its function in a"
                " module, or use one worker"
            ) from error
        return super().submit(self._computed, call)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is not None:
            self.end()
        self.shutdown()
        for worker in self._workers:
            worker.__exit__(None, None, None)

    def end(self) -> None:
        """End all processes at once; calls that are under way fail."""
        self.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            self._leaving = True
            for worker in self._workers:
                worker.kill()

    def _computed(self, call: bytes) -> Any:
        """The result, by the process of this thread."""
        if getattr(self._own, "worker", None) is None:
            with self._lock:
                if self._leaving:
                    raise ProcessEndedError("the processes have been ended")
                self._own.worker = Worker()
                self._workers.append(self._own.worker)
        try:
            return self._own.worker(call)
        except ProcessEndedError:
            self._own.worker = None
            raise
