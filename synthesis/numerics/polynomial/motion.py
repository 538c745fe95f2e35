"""Motion of the parameters of a model: at independent rates, or with one parameter the rate of
another.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from symheli import Scheduling

PARTS_PER_SIGN = {True: 2, False: 4}
"""Number of parts into which either sign of a parameter that is the rate of another is divided, by
whether time is continuous: this limits how closely its reach and, in discrete time, the step of
the other parameter are known.
"""


class Drift(NamedTuple):
    """One motion of p: dp_i/dt is `rates[i]`, or parameter `ties[i]` where there is one."""

    rates: tuple[float, ...]
    ties: tuple[int | None, ...]


class Motion(NamedTuple):
    """|dp_i/dt| <= `rates[i]`, and dp_i/dt = p_j where `ties[i]` is j: then `rates[i]` is the
    largest |p_j|.

    A p_j that is the rate of p_i may be at most what lets p_i stay in its range while |dp_j/dt| <=
    rates[j]: p_j^2 <= 2 rates[j] (p_i - low_i) below zero and <= 2 rates[j] (high_i - p_i) above.
    Outside of that, nothing has to hold.
    """

    box: tuple[tuple[float, float], ...]
    rates: tuple[float, ...]
    ties: tuple[int | None, ...]

    @classmethod
    def of(cls, parameters: Sequence[Scheduling]) -> Motion:
        """Return the motion within the limits of these parameters."""
        names = [s.name for s in parameters]
        ties = tuple(names.index(s.rate) if isinstance(s.rate, str) else None for s in parameters)
        rates = tuple(
            float(s.limit if j is None else max(abs(parameters[j].low), abs(parameters[j].high)))
            for s, j in zip(parameters, ties, strict=True)
        )
        return cls(tuple((float(s.low), float(s.high)) for s in parameters), rates, ties)

    def suits(self, parameters: Sequence[Scheduling]) -> bool:
        """Whether these parameters move so, except for the limits of those not tied to another."""
        own = Motion.of(parameters)
        if len(self.rates) != len(own.rates) or not all(r >= 0 for r in self.rates):
            return False
        same = all(self.rates[i] == own.rates[i] for i, _ in own.tied)
        return same and (self.box, self.ties) == (own.box, own.ties)

    @property
    def tied(self) -> tuple[tuple[int, int], ...]:
        """Pairs (i, j) for every p_i whose rate is p_j."""
        return tuple((i, j) for i, j in enumerate(self.ties) if j is not None)

    def drifts(self, varying: Sequence[bool]) -> Iterator[Drift]:
        """Yield every extreme motion, as far as P is `varying` with it."""
        choices = [
            (0.0,) if not used or tie is not None or rate == 0 else (-rate, rate)
            for used, rate, tie in zip(varying, self.rates, self.ties, strict=True)
        ]
        ties = tuple(j if used else None for used, j in zip(varying, self.ties, strict=True))
        for rates in product(*choices):
            yield Drift(rates, ties)

    def reaches(self, box: Sequence[tuple[float, float]]) -> bool:
        """Whether p can be somewhere in this box and stay in its ranges forever."""
        for i, j in self.tied:
            (a, b), (c, d), jerk = box[i], box[j], self.rates[j]
            if math.isinf(jerk):
                continue
            room = 2 * jerk * (1 + 1e-9)
            if d < 0 and d * d > room * (b - self.box[i][0]):
                return False
            if c > 0 and c * c > room * (self.box[i][1] - a):
                return False
        return True

    def cuts(self, axis: int, continuous: bool) -> tuple[float, ...]:
        """Return the values at which the range of a parameter that is the rate of another
        is cut.
        """
        if all(j != axis for _, j in self.tied):
            return ()
        if continuous and math.isinf(self.rates[axis]):
            return ()  # every inequality is affine in it, and all of it can be reached
        low, high = self.box[axis]
        count = PARTS_PER_SIGN[continuous]
        return tuple(side * k / count for side in (low, high) for k in range(count))

    def span(self, i: int, cell: Sequence[tuple[float, float]], dt: float) -> tuple[float, float]:
        """Return the (least, largest) change of p_i in a sample while p is in this cell."""
        j = self.ties[i]
        if j is None:
            return -self.rates[i] * dt, self.rates[i] * dt
        slack = 0.5 * self.rates[j] * dt * dt
        low, high = self.box[j]
        return max(cell[j][0] * dt - slack, low * dt), min(cell[j][1] * dt + slack, high * dt)

    def at_rest(self) -> tuple[int, ...]:
        """Parameters that are zero where p is frozen: those that are the rate of another."""
        return tuple(j for _, j in self.tied)
