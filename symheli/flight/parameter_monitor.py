"""Treatment of the measured scheduling parameter by a controller: filter, limits and fallback."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from symheli.errors import InputError


@dataclass(frozen=True)
class ParameterMonitor:
    """Treatment of a measured scheduling parameter, such as an airspeed: filter, range and
    fallback.

    A good reading is held at the ends of the table, filtered (`lag`) and followed at `rate` at
    most, the rate for which the loop is certified. A bad one (no number, said to be invalid,
    outside `plausible`, or the same to the last bit for longer than `frozen`) is not followed: the
    last good one stays for `hold` seconds, then the parameter moves to `fallback`, at `rate` too.
    The first reading after a start is taken as it is; where it is bad, `fallback` is.

    Parameters
    ----------
    rate : float, optional
        In its unit per second; default the rate limit of the model's scheduling.
    lag : float
        Time constant of a first-order filter before the rate limit, s; 0: none.
    plausible : (float, float), optional
        Readings outside are bad, in its unit; default the range of the table and its width on
        either side.
    frozen : float
        Longest time that a reading may stay the same to the last bit, s; longer for a sensor that
        rounds, math.inf where a constant one is right. What is commanded may stay as long as it
        likes.
    hold : float
        How long the last good reading stays, s.
    fallback : float, optional
        In its unit; default the middle of the table.

    Raises
    ------
    InputError
        Times and rates below zero, an empty range.

    Examples
    --------
    >>> import symheli
    >>> symheli.flight.ParameterMonitor(lag=0.2, fallback=4.0).hold
    1.0
    """

    rate: float | None = None
    lag: float = 0.0
    plausible: tuple[float, float] | None = None
    frozen: float = 2.0
    hold: float = 1.0
    fallback: float | None = None

    def __post_init__(self) -> None:
        for name in ("rate", "lag", "frozen", "hold"):
            value = getattr(self, name)
            if value is not None:
                _expect(name, value, "a number >= 0", lambda v: v >= 0)
        if self.lag == math.inf:
            raise InputError("lag: expected a finite time constant in s, got inf")
        if self.fallback is not None:
            _expect(
                "fallback",
                self.fallback,
                "a finite value of the parameter",
                math.isfinite,
            )
        if self.plausible is not None:
            try:
                low, high = map(float, self.plausible)
            except (TypeError, ValueError):
                low = high = math.nan
            if not low < high:
                raise InputError(
                    f"plausible: expected two values low < high, got {self.plausible!r:.80}"
                )
            object.__setattr__(self, "plausible", (low, high))


def _expect(name: str, value: object, wanted: str, fits: Callable[[float], bool]) -> None:
    try:
        fine = not isinstance(value, bool) and fits(float(value))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        fine = False
    if not fine:
        raise InputError(f"{name}: expected {wanted}, got {value!r:.80}")
