"""Numbers of 32 bits, checked when they are made."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen

NUMBER = np.float32
MAX_NUMBER = np.finfo(NUMBER).max


def rounded(given: object, name: str, shape: Sequence[int | None]) -> Array:
    """A read-only float32 copy; raises `InputError` where that cannot hold a number."""
    exact = frozen(given, name, shape)
    with np.errstate(over="ignore"):
        out = exact.astype(NUMBER)
    if not np.isfinite(out).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(out))[0])
        raise InputError(
            f"{name}: entry {where} is {exact[where]:g}, beyond the largest number of 32 bits"
            " (3.4e38): scale the states or the signals"
        )
    out.flags.writeable = False
    return out


def increasing(given: object, name: str) -> Array:
    """Two numbers or more, as `rounded`; raises `InputError` unless they increase."""
    out = rounded(given, name, (None,))
    if len(out) < 2 or (np.diff(out) <= 0).any():
        raise InputError(
            f"{name}: expected two values or more that increase, in 32 bits too, got"
            f" {np.asarray(given).tolist()!r:.80}"
        )
    return out


def inward(value: float, towards: float) -> np.float32:
    """The next number in this direction, the largest of them for infinity."""
    number = NUMBER(np.clip(value, -float(MAX_NUMBER), float(MAX_NUMBER)))
    beyond = float(number) < value if towards > 0 else float(number) > value
    return np.nextafter(number, NUMBER(towards)) if beyond and math.isfinite(value) else number


def checked_numbers(name: str, given: ArrayLike, count: int) -> Array:
    """`count` numbers, finite or not; raises `InputError` for another number of them."""
    out = np.asarray(given, NUMBER)
    if out.shape != (count,):
        raise InputError(f"{name}: expected {count} numbers, got shape {out.shape}")
    return out
