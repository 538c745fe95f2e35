"""A process that computes one call after the other."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from types import TracebackType
from typing import Any

from symheli.errors import SymheliError
from symheli.threads import BLAS

CHILD = (
    "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer);"
    " from symheli.worker import serve; serve()"
)


class ProcessEndedError(SymheliError):
    """The process of a worker has ended without an answer."""


class Worker:
    """A process that computes calls of functions of modules, with one thread of BLAS where the
    environment does not say how many.

    It imports nothing of the script that started it, hears no Ctrl-C, prints to standard error, and
    ends with the process that started it.
    """

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the process that started it
        )
        self._head = pickle.dumps(sys.path)

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()  # type: ignore[union-attr]

    def __call__(self, call: bytes) -> Any:
        """The result of a pickled `functools.partial`; what it raises is raised here.

        Raises `ProcessEndedError` where the process ends before it answers, and `SymheliError` for
        an answer that cannot be read in this process.
        """
        to, back = self._process.stdin, self._process.stdout
        assert to is not None  # noqa: S101
        assert back is not None  # noqa: S101
        try:
            to.write(self._head + pickle.dumps(call))
            to.flush()
            self._head = b""
            answer = pickle.load(back)
        except (OSError, EOFError, ValueError, pickle.UnpicklingError):
            code = self._process.wait()
            raise ProcessEndedError(
                f"a process that computed {_name(call)} has ended with code {code} and no answer;"
                " it may have run out of memory"
            ) from None
        try:
            value, error = pickle.loads(answer)
        except Exception as error:
            raise SymheliError(
                f"what {_name(call)} answered cannot be read here: {error!r}"
            ) from error
        if error is not None:
            raise error
        return value

    def kill(self) -> None:
        """End the process at once, in the middle of what it computes."""
        self._process.kill()


def pickled(function: Callable[..., Any], *arguments: Any, **keywords: Any) -> bytes:
    """A call as a `Worker` takes it."""
    return pickle.dumps(partial(function, *arguments, **keywords))


def serve() -> None:
    """The other end of a `Worker`: answer calls until there is nothing more to read."""
    for variable in BLAS:  # before NumPy is imported
        os.environ.setdefault(variable, "1")
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # what a call prints is no answer
        while True:
            try:
                call = pickle.load(sys.stdin.buffer)
            except EOFError:
                return
            try:
                answer = pickle.dumps((pickle.loads(call)(), None))
            except Exception as error:
                answer = _failed(error)
            pickle.dump(answer, answers)
            answers.flush()


def _failed(error: Exception) -> bytes:
    try:
        return pickle.dumps((None, error))
    except Exception:
        return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))


def _name(call: bytes) -> str:
    return getattr(pickle.loads(call).func, "__name__", "a call")


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
