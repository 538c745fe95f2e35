"""Values in a few lines: what they are called, their shapes, names and units; the numbers stay
inside.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from symheli.values.signal import Signal

LINE, WIDE = 88, 160
"""Characters a line of a summary, and of one entry in it at most."""
FEW = 4
"""So many numbers or items are shown one by one."""


def summarized(self: Any) -> str:
    """The `__repr__` of a dataclass or named tuple that holds arrays: what `print` shows of a class
    with words of its own; else each field in some words, empty ones left out; an array says its
    shape, a long list how many it holds.
    """
    if has_words(self):
        return str(self)
    shown = ", ".join(f"{name}={text}" for name, text in rows(self))
    return textwrap.fill(
        f"{type(self).__name__}({shown})",
        LINE,
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def has_words(value: Any) -> bool:
    """Whether the class says itself what `print` shows."""
    return type(value).__str__ is not object.__str__


def rows(value: Any) -> Iterator[tuple[str, str]]:
    """Yield each field that is not empty, and what it is in some words."""
    names = (
        [f.name for f in fields(value) if f.repr] if is_dataclass(value) else list(value._fields)
    )
    for name in names:
        field = getattr(value, name)
        if not _empty(field):
            yield name, _words(field)


def _empty(field: Any) -> bool:
    if isinstance(field, float):
        return math.isnan(field)
    return field is None or (isinstance(field, str | tuple | list | Mapping) and not len(field))


def _words(value: Any) -> str:
    if getattr(type(value), "short", False):
        return _clipped(repr(value))
    match value:
        case Signal():
            return _named(value)
        case float() | np.floating():
            return f"{value:.6g}"
        case Enum():
            return value.name
        case np.ndarray():
            return _array(value)
        case Mapping():
            return _clipped("{" + ", ".join(map(str, value)) + "}")
    if is_dataclass(value) or hasattr(value, "_fields"):
        return _nested(value)
    if isinstance(value, tuple | list):
        return _sequence(value)
    return _clipped(repr(value))


def _named(signal: Signal) -> str:
    return str(signal) if signal.unit == "1" else f"{signal} {signal.unit}"


def _array(values: np.ndarray) -> str:
    if values.ndim == 1 and values.dtype.kind == "f" and len(values):
        if len(values) <= FEW:
            return "[" + ", ".join(f"{v:.6g}" for v in values) + "]"
        if np.all(np.diff(values) > 0):
            return f"{len(values)} numbers from {values[0]:.6g} to {values[-1]:.6g}"
    return f"array {values.shape}"


def _nested(value: Any) -> str:
    """A value inside: itself where it is short, else its name."""
    heavy = type(value).__repr__ is summarized or any(
        isinstance(part, np.ndarray) for part in _parts(value)
    )
    text = "" if heavy else repr(value)
    return text if 0 < len(text) <= LINE else f"{type(value).__name__}(...)"


def _parts(value: Any) -> list[Any]:
    return [getattr(value, f.name) for f in fields(value)] if is_dataclass(value) else list(value)


def _sequence(values: Any) -> str:
    if all(isinstance(v, str) for v in values):
        return _clipped("(" + ", ".join(_named(Signal(v)) for v in values) + ")")
    if len(values) <= FEW:
        return _clipped("(" + ", ".join(map(_words, values)) + ")")
    kinds = {type(v).__name__ for v in values}
    return f"{len(values)} {kinds.pop() if len(kinds) == 1 else 'items'}"


def _clipped(text: str) -> str:
    return text if len(text) <= WIDE else text[: WIDE - 4] + " ..."
