"""Facts of a helicopter that the equations in print and in SymPy need."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, Protocol

from symheli.airframe.vehicle import Vehicle
from symheli.dynamics import Dynamics
from symheli.values.named_vector import NamedVector
from symheli.values.signal import Signal


class Described(Protocol):
    """A helicopter with its vehicle, its equations and its signals: `symheli.Helicopter`."""

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle: sections, quantities, components."""
        ...

    @property
    def governor(self) -> str:
        """Kind of the governor of the rotor speed."""
        ...

    @property
    def printed(self) -> frozenset[str]:
        """Names of the equations that are taken as they were printed."""
        ...

    @property
    def smoothing(self) -> float:
        """Width of smoothed kinks, m/s."""
        ...

    @cached_property
    def dynamics(self) -> Dynamics:
        """The equations of motion, with every parameter an input."""
        ...

    @cached_property
    def parameters(self) -> NamedVector:
        """Every number of the model by name, in SI."""
        ...

    @cached_property
    def states(self) -> tuple[Signal, ...]:
        """States of the Euler form."""
        ...

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """Inputs, rad."""
        ...

    @property
    def wind(self) -> tuple[Signal, ...]:
        """Wind in body axes, m/s."""
        ...

    def with_inflow(
        self,
        x: Any,
        u: Any,
        wind: Any,
        unknown: Callable[[], Any],
        par: Sequence[Any] | None = None,
    ) -> tuple[Any, Any]:
        """Return xdot and the residuals of the inflow, one `unknown` a rotor."""
        ...
