"""Multipliers that are known of a block, affine in coefficients: sum c_k z' M_k z has a nonnegative
integral over time for all signals v, d = Delta(v) of finite energy.

z are `base` signals of the block, sums of v, d and dv/dt, and what a chain of lags makes of the
first of them: the powers of a/(s + a), sampled (1 - a)/(z - a). Everything is written once for
doubles and for rationals.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import positive_definite
from synthesis.numerics.polynomial.transfer import Transfer


class Filter(NamedTuple):
    """A, B, C, D from the base signals of a block to z."""

    A: Array
    B: Array
    C: Array
    D: Array


class Lags(NamedTuple):
    """The powers 1, ..., `order` of the lag of each pole."""

    poles: tuple[float, ...]
    order: int

    @property
    def count(self) -> int:
        """Number of lagged copies of a signal."""
        return len(self.poles) * self.order

    def filter(self, signals: int, lagged: int, sampled: bool, number: Any) -> Filter:
        """Return the filter from `signals` to these and the lagged copies of the first `lagged`."""
        k, n = lagged, self.count * lagged
        A, B = np.zeros((n, n), dtype=object), np.zeros((n, signals), dtype=object)
        for j, pole in enumerate(self.poles):
            a = number(pole)
            stay, enter = (a, 1 - a) if sampled else (-a, a)
            for r in range(self.order):
                own = slice((j * self.order + r) * k, (j * self.order + r + 1) * k)
                A[own, own] = stay * unit(k)
                if r:
                    A[own, own.start - k : own.start] = enter * unit(k)
                else:
                    B[own, :k] = enter * unit(k)
        C = np.vstack([np.zeros((signals, n), dtype=object), unit(n)])
        D = np.vstack([unit(signals), np.zeros((n, signals), dtype=object)])
        return Filter(A, B, C, D)


def unit(n: int) -> Array:
    """Return the identity in exact numbers."""
    out = np.zeros((n, n), dtype=object)
    out[range(n), range(n)] = 1
    return out


class Multipliers(ABC):
    """The class of multipliers of one block of `channels` inputs d and outputs v."""

    lags: Lags
    channels: int
    fields: ClassVar[dict[str, Any]] = {}
    """Names of the numbers of a class that a file holds, and their types."""

    def fault(self, sampled: bool) -> str:
        """Return why these numbers are none of the class; empty where they are."""
        poles = self.lags.poles
        most = 1.0 if sampled else math.inf
        if not all(0 < a < most for a in poles) or len(set(poles)) < len(poles):
            return "a pole of the lags is not stable, or there twice"
        return self._fault()

    def _fault(self) -> str:
        return ""

    @property
    def moving(self) -> bool:
        """Whether dv/dt is one of the signals."""
        return False

    @abstractmethod
    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return the base signals, of rows of v, d and dv/dt."""

    @property
    @abstractmethod
    def signals(self) -> int:
        """Number of base signals."""

    @property
    def lagged(self) -> int:
        """Number of base signals that are lagged too, the first ones."""
        return 2 * self.channels

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of coefficients."""

    @abstractmethod
    def form(self, c: Array, number: Any) -> Array:
        """Return the symmetric matrix of the quadratic form in z."""

    def amounts(self, c: Array) -> Array:
        """Return the numbers that are nonnegative of a multiplier of the class."""
        return c[:0]

    def matrices(self, c: Array) -> Sequence[Array]:
        """Return the symmetric matrices that are positive definite."""
        return ()

    def fault_of(self, c: Array) -> str:
        """Return why rational coefficients are of no multiplier of the class; empty where they
        are.
        """
        if any(v < 0 for v in self.amounts(c).tolist()):
            return "a multiplier is not one of its class: a coefficient is below zero"
        if not all(positive_definite(M) for M in self.matrices(c)):
            return "a multiplier is not one of its class: a matrix is not positive definite"
        return ""

    @property
    def pointwise(self) -> bool:
        """Whether the form is nonnegative at every instant."""
        return False

    @property
    def summed(self) -> bool:
        """Whether the form has a nonnegative integral over every finite time from rest."""
        return False

    def near(self, c: Array) -> Array:
        """Return the coefficients next to those of a solver, numbers below zero as zero."""
        return c

    def nominal(self, number: Any) -> Any:
        """Return the factor k of the member d = k v from which all others are reached."""
        return number(0.0)

    def filter(self, sampled: bool, number: Any) -> Filter:
        """Return the filter from the base signals to z."""
        return self.lags.filter(self.signals, self.lagged, sampled, number)

    def at(self, power: int, pole: int = 0) -> int:
        """Return where in z the lagged copies of this power begin; power 0: the base."""
        if not power:
            return 0
        return self.signals + (pole * self.lags.order + power - 1) * self.lagged


def symmetric(c: Array) -> Array:
    """Return the symmetric matrix whose lower triangle by rows is c."""
    n = triangle(len(c))
    out = np.zeros((n, n), dtype=c.dtype)
    rows, columns = np.tril_indices(n)
    out[rows, columns] = c
    out[columns, rows] = c
    return out


def skew(c: Array, n: int) -> Array:
    """Return the skew-symmetric matrix whose strict lower triangle by rows is c."""
    out = np.zeros((n, n), dtype=c.dtype)
    rows, columns = np.tril_indices(n, -1)
    out[rows, columns] = c
    out[columns, rows] = -c
    return out


def triangle(length: int) -> int:
    """Return n of length = n (n + 1)/2."""
    return int((8 * length + 1) ** 0.5 - 1) // 2


@dataclass(frozen=True, eq=False)
class ParameterMultipliers(Multipliers):
    """d = delta v, a real number from low to high, constant with `lags`, else moving in any way.

    With e = d - middle v: radius^2 v' Y v - e' Y e + v' S e + e' S' v, Y > 0 and S = -S' over v and
    its lagged copies.
    """

    channels: int
    low: float
    high: float
    moves: bool
    lags: Lags
    fields: ClassVar[dict[str, Any]] = {"low": float, "high": float, "moves": bool}

    def _fault(self) -> str:
        if not -math.inf < self.low < self.high < math.inf:
            return "the range of a parameter is empty"
        return "lags are for a constant parameter" if self.moves and self.lags.count else ""

    @property
    def signals(self) -> int:
        """Number of base signals: v, e."""
        return 2 * self.channels

    @property
    def lagged(self) -> int:
        """Number of base signals that are lagged too."""
        return self.signals if self.lags.count else 0

    @property
    def pointwise(self) -> bool:
        """Whether the form is nonnegative at every instant."""
        return not self.lags.count

    def nominal(self, number: Any) -> Any:
        """Return the middle of the range."""
        return (number(self.low) + number(self.high)) / 2

    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return v and e."""
        return np.vstack([v, d - self.nominal(number) * v])

    @property
    def size(self) -> int:
        """Number of copies of v, lagged ones too."""
        return self.channels * (1 + self.lags.count)

    @property
    def count(self) -> int:
        """Number of coefficients: Y and S."""
        return self.size**2

    def _places(self) -> tuple[Array, Array]:
        n, starts = self.channels, [0]
        starts += [
            self.at(r, j)
            for j in range(len(self.lags.poles))
            for r in range(1, self.lags.order + 1)
        ]
        v = np.concatenate([s + np.arange(n) for s in starts])
        return v, v + n

    def form(self, c: Array, number: Any) -> Array:
        """Return the matrix of the form in (v, e) and their lagged copies."""
        n = self.size
        half = n * (n + 1) // 2
        Y, S = symmetric(c[:half]), skew(c[half:], n)
        v, e = self._places()
        radius = (number(self.high) - number(self.low)) / 2
        out = np.zeros((2 * n, 2 * n), dtype=c.dtype)
        out[np.ix_(v, v)], out[np.ix_(e, e)] = radius * radius * Y, -Y
        out[np.ix_(v, e)], out[np.ix_(e, v)] = S, S.T
        return out

    def matrices(self, c: Array) -> Sequence[Array]:
        """Return Y."""
        return (symmetric(c[: self.size * (self.size + 1) // 2]),)


@dataclass(frozen=True, eq=False)
class DynamicMultipliers(Multipliers):
    """Any dynamics from `measured` channels v to `channels` d, of gain at most `bound`:
    bound^2 |v|^2 - |d|^2, both through lags, with a Y > 0 that is the same for all channels.
    """

    channels: int
    measured: int
    bound: float
    lags: Lags
    fields: ClassVar[dict[str, Any]] = {"measured": int, "bound": float}

    def _fault(self) -> str:
        return "" if 0 <= self.bound < math.inf else "the bound of dynamics is no number"

    @property
    def summed(self) -> bool:
        """Whether the form has a nonnegative integral over every finite time from rest."""
        return not self.lags.count

    @property
    def signals(self) -> int:
        """Number of base signals: v, d."""
        return self.channels + self.measured

    @property
    def lagged(self) -> int:
        """Number of base signals that are lagged too."""
        return self.signals

    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return v and d."""
        return np.vstack([v, d])

    @property
    def count(self) -> int:
        """Number of coefficients of Y."""
        return (1 + self.lags.count) * (2 + self.lags.count) // 2

    def form(self, c: Array, number: Any) -> Array:
        """Return the matrix of the form in (v, d) and their lagged copies."""
        Y, bound = symmetric(c), number(self.bound)
        sizes = np.array([bound * bound] * self.measured + [number(-1.0)] * self.channels)
        n = self.signals
        out = np.zeros((n * len(Y), n * len(Y)), dtype=c.dtype)
        for k in range(n):
            out[k::n, k::n] = sizes[k] * Y
        return out

    def matrices(self, c: Array) -> Sequence[Array]:
        """Return Y."""
        return (symmetric(c),)


@dataclass(frozen=True, eq=False)
class OwnMultipliers(Multipliers):
    """A filter of (v, d) and matrices M of its outputs, with weights >= 0."""

    channels: int
    given: Filter
    forms: tuple[Array, ...]
    lags: Lags

    def fault(self, sampled: bool) -> str:
        """Return why the filter or the forms are of no use; empty where they are."""
        A, _, C, _ = self.given
        none = np.zeros((len(A), 0)), np.zeros((0, len(A))), np.zeros((0, 0))
        if not Transfer.of(A, *none, sampled).stable:
            return "the filter of a multiplier is not stable"
        good = all(M.shape == (len(C), len(C)) and np.array_equal(M, M.T) for M in self.forms)
        return "" if good else "a form of a multiplier is not symmetric"

    @property
    def summed(self) -> bool:
        """Whether the form has a nonnegative integral over every finite time from rest."""
        return True

    @property
    def signals(self) -> int:
        """Number of base signals: v, d."""
        return self.given.B.shape[1]

    def base(self, v: Array, d: Array, slope: Array | None, number: Any) -> Array:
        """Return v and d."""
        return np.vstack([v, d])

    @property
    def count(self) -> int:
        """Number of weights."""
        return len(self.forms)

    def filter(self, sampled: bool, number: Any) -> Filter:
        """Return the filter that is given."""
        return Filter(*(_numbers(M, number) for M in self.given))

    def form(self, c: Array, number: Any) -> Array:
        """Return the sum of the forms."""
        terms = (x * _numbers(M, number) for x, M in zip(c, self.forms, strict=True))
        return np.asarray(sum(terms), dtype=c.dtype)

    def amounts(self, c: Array) -> Array:
        """Return the weights."""
        return c

    def near(self, c: Array) -> Array:
        """Return the weights, not below zero."""
        return np.maximum(c, 0.0)


def _numbers(M: Array, number: Any) -> Array:
    return np.array([[number(float(x)) for x in row] for row in M], dtype=object).reshape(M.shape)
