"""Parameters of an ArduPilot autopilot: from a `.param` file, or from a DataFlash log."""

from __future__ import annotations

import math
import os
import re

from symheli.errors import InputError
from symheli.logs.dataflash import dataflash_parameters
from symheli.logs.files import existing

LARGEST_FILE = 10_000_000
"""Bytes above which a file is no list of parameters."""

LARGEST_COUNT = 20_000
"""Number of parameters above which a file is no list of them."""

NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
"""An ArduPilot parameter has at most 16 characters."""


def read_parameters(path: str | os.PathLike[str]) -> dict[str, float]:
    """Return {name: value} of a `.param` file, one "NAME,VALUE" or "NAME VALUE" a line, # for
    comments, or of a DataFlash log, where the last value of each parameter counts.

    Raises `InputError` for a file that holds neither, with the line that is wrong.
    """
    file = existing(path)
    with file.open("rb") as opened:
        head = opened.read(4)
    if head.startswith(b"\xa3\x95") or head == b"FMT,":
        found = {n: v for n, v in dataflash_parameters(file).items() if NAME.fullmatch(n)}
        if not found:
            raise InputError(f"{path}: the log holds no parameters; give a .param file")
        return found
    if file.stat().st_size > LARGEST_FILE:
        raise InputError(f"{path}: {file.stat().st_size} bytes are too many for a .param file")
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a .param file: {error}") from None
    found: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = re.split(r"[,\s]+", line.partition("#")[0].strip())
        if words == [""]:
            continue
        if len(words) < 2 or not NAME.fullmatch(words[0]):
            raise InputError(f"{path}, line {number}: expected NAME,VALUE, got {line!r:.60}")
        found[words[0]] = number_of(words[1], f"{path}, line {number}, {words[0]}")
        if len(found) > LARGEST_COUNT:
            raise InputError(f"{path}: more than {LARGEST_COUNT} parameters; is it a .param file?")
    if not found:
        raise InputError(f"{path}: no parameters in it; expected lines of NAME,VALUE")
    return found


def number_of(text: str, where: str) -> float:
    """The finite number in a text; `where` begins the message of the `InputError`."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {text!r:.40}")
    return value
