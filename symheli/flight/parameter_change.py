"""A change of the helicopter in flight, as where a load is taken up or dropped."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from symheli.errors import InputError
from symheli.helicopter import Helicopter
from symheli.values.arrays import Array
from symheli.values.numbers import by_name

NEVER = 2**53
"""Sample that no flight reaches."""


@dataclass(frozen=True)
class ParameterChange:
    """Parameters of the helicopter that change at an instant of a flight; references and controller
    do not know.

    Parameters
    ----------
    at : float
        Time of the flight from which they hold, s: the next sample of the controller.
    values : mapping of str to float
        As of `Helicopter.with_parameters`: {"body.mass": 9.0}, SI.

    Raises
    ------
    InputError
        A time that is negative or not finite, no values.

    Examples
    --------
    >>> load = symheli.flight.ParameterChange(2.0, {"body.mass": 9.0})
    >>> hover = symheli.AirspeedSchedule((2.0,), (1.0,), (4.0,))
    >>> sunk = symheli.fly(heli, hover, change=load)["w"][-1]
    >>> bool(sunk > symheli.fly(heli, hover)["w"][-1] + 0.1)
    True
    """

    at: float
    values: Mapping[str, float]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.at) and self.at >= 0):
            raise InputError(f"at: expected a time of the flight >= 0 s, got {self.at!r}")
        if not by_name(self.values, "values", '{"body.mass": 9.0}'):
            raise InputError('values: name what changes, such as {"body.mass": 9.0}')

    def of(self, heli: Helicopter) -> Array:
        """Return all parameters (NP,) after it; raises `InputError` for names and values that the
        helicopter cannot have, and for a travel of its controls, which stays in flight.
        """
        after = heli.with_parameters(self.values)
        if (after.travel != heli.travel).any():
            raise InputError(
                "values: the travel of controls cannot change in flight; fly a helicopter"
                " .with_parameters(...) for that"
            )
        return after.parameters.array

    def sample(self, dt: float) -> int:
        """Return the sample of a controller with this period (s) from which it holds."""
        return math.ceil(min(self.at / dt, NEVER) - 1e-9)
