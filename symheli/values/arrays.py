"""Arrays that are checked when they come in and cannot change afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symheli.errors import InputError

Array = np.ndarray


def frozen(
    value: Any, name: str, shape: Sequence[int | None] | None = None, *, finite: bool = True
) -> Array:
    """A read-only float64 copy of `value`.

    `shape` gives the expected length of each axis, None for "any". Raises `InputError` with the
    expected and the received shape, or with the index of the first entry that is not finite.
    """
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected numbers, got {value!r:.80}") from error
    if shape is not None and (
        array.ndim != len(shape)
        or any(
            want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
        )
    ):
        want = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        raise InputError(f"{name}: expected shape {want}, got {array.shape}")
    if finite and not np.all(np.isfinite(array)):
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"{name}: entry {where} is {array[where]}; every entry must be a finite number"
        )
    array.flags.writeable = False
    return array
