"""How the parameters may move: today each on its own, within a bound on its rate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

Direction = tuple[tuple[int, float], ...]
"""(parameter, speed) of those that P depends on: dP/dt = sum of speed dP/dp."""


class Drift(NamedTuple):
    """Each parameter within its rate, in its units per second; inf: it may jump, 0: it rests.

    Assembly, proof and witness ask only this object where p may go, so that another law of motion
    is another object.
    """

    rates: tuple[float, ...]

    def moving(self, degrees: Sequence[int]) -> list[int]:
        """The parameters that move and that a P of these degrees depends on."""
        return [i for i, (r, d) in enumerate(zip(self.rates, degrees, strict=True)) if d and r > 0]

    def directions(self, degrees: Sequence[int]) -> Iterator[Direction]:
        """The extreme velocities of p, of which every other one is a mean; none where P rests."""
        moving = self.moving(degrees)
        for signs in product((-1, 1), repeat=len(moving)) if moving else ():
            yield tuple((i, sign * self.rates[i]) for i, sign in zip(moving, signs, strict=True))

    def steps(self, dt: float | None, degrees: Sequence[int]) -> tuple[float, ...]:
        """Largest change of each parameter in a sample that matters to P; 0 in continuous time."""
        return tuple(
            rate * dt if dt and d else 0.0 for rate, d in zip(self.rates, degrees, strict=True)
        )

    def meaningful(self, dt: float | None, degrees: Sequence[int]) -> bool:
        """False where P varies with a p that may jump in continuous time: dV/dt has no bound
        then.
        """
        return dt is not None or all(
            math.isfinite(r) or d == 0 for r, d in zip(self.rates, degrees, strict=True)
        )

    def in_units(self, time: float) -> Drift:
        """The same with time in units of `time` (s)."""
        return Drift(tuple(rate * time for rate in self.rates))
