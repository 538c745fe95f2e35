"""Where a linear model was taken."""

from __future__ import annotations

import math
from dataclasses import dataclass

from symheli.errors import InputError
from symheli.values.named_vector import NamedVector
from symheli.values.summary import summarized


@dataclass(frozen=True)
class OperatingPoint:
    """States `x`, inputs `u` and state derivatives `xdot` (zero at an equilibrium) at a scheduling
    value.

    `x` and `u` are named vectors with units; `airspeed` in m/s. Raises `InputError` for an airspeed
    that is not finite.
    """

    x: NamedVector
    u: NamedVector
    xdot: NamedVector
    airspeed: float

    __repr__ = summarized

    def __post_init__(self) -> None:
        if not math.isfinite(self.airspeed):
            raise InputError(f"airspeed: expected a finite number of m/s, got {self.airspeed}")
