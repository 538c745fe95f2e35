"""Opening a log: whether it is there, and whether it is text."""

from __future__ import annotations

import contextlib
import io
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from symheli.errors import DataWarning, InputError, UnknownNameError
from symheli.values.units import to_si

MAX_BYTES = 256 * 2**20
"""Largest log that is read: in memory it takes up to about twenty times as much."""

Table = tuple[np.ndarray, dict[str, np.ndarray], dict[str, str]]
"""time (n,) in s, columns by name, unit of each column."""


def existing(path: str | os.PathLike[str]) -> Path:
    """Return the path of a file that exists and is not empty; raise `InputError` otherwise."""
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file}: there is no such file")
    if file.stat().st_size == 0:
        raise InputError(f"{file}: the file is empty")
    return file


def bounded(path: str | os.PathLike[str], most: int = MAX_BYTES) -> Path:
    """Return the path of an existing file of at most `most` bytes; raise `InputError` otherwise."""
    file = existing(path)
    if (size := file.stat().st_size) > most:
        raise InputError(
            f"{file}: {size / 2**20:.0f} MiB; at most {most / 2**20:.0f} MiB of such a log are"
            " read, so that it fits in memory: log fewer messages, or cut the log to the flight"
        )
    return file


def text(path: str | os.PathLike[str]) -> str:
    """The content of a text file; raises `InputError` for a binary one."""
    file = bounded(path)
    data = file.read_bytes()
    if b"\0" in data:
        raise InputError(
            f"{file}: expected a text file, this one is binary (it contains zero bytes)"
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


@contextlib.contextmanager
def quiet() -> Iterator[io.StringIO]:
    """Capture what a third-party reader prints."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        yield output


def error_text(error: Exception) -> str:
    """Return the text of an error, or its name where it has none."""
    return str(error) or type(error).__name__


def warn_of_damage(path: object) -> None:
    """Warn (`DataWarning`) that parts of the log could not be read."""
    warnings.warn(
        f"{path}: parts of the log are damaged and were left out; look for gaps before believing a"
        " fit, or copy it from the aircraft once more",
        DataWarning,
        stacklevel=2,
    )


def positive(dt: float, name: str = "dt") -> float:
    """A sample period in s; raises `InputError` unless finite and positive."""
    if not (np.isfinite(dt) and dt > 0):
        raise InputError(f"{name} must be a positive number of seconds, got {dt}")
    return float(dt)


def units_of(fields: Mapping[str, str], units: Mapping[str, str] | None) -> Mapping[str, str]:
    """Return the units that are declared of signals; raise `UnknownNameError` for one of a signal
    that is not among the `fields`.
    """
    for name in units or {}:
        if name not in fields:
            raise UnknownNameError("signal in units", name, fields)
    return units or {}


def seconds_in(time_unit: str) -> float:
    """Seconds in one `time_unit`; raises `InputError` for a unit that is no time."""
    factor, unit = to_si(time_unit)
    if unit != "s":
        raise InputError(f"time_unit must be a time such as 's', 'ms' or 'us', got {time_unit!r}")
    return factor
