"""How fast each scheduling parameter may move, in the forms a user writes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv import Scheduling

Rate = float | Sequence[float] | Mapping[str, float] | None
"""In units of p per second: one for all parameters, one for each in order, or {name: rate}; the
parameter's own where none is given.
"""


def rates(parameters: Sequence[Scheduling], rate: Rate) -> tuple[float, ...]:
    """One rate a parameter; raises `InputError` for a wrong number of them or one that is not >= 0,
    `UnknownNameError` for a name.
    """
    names = [s.name for s in parameters]
    found: list[Any]
    if rate is None:
        found = [s.limit for s in parameters]
    elif isinstance(rate, Mapping):
        for name in rate:
            if name not in names:
                raise UnknownNameError("scheduling parameter", name, names)
        found = [rate[s.name] if s.name in rate else s.limit for s in parameters]
    else:
        found = (
            list(rate)
            if isinstance(rate, Sequence | np.ndarray) and not isinstance(rate, str)
            else [rate] * len(names)
        )
    try:
        numbers = tuple(float(value) for value in found)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != len(names) or not all(value >= 0 for value in numbers):
        units = ", ".join(f"{s.name} ({s.unit}/s)" for s in parameters)
        raise InputError(
            "rate must be >= 0 (math.inf: as fast as it likes), one for all, one for each of"
            f" {units}, or by name, got {rate!r}"
        )
    return numbers
