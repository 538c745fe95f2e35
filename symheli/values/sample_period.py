"""Sample periods: estimated from time stamps, and compared with each other."""

from __future__ import annotations

import warnings
from fractions import Fraction
from math import floor, log10

import numpy as np

from symheli.errors import DataWarning
from symheli.values.arrays import Array

SAME = 1e-6
"""Two periods closer than this part of the smaller are one: far above the rounding of time stamps,
far below what any response shows.
"""

JITTER = 0.01
"""What the steps of a record may vary by, as a part of its period; two records are of one period
within this too.
"""

USUAL = 1e-4, 1.0
"""Seconds between samples of a flight; a step beyond these is rather a time in another unit."""


SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds in a unit of time."""


def same_period(first: float | None, second: float | None, tolerance: float = SAME) -> bool:
    """Whether two sample periods (s; None: continuous time) are one, to `tolerance` of the
    smaller.
    """
    if first is None or second is None:
        return first is second
    return abs(first - second) <= tolerance * min(abs(first), abs(second))


def period_of(steps: Array, last: float) -> float:
    """The period (s) of stamps that end at `last` (s) and lie `steps` (n,) apart: the roundest
    number that explains them.

    Their mean step is known to (spread of the steps + rounding of the stamps) / n. Of the numbers
    that near, a whole number of hertz is taken, else the decimal of fewest digits; where none has
    fewer than a double holds, the mean itself.
    """
    mean = float(np.mean(steps))
    slack = (float(np.ptp(steps)) + 4 * float(np.spacing(abs(last)))) / len(steps) + 2 * float(
        np.spacing(mean)
    )
    hertz = 1 / max(round(1 / mean), 1)
    if abs(hertz - mean) <= slack:
        return hertz
    first = -floor(log10(mean))
    for digits in range(first, first + 15):
        candidate = float(round(Fraction(mean), digits))
        if abs(candidate - mean) <= slack:
            return candidate
    return mean


def units_of_step(step: float, taken: str = "s") -> dict[str, float]:
    """{unit: step in s} of the other units of time in which a step of so many s, which was `taken`
    in one, is that of a flight record.
    """
    number = step / SECONDS[taken]
    found = {unit: number * factor for unit, factor in SECONDS.items() if unit != taken}
    return {unit: value for unit, value in found.items() if USUAL[0] <= value <= USUAL[1]}


def warn_of_odd_steps(time: Array) -> None:
    """Warn (`DataWarning`) where the median step of `time` (s) is implausible for a flight record,
    which suggests another unit.
    """
    step, (least, most) = float(np.median(np.diff(time))), USUAL
    if least <= step <= most:
        return
    meant = list(units_of_step(step))
    far = (
        f"; if the time is in {' or '.join(meant)}, say so: time_unit={meant[0]!r} (--time-unit"
        f" {meant[0]})"
        if step > most and meant
        else "; the time is taken in seconds: check its unit"
    )
    warnings.warn(f"the samples are {step:.6g} s apart{far}", DataWarning, stacklevel=3)
