"""Where a linear model was taken."""

from __future__ import annotations

from dataclasses import dataclass

from symheli.values.named_vector import NamedVector
from symheli.values.summary import summarized


@dataclass(frozen=True)
class OperatingPoint:
    """States `x`, inputs `u` and state derivatives `xdot` (zero at an equilibrium) at a scheduling
    value.

    `x` and `u` are named vectors with units; `airspeed` in m/s.
    """

    x: NamedVector
    u: NamedVector
    xdot: NamedVector
    airspeed: float

    __repr__ = summarized
