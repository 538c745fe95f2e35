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
    members, values = [], []
    for name, value in arguments.items():
        kind = ctypes.c_void_p
        if isinstance(value, np.ndarray):
            assert value.flags.c_contiguous, name  # noqa: S101
            value = value.__array_interface__["data"][0]
        elif value is not None:
            kind = ctypes.c_double if isinstance(value, float) else ctypes.c_long
        members.append((name, kind))
        values.append(value)
    made = _type(tuple(members))(*values)
    made.kept = arguments
    return made


@functools.cache
def _type(members: tuple[tuple[str, Any], ...]) -> Any:
    """Made once for each list of members: making a type takes as long as a second of flight."""
    return type("Arguments", (ctypes.Structure,), {"_fields_": list(members)})
