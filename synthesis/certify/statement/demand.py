"""The property of a model that is to be proven, and how its parameters may move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from synthesis.certify.statement.kind import Kind, Supply
from synthesis.numerics.polynomial.motion import Motion


class Demand(NamedTuple):
    """The property to be proven: `kind`; how p moves; `shift`: alpha of a decay rate, 1/s, else 0.

    `time`: seconds in the unit of time of the model in continuous time; `channel`: the unit of its
    outputs.
    """

    kind: Kind
    motion: Motion
    shift: float = 0.0
    time: float = 1.0
    channel: float = 1.0

    def supply(self, level: Any, number: Any) -> Supply | None:
        """Return the supply rate at a level, in an arithmetic; None of a kind without one."""
        facets = self.kind.facets
        if facets.supply is None:
            return None
        return facets.supply(number, self.channel).plus(level, facets.rise)

    @property
    def of_gramian(self) -> bool:
        """Whether P bounds the inverse Gramian of the inputs, and a second inequality the
        outputs.
        """
        return self.kind.facets.gramian

    def seen(self, outputs: int) -> int:
        """Return the number of rows of that second inequality in which g stands."""
        return 1 if self.kind.facets.rows else outputs

    @property
    def rates(self) -> tuple[float, ...]:
        """Largest rate of each parameter, in its unit per second."""
        return self.motion.rates

    def moving(self, degrees: Sequence[int]) -> list[bool]:
        """Return for each parameter whether its motion changes P."""
        return [bool(d) and rate > 0 for d, rate in zip(degrees, self.rates, strict=True)]

    def steps(self, dt: float | None, degrees: Sequence[int]) -> tuple[float, ...]:
        """Return the largest change of each parameter in a sample that changes P; 0 in continuous
        time.
        """
        return tuple(
            rate * dt if dt and d else 0.0 for rate, d in zip(self.rates, degrees, strict=True)
        )

    def meaningful(self, dt: float | None, degrees: Sequence[int]) -> bool:
        """Return False where P varies with a p that may jump in continuous time: dV/dt is unbounded
        then.
        """
        return dt is not None or all(
            math.isfinite(r) or d == 0 for r, d in zip(self.rates, degrees, strict=True)
        )
