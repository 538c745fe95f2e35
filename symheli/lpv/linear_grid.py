"""Linear models over airspeed and one more quantity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv.linear_family import LinearFamily
from symheli.lpv.linear_model import LinearModel
from symheli.values.arrays import Array, frozen
from symheli.values.operating_point import OperatingPoint
from symheli.values.signal import Signal


@dataclass(frozen=True, eq=False)
class LinearGrid:
    """Models at n1 airspeeds (m/s) and n2 `values` of `axis` (a `Signal` with its unit), both
    increasing.

    families: one `LinearFamily` over the same airspeeds a value. A is (n1, n2, nx, nx), B (n1, n2,
    nx, nu), C and D alike.
    """

    axis: Signal
    values: Array
    families: tuple[LinearFamily, ...]

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "values", frozen(self.values, str(self.axis), (len(self.families),))
        )
        if len(self.values) == 0 or np.any(np.diff(self.values) <= 0):
            raise InputError(f"{self.axis}: expected increasing values, got {self.values.tolist()}")
        first = self.families[0]
        for family in self.families:
            same = (family.states, family.inputs, family.outputs) == (
                first.states,
                first.inputs,
                first.outputs,
            )
            if not same or not np.array_equal(family.airspeeds, first.airspeeds):
                raise InputError("a grid needs families with equal names at equal airspeeds")

    @property
    def airspeeds(self) -> Array:
        """First axis (n1,), m/s."""
        return self.families[0].airspeeds

    @property
    def states(self) -> tuple[Signal, ...]:
        """States with units."""
        return self.families[0].states

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Inputs with units."""
        return self.families[0].inputs

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """Outputs with units."""
        return self.families[0].outputs

    @property
    def A(self) -> Array:
        """(n1, n2, nx, nx)."""
        return np.stack([family.A for family in self.families], axis=1)

    @property
    def B(self) -> Array:
        """(n1, n2, nx, nu)."""
        return np.stack([family.B for family in self.families], axis=1)

    @property
    def C(self) -> Array:
        """(n1, n2, ny, nx)."""
        return np.stack([family.C for family in self.families], axis=1)

    @property
    def D(self) -> Array:
        """(n1, n2, ny, nu)."""
        return np.stack([family.D for family in self.families], axis=1)

    @property
    def trims(self) -> tuple[tuple[OperatingPoint, ...], ...]:
        """Operating points, n1 rows of n2."""
        return tuple(zip(*(family.trims for family in self.families), strict=True))

    def at(self, i: int, j: int) -> LinearModel:
        """The model at airspeed i and value j."""
        return self.families[j][i]

    def family(self, **value: float) -> LinearFamily:
        """The models over airspeed at one value of the axis, as in family(mass=8.2); it must be on
        the grid.
        """
        if list(value) != [str(self.axis)]:
            raise UnknownNameError("axis", ", ".join(value) or "(none)", [str(self.axis)])
        wanted = value[str(self.axis)]
        miss = np.abs(self.values - wanted)
        if not miss.min() <= 1e-9 * max(
            abs(wanted), np.ptp(self.values)
        ):  # the same number, rounded otherwise
            raise InputError(
                f"{self.axis} = {wanted} {self.axis.unit} is not on the grid:"
                f" {', '.join(f'{v:g}' for v in self.values)}"
            )
        return self.families[int(miss.argmin())]
