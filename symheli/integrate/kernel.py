"""Arguments of a C kernel: a structure made from NumPy arrays and numbers."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np


def structure(arguments: dict[str, Any]) -> ctypes.Structure:
    """A C structure with these members in order: arrays and None as pointers, int as long, float as
    double.

    The arrays must be contiguous; the structure keeps them alive.
    """
    fields: list[tuple[str, Any]] = []
    for name, value in arguments.items():
        pointer = value is None or isinstance(value, np.ndarray)
        assert not isinstance(value, np.ndarray) or value.flags.c_contiguous, name  # noqa: S101
        fields.append(
            (
                name,
                (
                    ctypes.c_void_p
                    if pointer
                    else ctypes.c_double
                    if isinstance(value, float)
                    else ctypes.c_long
                ),
            )
        )
    made = type("Arguments", (ctypes.Structure,), {"_fields_": fields})()
    for name, value in arguments.items():
        setattr(made, name, value.ctypes.data if isinstance(value, np.ndarray) else value)
    made.kept = arguments
    return made
