"""A plan as JSON, for reading and for comparing two plans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def described(value: Any) -> Any:
    """Return numbers, words, arrays, mappings and dataclasses as JSON, anything else by its type
    and content.
    """
    if value is None or isinstance(value, bool | int | str):
        return str(value) if isinstance(value, str) else value
    if isinstance(value, float | np.number):
        return float(value) if np.isfinite(value) else str(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): described(one) for key, one in value.items()}
    if isinstance(value, tuple | list | frozenset | set):
        return [described(one) for one in value]
    kind = {"type": f"{type(value).__module__}.{type(value).__qualname__}"}
    if is_dataclass(value):
        return kind | {
            f.name: described(getattr(value, f.name)) for f in fields(value) if f.name != "_"
        }
    held = {k: v for k, v in getattr(value, "__dict__", {}).items() if not k.startswith("_")}
    return kind | {name: described(one) for name, one in held.items() if not callable(one)}
