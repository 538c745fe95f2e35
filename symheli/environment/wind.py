"""The motion of the air over a flight: a steady wind, gusts and turbulence together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symheli.environment.gust import Gust
from symheli.environment.turbulence import Dryden
from symheli.errors import InputError
from symheli.values.arrays import frozen
from symheli.values.numbers import whole


@dataclass(frozen=True)
class Wind:
    """Wind is the sum of a steady wind, gusts and turbulence, in m/s.

    Turbulence is laid along north, the heading flights keep: its first component is along the path.

    Parameters
    ----------
    steady : (float, float, float)
        North, east, down, m/s.
    gusts : tuple of Gust
        Added.
    turbulence : Dryden, optional
        The mean wind inside it sets its strength only; give it in `steady` too where it shall blow.
    seed : int
        Of the turbulence.

    Raises
    ------
    InputError
        Numbers that are not finite.

    See Also
    --------
    symheli.fly : one closed-loop flight
    symheli.environment.Gust : one gust
    symheli.environment.Dryden : turbulence

    Examples
    --------
    >>> gust = symheli.environment.Gust(peak=(0.0, 2.0, 0.0), start=1.0, duration=2.0)
    >>> wind = symheli.Wind(steady=(-3.0, 0.0, 0.0), gusts=(gust,))
    >>> wind.is_steady, wind.history([0.0, 2.0], [5.0, 5.0]).round(1).tolist()
    (False, [[-3.0, 0.0, 0.0], [-3.0, 2.0, 0.0]])
    """

    steady: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gusts: tuple[Gust, ...] = ()
    turbulence: Dryden | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if (
            not isinstance(self.steady, Sequence | np.ndarray)
            or len(self.steady) != 3
            or not all(math.isfinite(v) for v in self.steady)
        ):
            raise InputError(
                "steady: expected three finite numbers (north, east, down), m/s, such as (-5.0,"
                f" 0.0, 0.0) for 5 m/s from the north, got {self.steady}"
            )
        whole(self.seed, "seed")

    @property
    def is_steady(self) -> bool:
        """Whether the wind is constant."""
        return not self.gusts and self.turbulence is None

    def history(self, time: object, airspeed: object) -> np.ndarray:
        """Wind (n, 3), north east down, m/s, at `time` (n,) s, met at `airspeed` ((n,) or one,
        m/s).
        """
        time = frozen(time, "time", (None,))
        total = np.tile(np.array(self.steady, float), (len(time), 1))
        for gust in self.gusts:
            total += gust(time)
        if self.turbulence is not None:
            total += self.turbulence.history(time, airspeed, self.seed)
        return total
