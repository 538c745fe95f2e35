"""Solvers that give up in another language."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from symheli.errors import SolverError


@contextmanager
def no_panic() -> Iterator[None]:
    """A panic of a solver written in Rust, which is no `Exception` and passes every `except
    Exception`, becomes `SolverError`.
    """
    try:
        yield
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise SolverError(f"the solver broke down: {error}") from error
