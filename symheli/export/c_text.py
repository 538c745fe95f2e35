"""Numbers, tables and names as C99 text."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.signal import Signal

WIDTH = 100


def require_identifier(name: str) -> None:
    """Raises `InputError` for a name that is no C identifier."""
    if not re.fullmatch(r"[a-zA-Z]\w*", name):
        raise InputError(f"name: expected a C identifier such as estimator, got {name!r}")


def identifier(text: str) -> str:
    """A regressor's or signal's name as part of a macro."""
    return re.sub(r"\W+", "_", text.replace("k-", "")).strip("_")


def literals(values: Iterable[float], dtype: type[np.floating]) -> list[str]:
    """Exact in that precision."""
    suffix = "f" if dtype is np.float32 else ""
    return ["NAN" if np.isnan(v) else float(dtype(v)).hex() + suffix for v in values]


def table(kind: str, name: str, values: Iterable[object]) -> str:
    """A constant array, of numbers or of structures."""
    return f"static const {kind} {name}[] = {{\n{_wrapped(map(str, values), '    ')}\n}};"


def rows(
    kind: str, name: str, size: str, values: Array, dtype: type[np.floating] = np.float64
) -> str:
    """A constant array of the rows of `values`, each as long as `size` says."""
    inside = ",\n".join(
        f"    {{{_wrapped(literals(row, dtype), '     ').lstrip()}}}" for row in values
    )
    return f"static const {kind} {name}[{len(values)}][{size}] = {{\n{inside}\n}};"


def define(name: str, value: object, comment: str = "") -> str:
    """A macro, with what it is."""
    return f"#define {name} {value}" + (f" /* {comment} */" if comment else "")


def in_comment(text: str) -> str:
    """Return user text for a C comment: on one line, and without the end of a comment."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")


def index_macros(prefix: str, names: Sequence[Signal], notes: Sequence[str] = ()) -> list[str]:
    """Return the index of every signal as a macro, with its unit and the corresponding one of
    `notes`.
    """
    return [
        define(f"{prefix}{identifier(s)}", i, in_comment(f"{s.unit}, {note}" if note else s.unit))
        for i, (s, note) in enumerate(zip(names, notes or [""] * len(names), strict=True))
    ]


def blocks(*lines: Sequence[str]) -> str:
    """Blocks of lines, an empty line between two of them; empty blocks are left out."""
    return "\n\n".join("\n".join(block) for block in lines if block)


def check_data(
    constants: Mapping[str, object],
    kind: str,
    dtype: type[np.floating],
    **tables: tuple[str, Array],
) -> str:
    """Macros for the `constants` and constant arrays of `kind` for the `tables`, by name: (length
    of a row as C writes it, rows).
    """
    return "\n".join(
        [
            *(define(name, value) for name, value in constants.items()),
            *(rows(kind, name, size, values, dtype) for name, (size, values) in tables.items()),
        ]
    )


def _wrapped(words: Iterable[str], indent: str) -> str:
    """With commas between the words, in lines that keep each word whole; room is left for what
    closes the last.
    """
    lines = textwrap.wrap(
        ", ".join(word.replace(" ", "\0") for word in words),
        WIDTH - 3,
        initial_indent=indent,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines).replace("\0", " ")
