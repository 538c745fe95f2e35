"""Recognition of the format of a log by its first bytes, not by its name."""

from __future__ import annotations

import os
import re
from typing import Literal, get_args

from symheli.errors import InputError
from symheli.logs.files import existing

Format = Literal["xplane", "csv", "mat", "ulog", "dataflash", "blackbox"]
FORMATS: tuple[Format, ...] = get_args(Format)

OWN_CLOCKS = ("ulog", "dataflash", "blackbox")
"""Formats in which every topic, message or kind of frame has its own rate, read by a map."""

LOOKED_AT = 4096
"""Bytes that decide."""

BLACKBOX = b"H Product:Blackbox"
"""At the beginning of each log of a Blackbox file."""

HDF5 = b"\x89HDF\r\n\x1a\n"
"""At the beginning, or behind the 512 bytes that MATLAB writes about itself."""


PARAMETER = re.compile(rb"[A-Z][A-Z0-9_]{1,15}(,| +|\t)-?[0-9.]+(e[+-]?\d+)?\s*")
"""A line of a file of parameters: ArduPilot's name and value."""


def format_of(path: str | os.PathLike[str]) -> Format:
    """A MATLAB file, a PX4 ULog, an ArduPilot DataFlash log (binary or text), a Blackbox log, an
    X-Plane log ("name,unit |" in its first line), else a table.

    Raises `InputError` for a file that is not there, is empty, or holds the parameters of an
    autopilot.
    """
    with existing(path).open("rb") as file:
        head = file.read(LOOKED_AT)
    if head.startswith(b"MATLAB") or _has_hdf5(head):
        return "mat"
    if head.startswith(b"ULog"):
        return "ulog"
    if head.startswith(b"\xa3\x95") or re.search(rb"^FMT, ?\d+, ?\d+, ?\w+,", head, re.MULTILINE):
        return "dataflash"
    if BLACKBOX in head:
        return "blackbox"
    if sum(PARAMETER.fullmatch(line) is not None for line in head.splitlines()[:20]) > 10:
        raise InputError(
            f"{path}: these are parameters of an autopilot, not a log; give the log, which holds"
            " them too"
        )
    first = next((line for line in head.splitlines() if line.strip()), b"")
    return "xplane" if b"|" in first and b"," in first.split(b"|")[0] else "csv"


def is_hdf5(path: str | os.PathLike[str]) -> bool:
    """Whether a MATLAB file is one of -v7.3."""
    with existing(path).open("rb") as file:
        return _has_hdf5(file.read(LOOKED_AT))


def _has_hdf5(head: bytes) -> bool:
    return head.startswith(HDF5) or head[512:].startswith(HDF5)
