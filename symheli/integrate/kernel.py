"""Arguments of a C kernel: a structure made from NumPy arrays and numbers."""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import numpy as np


def structure(arguments: dict[str, Any]) -> ctypes.Structure:
    """A C structure with these members in order: arrays and None as pointers, int as long, float as
    double.

    The arrays must be contiguous; the structure keeps them alive.
    """
    for name, value in arguments.items():
        assert not isinstance(value, np.ndarray) or value.flags.c_contiguous, name  # noqa: S101
    made = _type(tuple((name, _member(value)) for name, value in arguments.items()))()
    for name, value in arguments.items():
        setattr(made, name, value.ctypes.data if isinstance(value, np.ndarray) else value)
    made.kept = arguments
    return made


def _member(value: Any) -> Any:
    if value is None or isinstance(value, np.ndarray):
        return ctypes.c_void_p
    return ctypes.c_double if isinstance(value, float) else ctypes.c_long


@functools.cache
def _type(fields: tuple[tuple[str, Any], ...]) -> Any:
    """Made once for each list of members: making a type takes longer than a second of flight."""
    return type("Arguments", (ctypes.Structure,), {"_fields_": list(fields)})
