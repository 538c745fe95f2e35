"""Formats of flight logs: what a format is, which are known, and which one a file has."""

from __future__ import annotations

import importlib
import os
import pkgutil
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from symheli.errors import InputError, UnknownNameError
from symheli.logs.files import Table, existing
from symheli.values.named_subclasses import named_subclasses

if TYPE_CHECKING:
    from symheli.logs.column import Column
    from symheli.logs.meaning import Named
    from symheli.logs.signal_map import SignalMap

LOOKED_AT = 4096
"""Bytes that decide."""

PARAMETER = re.compile(rb"[A-Z][A-Z0-9_]{1,15}(,| +|\t)-?[0-9.]+(e[+-]?\d+)?\s*")
"""A line of a file of parameters: ArduPilot's name and value."""


@dataclass(frozen=True, eq=False)
class Contents:
    """Every column of numbers of a log ("mapped": the signals of a map) by its name; `step` is an
    estimate of the sample period (s) where the log has no clock but gives itself away, else None.
    """

    format: str
    columns: Mapping[str, Column]
    step: float | None = None


class LogFormat(ABC):
    """A format of flight logs: how a file is recognised, what it holds, how a map reads it.

    A subclass is known by its name as soon as it is defined. One of the package stands beside its
    reader in `symheli.logs`.

    Attributes
    ----------
    name : str
        Names it in signal maps and on the command line.
    begins : bytes
        The first bytes of every file; where these do not decide, `recognises` is overridden. A
        format with neither is read where it is named.
    own_clocks : bool
        Every topic, message or kind of frame has its own rate; a map with a step dt reads it.
    time_column : bool
        A column, which the user names, holds the time; a step dt resamples.
    own_names : bool
        The log has signals, not columns: all are read, under their names and in their units.
    any_text : bool
        Nothing marks it: it is asked last, and takes what no other format recognises.
    guessed : mapping
        Columns that a survey guesses signals from, with their units, the best first.
    """

    name: ClassVar[str]
    begins: ClassVar[bytes] = b""
    own_clocks: ClassVar[bool] = False
    time_column: ClassVar[bool] = False
    own_names: ClassVar[bool] = False
    any_text: ClassVar[bool] = False
    guessed: ClassVar[Named] = {}

    def recognises(self, head: bytes) -> bool:
        """Whether a file with these first `LOOKED_AT` bytes is of this format: as it `begins`."""
        return bool(self.begins) and head.startswith(self.begins)

    @staticmethod
    @abstractmethod
    def columns(path: str | os.PathLike[str]) -> Mapping[str, Column]:
        """Return every column of numbers; raise `InputError` for a file that is no such log."""

    @abstractmethod
    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Return the time (s), the columns that `by.given` names, and the unit of each."""

    def declared(self, path: str | os.PathLike[str]) -> Mapping[str, str | None]:
        """Return the columns of a table with the units that its head declares; none by default."""
        return {}

    def contents(self, path: str | os.PathLike[str]) -> Contents:
        """Return its columns, and its sample period where the log has no clock but shows it."""
        return Contents(self.name, self.columns(path))

    def named(self, columns: Mapping[str, Column]) -> Named:
        """Return the columns that signals are guessed from; {}: those with usual names."""
        return self.guessed


def known_formats() -> dict[str, LogFormat]:
    """Return every format by its name: those of this package, then those defined elsewhere."""
    folder = str(Path(__file__).parent)
    for module in pkgutil.iter_modules([folder]):
        importlib.import_module(f"{__package__}.{module.name}")
    made: dict[str, Callable[[], LogFormat]] = {
        **named_subclasses(LogFormat, "name", "symheli.formats")
    }
    return {name: form() for name, form in made.items()}


def format_named(name: str) -> LogFormat:
    """Return a format by its name; raise `UnknownNameError` for one that is not known."""
    known = known_formats()
    if name not in known:
        raise UnknownNameError("format", name, tuple(known))
    return known[name]


def format_of(path: str | os.PathLike[str]) -> str:
    """Return the name of the format that recognises a file by its first bytes, not by its name.

    Raises `InputError` for a file that is not there, is empty, or holds the parameters of an
    autopilot.
    """
    with existing(path).open("rb") as file:
        head = file.read(LOOKED_AT)
    forms = sorted(known_formats().values(), key=lambda form: form.any_text)
    found = next(form for form in forms if form.any_text or form.recognises(head))
    lines = head.splitlines()[:20]
    if found.any_text and sum(PARAMETER.fullmatch(line) is not None for line in lines) > 10:
        raise InputError(
            f"{path}: these are parameters of an autopilot, not a log; give the log, which holds"
            " them too"
        )
    return found.name


def contents_of(path: str | os.PathLike[str], format: str | None = None) -> Contents:
    """Return the content of a log of this format (default: recognised by its first bytes).

    Raises `InputError` for a file that is no such log.
    """
    return format_named(format or format_of(path)).contents(path)


def own_clocks(name: str) -> bool:
    """Whether this is a format whose columns have clocks of their own."""
    known = known_formats()
    return name in known and known[name].own_clocks
