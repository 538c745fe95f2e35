"""What an answer to a changed call must be: the same type as before with every number said, or a
`SymheliError`; nothing that was given is changed.

Only a value of another Python type (a text or a tuple for a number, None for a model) may Python or
NumPy refuse themselves, with an exception of `BY_PYTHON`; and a size beyond the memory with
MemoryError.
"""

from __future__ import annotations

import dataclasses
import math
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from altered_values import ANOTHER, Refused

from symheli import errors
from symheli.errors import SymheliError

SECONDS = 20.0
"""Processor time that none of the calls may take; the good ones take less than two."""

BY_PYTHON = (TypeError, AttributeError, ValueError, LookupError, OverflowError)
DOCUMENTED = tuple(
    kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, Warning)
)


class Verdict(NamedTuple):
    """`outcome` is a word of docs/checks.md, `fault` what is wrong with it, or empty."""

    outcome: str
    fault: str = ""


class NotANumber(NamedTuple):
    """A number or an array that is or holds NaN: where it is in a result, and what it is a part of,
    the result itself first.
    """

    where: str
    value: Any
    owners: tuple[Any, ...]

    @property
    def field(self) -> str:
        """Class and field that hold it, such as "Certificate.alpha"; empty where none does."""
        name = self.where.rpartition(".")[2]
        owner = self.owners[-1] if self.owners else None
        return f"{type(owner).__name__}.{name}" if hasattr(owner, name) else ""


class TooLong(BaseException):
    """Above every `except Exception`."""


def judged(
    call: Callable[[], Any],
    kind: str,
    given: Any = (),
    types: tuple[type, ...] = (),
    seconds: float = SECONDS,
    meant: Callable[[NotANumber], bool] = lambda _: False,
) -> Verdict:
    """The verdict on one call with a value changed in the way of `kind`; `types` are those that
    its result may have (none: any), `meant` says where NaN is an answer.
    """
    before = {id(a): (a, a.tobytes()) for a in _arrays(given)}
    told: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as told, _at_most(seconds):
            warnings.simplefilter("always")
            result = call()
    except Refused as refused:
        verdict = _refused(refused.error)
    except SymheliError as error:
        verdict = _refused(error)
    except TooLong:
        verdict = Verdict("too long", f"no answer within {seconds:g} s")
    except MemoryError:
        verdict = Verdict("refused by Python")
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic in a library of Rust is no Exception
        python = kind == ANOTHER and isinstance(error, BY_PYTHON)
        verdict = (
            Verdict("refused by Python")
            if python
            else Verdict("another exception", f"{type(error).__name__}: {error}")
        )
    else:
        said = kind == ANOTHER or any(issubclass(w.category, DOCUMENTED) for w in told)
        verdict = _of(result, types, (lambda _: True) if said else meant)
    changed = [a for a, was in before.values() if a.tobytes() != was]
    return Verdict(verdict.outcome, "an argument was changed") if changed else verdict


def _refused(error: SymheliError) -> Verdict:
    return Verdict("refused", "" if str(error).strip() else "an error without a word")


def _of(result: Any, types: tuple[type, ...], meant: Callable[[NotANumber], bool]) -> Verdict:
    if types and not isinstance(result, types):
        return Verdict("result", f"a {type(result).__name__} and no {types[0].__name__}")
    silent = [found.where for found in not_a_number(result) if not meant(found)]
    where = " and ".join(f"the result{place}" for place in silent)
    return Verdict("result", f"NaN in {where}, and nothing says so" if silent else "")


def not_a_number(
    value: Any, where: str = "", owners: tuple[Any, ...] = (), depth: int = 6
) -> Iterator[NotANumber]:
    """Every NaN in a value, but not in its private fields."""
    if isinstance(value, float | complex | np.floating | np.complexfloating):
        if math.isnan(value.real) or math.isnan(value.imag):
            yield NotANumber(where, value, owners)
    elif isinstance(value, np.ndarray):
        if value.dtype.kind in "fc" and np.isnan(value).any():
            yield NotANumber(where, value, owners)
    elif depth:
        for name, part in _named(value):
            if not name.startswith("._"):
                yield from not_a_number(part, f"{where}{name}", (*owners, value), depth - 1)


def _named(value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        yield from ((f"[{key!r}]", value[key]) for key in value)
    elif hasattr(value, "_fields"):
        yield from ((f".{name}", getattr(value, name)) for name in value._fields)
    elif isinstance(value, list | tuple):
        yield from ((f"[{i}]", part) for i, part in enumerate(value))
    elif dataclasses.is_dataclass(value):
        yield from ((f".{f.name}", getattr(value, f.name, None)) for f in dataclasses.fields(value))


def _arrays(value: Any, depth: int = 4) -> Iterator[np.ndarray]:
    if isinstance(value, np.ndarray):
        if value.dtype.kind != "O" and value.nbytes < 100_000:
            yield value
    elif depth:
        for _, part in _named(value):
            yield from _arrays(part, depth - 1)


class _at_most:
    """Raises `TooLong` in the main thread after so many seconds."""

    def __init__(self, seconds: float):
        self.seconds = seconds

    def __enter__(self) -> None:
        self.before = signal.signal(signal.SIGPROF, self._ring)
        signal.setitimer(signal.ITIMER_PROF, self.seconds, 1.0)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, self.before)

    @staticmethod
    def _ring(*_: object) -> None:
        raise TooLong
