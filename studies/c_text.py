"""Numbers, tables and names as C99 text."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array


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
    """A constant array."""
    return f"static const {kind} {name}[] = {{{', '.join(map(str, values))}}};"


def rows(values: Array, dtype: type[np.floating]) -> str:
    """The inside of an array of arrays."""
    return ",\n".join("    {" + ", ".join(literals(row, dtype)) + "}" for row in values)
