"""Multipliers of static functions: of the circle criterion, of Popov, of Zames and Falb."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.robust.multipliers.classes import Lags, Multipliers


class Pair(NamedTuple):
    """sign * z_p z_q with a coefficient; `row` and `column` of the matrix multiplier that it
    takes, -1 of none.
    """

    p: int
    q: int
    sign: int
    row: int
    column: int


@dataclass(frozen=True, eq=False)
class StaticMultipliers(Multipliers):
    """Functions d_i = phi(v_i) with (d - low v)(high v - d) >= 0; `sloped`: with slopes from low to
    high, all channels the same function, constant; `constant`: phi does not depend on time.

    u = high v - d is a monotone function of e = d - low v. The form is e' M u: M has a diagonal
    that dominates its rows and columns, with the integrals of its kernels; kernels are positive and
    entries beside the diagonal negative, unless phi is odd. q e dv/dt is Popov's. An entry (i, j)
    stands in the program with half its size on the diagonal at i and at j, so that the diagonal's
    own coefficient is above half the difference of the sums of row and column.
    """

    channels: int
    low: float
    high: float
    sloped: bool
    odd: bool
    constant: bool
    popov: bool
    lags: Lags
    fields: ClassVar[dict[str, Any]] = {
        **dict.fromkeys(("low", "high"), float),
        **dict.fromkeys(("sloped", "odd", "constant", "popov"), bool),
    }

    def _fault(self) -> str:
        if not -math.inf < self.low < self.high < math.inf:
            return "a sector is empty"
        if (self.sloped or self.popov) and not self.constant:
            return "a function that depends on time has no such multipliers"
        return "" if self.sloped or not self.lags.count else "lags are for slopes"

    @property
    def moving(self) -> bool:
        """Whether dv/dt is one of the signals."""
        return self.popov

    @property
    def signals(self) -> int:
        """Number of base signals: u, e, dv/dt."""
        return (2 + self.moving) * self.channels

    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return u, e and dv/dt."""
        own = [number(self.high) * v - d, d - number(self.low) * v]
        return np.vstack([*own, slope] if self.moving else own)

    def nominal(self, number: Any) -> Any:
        """Return the least slope."""
        return number(self.low)

    @property
    def pointwise(self) -> bool:
        """Whether the form is nonnegative at every instant."""
        return not (self.sloped or self.popov)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """The terms, one for each coefficient: those of the diagonal first, Popov's last."""
        n, out = self.channels, []
        out += [Pair(n + i, i, 1, -1, -1) for i in range(n)]
        signs = (-1, 1) if self.odd else (-1,)
        both = [(i, j) for i in range(n) for j in range(n)] if self.sloped else []
        for sign in signs:
            out += [Pair(n + i, j, sign, i, j) for i, j in both if i != j]
            for pole in range(len(self.lags.poles)):
                for r in range(1, self.lags.order + 1):
                    at = self.at(r, pole)
                    out += [Pair(n + i, at + j, sign, i, j) for i, j in both]
                    out += [Pair(at + n + i, j, sign, i, j) for i, j in both]
        if self.moving:
            out += [Pair(n + i, 2 * n + i, 1, -1, -1) for i in range(n)]
        return tuple(out)

    @property
    def count(self) -> int:
        """Number of coefficients."""
        return len(self.pairs)

    def form(self, c: Array, number: Any) -> Array:
        """Return the matrix of e' M u + q e dv/dt."""
        n, size = self.channels, self.signals + self.lags.count * self.lagged
        out = np.zeros((size, size), dtype=c.dtype)
        for value, pair in zip(c, self.pairs, strict=True):
            terms = [(pair.p, pair.q, value * pair.sign / 2)]
            if pair.row >= 0:
                terms += [(n + i, i, value / 4) for i in (pair.row, pair.column)]
            for p, q, half in terms:
                out[p, q] += half
                out[q, p] += half
        return out

    def _tilt(self, c: Array) -> Array:
        """Return half the difference of the row sums and the column sums of the entries (n,)."""
        out = 0 * c[: self.channels]
        for value, pair in zip(c, self.pairs, strict=True):
            if pair.row >= 0 and pair.row != pair.column:
                out[pair.row] = out[pair.row] + value / 2
                out[pair.column] = out[pair.column] - value / 2
        return out

    def amounts(self, c: Array) -> Array:
        """Return the coefficients of M, and by how much its diagonal dominates."""
        n, tilt = self.channels, self._tilt(c)
        return np.concatenate([c[n : len(c) - n * self.moving], c[:n] + tilt, c[:n] - tilt])

    def near(self, c: Array) -> Array:
        """Return the coefficients next to these, those of M not below zero, the diagonal large
        enough.
        """
        n, last = self.channels, len(c) - self.channels * self.moving
        out = np.concatenate([c[:n], np.maximum(c[n:last], 0.0), c[last:]])
        least = np.abs(self._tilt(out)) * (1 + 1e-12) + 1e-13 * np.abs(out[n:last]).max(initial=0.0)
        return np.concatenate([np.maximum(out[:n], least if self.sloped else 0.0), out[n:]])
