"""Operating point of a linear model."""

from __future__ import annotations

import math
from dataclasses import dataclass

from symheli.errors import InputError
from symheli.values.named_vector import NamedVector
from symheli.values.summary import summarized


@dataclass(frozen=True)
class OperatingPoint:
    """States `x`, inputs `u` and state derivatives `xdot` (zero at an equilibrium) of a model; the
    family holds the values of its scheduling parameters.

    `x`, `u` and `xdot` are named vectors with units; `airspeed` in m/s, None where the point is of
    nothing that flies or its airspeed is not known. Raises `InputError` for an airspeed that is not
    finite.

    Examples
    --------
    >>> from symheli.values import NamedVector, OperatingPoint, signals
    >>> alpha, fin = signals(["alpha"], {"alpha": "rad"}), signals(["fin"], {"fin": "rad"})
    >>> at = {0.5: 0.10, 0.7: 0.05, 0.9: 0.02}  # trims of a missile, by its Mach number
    >>> models = [
    ...     symheli.LinearModel([[-mach]], [[-0.2]], [[1.0]], [[0.0]], alpha, fin, alpha,
    ...                         point=OperatingPoint(NamedVector(alpha, [angle]),
    ...                                              NamedVector(fin, [-angle / 2]),
    ...                                              NamedVector(alpha, [0.0])))
    ...     for mach, angle in at.items()]
    >>> family = symheli.LinearFamily.from_models(
    ...     list(at), models, parameter=symheli.values.Signal("Mach", "1"))
    >>> lpv = family.interpolate("polynomial", degree=1)
    >>> print(lpv.trim.state(0.8).round(3), lpv.trim.input(0.8).round(4), lpv.scheduling.name)
    [0.035] [-0.0175] Mach
    """

    x: NamedVector
    u: NamedVector
    xdot: NamedVector
    airspeed: float | None = None

    __repr__ = summarized

    def __post_init__(self) -> None:
        if self.airspeed is not None and not math.isfinite(self.airspeed):
            raise InputError(f"airspeed: expected a finite number of m/s, got {self.airspeed}")
