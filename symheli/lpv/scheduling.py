"""The scheduling parameter: what it is called, where it lives and how fast it may move."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from symheli.errors import InputError
from symheli.values.arrays import Array, frozen


@dataclass(frozen=True)
class Scheduling:
    """A scheduling parameter p in [low, high] with |dp/dt| <= rate.

    `low`, `high` in `unit`, `rate` in `unit` per second (math.inf: as fast as it likes).
    """

    name: str
    unit: str
    low: float
    high: float
    rate: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"scheduling {self.name}: expected finite low < high, got [{self.low}, {self.high}]"
            )
        if not self.rate >= 0:
            raise InputError(
                f"scheduling {self.name}: rate must be >= 0 {self.unit}/s, got {self.rate}"
            )

    @property
    def middle(self) -> float:
        """Centre of the range, in `unit`."""
        return 0.5 * (self.low + self.high)

    @property
    def radius(self) -> float:
        """Half the width of the range, in `unit`."""
        return 0.5 * (self.high - self.low)

    def normalised(self, p: Array) -> Array:
        """p as a number from -1 at `low` to 1 at `high`; no digit of p is lost far from zero."""
        return ((p - self.low) - (self.high - p)) / (self.high - self.low)

    def with_rate(self, rate: float) -> Scheduling:
        """The same parameter with another rate limit."""
        return replace(self, rate=rate)

    def check(self, p: object) -> Array:
        """`p` as an array; raises `InputError` where it leaves [low, high] by more than
        rounding.
        """
        p = frozen(p, self.name)
        slack = 1e-9 * (self.high - self.low)
        if p.size and (p.min() < self.low - slack or p.max() > self.high + slack):
            raise InputError(
                f"{self.name} spans [{p.min():.4g}, {p.max():.4g}] {self.unit} but the model holds"
                f" on [{self.low:.4g}, {self.high:.4g}]; clip the data or identify and sweep over a"
                " wider range"
            )
        return p
