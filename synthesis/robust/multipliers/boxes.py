"""Multipliers of several real parameters that move in any way, together: full blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, ClassVar

import numpy as np

from symheli.values.arrays import Array
from synthesis.robust.multipliers.classes import Lags, Multipliers, symmetric

MOST = 10
"""Largest number of parameters, whose box has 2^`MOST` corners."""


def _floats(values: Any) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _integers(values: Any) -> tuple[int, ...]:
    return tuple(int(v) for v in values)


@dataclass(frozen=True, eq=False)
class BoxMultipliers(Multipliers):
    """d = Delta v, Delta diagonal with `copies` of each number between `lows` and `highs`: all
    symmetric M with [1; Delta]' M [1; Delta] > 0 at the corners of the box, concave in each number.
    """

    channels: int
    lows: tuple[float, ...]
    highs: tuple[float, ...]
    copies: tuple[int, ...]
    lags: Lags
    fields: ClassVar[dict[str, Any]] = {"lows": _floats, "highs": _floats, "copies": _integers}

    def _fault(self) -> str:
        each = list(zip(self.lows, self.highs, strict=False))
        if not 1 <= len(each) == len(self.lows) == len(self.highs) == len(self.copies) <= MOST:
            return f"the box has no or too many parameters, or of different kinds; at most {MOST}"
        if any(not -math.inf < a < b < math.inf for a, b in each):
            return "the range of a parameter is empty"
        if sum(self.copies) != self.channels or min(self.copies) < 1 or self.lags.count:
            return "the copies of the parameters are not the channels"
        return ""

    @property
    def pointwise(self) -> bool:
        """Whether the form is nonnegative at every instant."""
        return True

    @property
    def signals(self) -> int:
        """Number of base signals: v, d."""
        return 2 * self.channels

    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return v and d."""
        return np.vstack([v, d])

    @property
    def count(self) -> int:
        """Number of coefficients of M."""
        return self.channels * (2 * self.channels + 1)

    def form(self, c: Array, number: Any) -> Array:
        """Return M."""
        return symmetric(c)

    def matrices(self, c: Array) -> Sequence[Array]:
        """Return the forms at the corners, and minus those in the copies of each parameter."""
        M, n, out = symmetric(c), self.channels, []
        number: Any = float if c.dtype == float else _fraction
        for corner in product(*zip(self.lows, self.highs, strict=True)):
            delta = np.repeat(np.array([number(v) for v in corner], dtype=c.dtype), self.copies)
            cross = M[:n, n:] * delta
            out.append(M[:n, :n] + cross + cross.T + delta[:, None] * M[n:, n:] * delta)
        ends = np.cumsum([n, *self.copies])
        return [*out, *(-M[a:b, a:b] for a, b in pairwise(ends))]


def _fraction(value: float) -> Any:
    from fractions import Fraction

    return Fraction(value)
