"""Values in a few lines: what they are called, their shapes, names and units; the numbers stay
inside.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from html import escape
from itertools import groupby
from typing import Any

import numpy as np

from symheli.values.named_vector import NamedVector
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
    if _has_words(self):
        return str(self)
    rows = ", ".join(f"{name}={text}" for name, text in _rows(self))
    return textwrap.fill(
        f"{type(self).__name__}({rows})",
        LINE,
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def as_table(self: Any) -> str:
    """The `_repr_html_` of such a value: what its `__repr__` says as a table."""
    if _has_words(self):
        return _html(str(self))
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(text)}</td></tr>'
        for name, text in _rows(self)
    )
    title = escape(type(self).__name__)
    return f'<table><caption style="text-align:left">{title}</caption><tbody>{rows}</tbody></table>'


def _has_words(value: Any) -> bool:
    """Whether the class says itself what `print` shows."""
    return type(value).__str__ is not object.__str__


def _html(text: str) -> str:
    """Return lines of text as rows of a table: where lines have two spaces in a row, a cell for
    each column of characters, a head of one line with those below it; other lines over its whole
    width.
    """
    lines = text.splitlines()
    blocks = [list(group) for _, group in groupby(lines, lambda line: "  " in line.strip())]
    wide = [block if "  " in block[0].strip() else [] for block in blocks]
    columns = [
        _columns([*block, *following]) if block and len(block) == 1 else _columns(block)
        for block, following in zip(wide, [*wide[2:], [], []], strict=False)
    ]
    width = max(map(len, columns), default=0) or 1
    rows = []
    for block, ends in zip(blocks, columns, strict=True):
        for line in block:
            cells = [line[a:b].strip() for a, b in ends] or [line.strip()]
            span = f' colspan="{width}"' if not ends else ""
            rows.append(
                "".join(
                    f'<td{span} style="text-align:{_side(cell)}">{escape(cell)}</td>'
                    for cell in cells
                )
            )
    return f"<table><tbody>{''.join(f'<tr>{row}</tr>' for row in rows)}</tbody></table>"


def _columns(block: list[str]) -> list[tuple[int, int]]:
    """Return (start, end) of the columns between which every line is blank."""
    wide = max(map(len, block), default=0)
    used = [any(line[k : k + 1].strip() for line in block) for k in range(wide)]
    starts = [k for k in range(wide) if used[k] and (k == 0 or not used[k - 1])]
    return list(zip(starts, [*starts[1:], wide], strict=False))


def _side(cell: str) -> str:
    return "right" if cell[:1].isdigit() or cell[:2].strip("-").isdigit() else "left"


def _rows(value: Any) -> Iterator[tuple[str, str]]:
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
    match value:
        case Signal():
            return _named(value)
        case float() | np.floating():
            return f"{value:.6g}"
        case Enum():
            return value.name
        case np.ndarray():
            return _array(value)
        case NamedVector():
            return _clipped(repr(value))
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
