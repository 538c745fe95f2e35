"""Scalings over intervals of frequency: what they show is checked in integers, without rounding.

With M = N/(g d) and v the frequency, the left side times |g d|^2 is a Hermitian matrix of
polynomials H(v) with coefficients in the Gaussian integers. Its determinant is |d|^(2 (nw - 1))
times a polynomial of degree 2 n, n the number of states. Where that polynomial has no root, and H
is positive definite at one point, H is on the whole interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.exact import positive_definite
from synthesis.numerics.polynomial.positive import bernstein, positive, positive_until
from synthesis.numerics.polynomial.transfer import Gaussian, Transfer, rationals
from synthesis.robust.exact_loop import ExactLoop, Part

DEPTH = 24
"""Halvings, of what lies to either side of a frequency, by which the end of an interval is found.
"""


class Scalings(NamedTuple):
    """Z (nz, nz), W (nw, nw) without the level, and G (nw, nz)."""

    Z: Array
    W: Array
    G: Array

    def commute(self, parts: Sequence[Part]) -> bool:
        """Whether they commute with every block of these parts, D Hermitian and positive definite;
        exact.
        """
        Z, W, G = (np.zeros_like(M) for M in self)
        for part in parts:
            own, other = self.Z[part.rows, part.rows], self.W[part.columns, part.columns]
            if not part.real:
                d = own[0, 0]
                own, other = d * np.eye(len(own)), d * np.eye(len(other))
            elif not np.array_equal(own, other):
                return False
            Z[part.rows, part.rows], W[part.columns, part.columns] = own, other
            if part.real:
                G[part.columns, part.rows] = self.G[part.columns, part.rows]
                if not _hermitian(G[part.columns, part.rows]):
                    return False
            if not (_hermitian(own) and _positive(own) and _positive(other)):
                return False
        return all(np.array_equal(a, b) for a, b in zip(self, (Z, W, G), strict=True))


class Interval(NamedTuple):
    """Scalings that show the level at every frequency from `low` to `high`, rad/s."""

    low: float
    high: float
    by: Scalings


class LevelProof(NamedTuple):
    """The numbers of the proof that no block exceeds `level` at any frequency: of all blocks, or of
    the last part, the `performance`, alone. z and w are in units of `rows` and `columns`; the
    frequencies of a sampled model are tan(omega dt/2).
    """

    level: float
    rows: Array
    columns: Array
    parts: tuple[Part, ...]
    performance: bool
    intervals: tuple[Interval, ...]

    def verified(self, loop: ExactLoop, parts: Sequence[Part]) -> bool:
        """Whether the loop is stable without its blocks, which are these `parts`, the scalings fit
        them and hold on their intervals, and these leave no frequency out.
        """
        if self.parts != tuple(parts) or self.bound is None or not self._fits(loop):
            return False
        check = Check.of(
            loop.transfer.scaled(self.rows, self.columns), self.parts, self.performance
        )
        if not check.transfer.stable:
            return False
        reached = 0.0
        for low, high, by in sorted(self.intervals, key=lambda each: each.low):
            if low > reached or not check.holds(by, low, high, self.level):
                return False
            reached = max(reached, high)
        return bool(self.intervals) and math.isinf(reached)

    @property
    def bound(self) -> Fraction | None:
        """The level in the units of the loop; None where `rows` and `columns` are no units of its
        blocks, the same number along each.
        """
        found = set()
        for k, part in enumerate(self.parts):
            own, other = (
                {*map(Fraction, v)} for v in (self.rows[part.rows], self.columns[part.columns])
            )
            if not (len(own) == len(other) == 1 and min(*own, *other) > 0):
                return None
            unit = own.pop() * other.pop()
            if not self.performance or k == len(self.parts) - 1:
                found.add(unit)
            elif unit != 1:
                return None
        return Fraction(self.level) / found.pop() if len(found) == 1 else None

    def _fits(self, loop: ExactLoop) -> bool:
        """Whether the parts are blocks side by side that take every row and column once."""
        rows = [i for p in self.parts for i in range(p.rows.start, p.rows.stop)]
        columns = [i for p in self.parts for i in range(p.columns.start, p.columns.stop)]
        height, width = loop.D.shape
        square = all(p.rows == p.columns for p in self.parts if p.real)
        units = len(self.rows) == height and len(self.columns) == width
        return square and units and rows == [*range(height)] and columns == [*range(width)]


class Check(NamedTuple):
    """The left side of a loop, and its response at 2 n + 1 frequencies."""

    transfer: Transfer
    parts: tuple[Part, ...]
    performance: bool
    points: list[Gaussian]

    @classmethod
    def of(cls, transfer: Transfer, parts: tuple[Part, ...], performance: bool) -> Check:
        """Return the check of a transfer matrix from w to z in the units of the scalings."""
        n = len(transfer.below) - 1
        return cls(transfer, parts, performance, [transfer.at(v) for v in range(-n, n + 1)])

    def holds(self, by: Scalings, low: float, high: float, level: float) -> bool:
        """Whether the scalings show the level at every frequency of the closed interval."""
        own = self._prepared(by, level)
        if own is None or not 0 <= low <= high:
            return False
        a = self._scaled(low)
        b = None if math.isinf(high) else self._scaled(high)
        if math.isinf(low) or not own.positive_at(self.transfer, a):
            return False
        if a == b:
            return True
        p = own.polynomial(self.points)
        return p is not None and positive(p, a, b, max(a, Fraction(1)))

    def reach(self, by: Scalings, omega: float, level: float) -> tuple[float, float] | None:
        """Return an interval about omega on which the scalings show the level, its upper end inf
        where they do for all above; None where they do not at omega.
        """
        own, v = self._prepared(by, level), self._scaled(omega)
        if own is None or not own.positive_at(self.transfer, v):
            return None
        p = own.polynomial(self.points)
        if p is None:
            return None
        pace = v or Fraction(1)
        above = positive_until(bernstein(p, v, None, pace), DEPTH)
        below = positive_until(bernstein(p, 0, v)[::-1], DEPTH) if v else Fraction(1)
        if min(above, below) < 0:
            return None
        high = math.inf if above == 1 else self._frequency(v + pace * above / (1 - above), 0.0)
        return self._frequency(v * (1 - below), math.inf), high

    def _scaled(self, omega: float) -> Fraction:
        return Fraction(omega) / Fraction(2) ** self.transfer.pace

    def _frequency(self, v: Fraction, towards: float) -> float:
        """Return v in rad/s, rounded in this direction."""
        exact = v * Fraction(2) ** self.transfer.pace
        found = float(exact)
        wrong = Fraction(found) > exact if towards == 0.0 else Fraction(found) < exact
        return math.nextafter(found, towards) if wrong else found

    def _prepared(self, by: Scalings, level: float) -> _Whole | None:
        if not (all(np.all(np.isfinite(M)) for M in by) and 0 < level < math.inf):
            return None
        if not by.commute(self.parts):
            return None
        Z, W, G = _integers(by)
        above, below = (v * v for v in Fraction(level).as_integer_ratio())
        size = np.full(len(by.W), below, dtype=object)
        for part in self.parts[-1:] if self.performance else self.parts:
            size[part.columns] = above
        W = W[0] * size, W[1] * size
        return _Whole((Z[0] * below, Z[1] * below), W, (G[0] * below, G[1] * below), self.transfer)


class _Whole(NamedTuple):
    """Scalings, W with the level, as integers times one number: real and imaginary parts."""

    Z: tuple[Array, Array]
    W: tuple[Array, Array]
    G: tuple[Array, Array]
    transfer: Transfer

    def minors(self, M: Gaussian, pivoting: bool) -> list[int] | None:
        """Return the leading principal minors of the left side times |d|^2; with `pivoting` up to
        the first that is zero, or of rows in another order. None where none is left to divide by.
        """
        (a, b), gain, N = M.below, self.transfer.gain, (M.real, M.imaginary)
        size = a * a + b * b
        inner = _times((N[0].T, -N[1].T), _times(self.Z, N))
        turned = _times(self.G, N)  # times g and the conjugate of d
        turned = (
            gain * (a * turned[0] + b * turned[1]),
            gain * (a * turned[1] - b * turned[0]),
        )
        weight = size * gain * gain
        real = weight * self.W[0] - inner[0] + turned[1] + turned[1].T
        imaginary = weight * self.W[1] - inner[1] - turned[0] + turned[0].T
        found, before = [], size
        while len(real):
            if real[0, 0] == 0:
                if not pivoting:
                    return found
                free = np.flatnonzero(np.diagonal(real))
                if not len(free):
                    return [0] if not (np.any(real) or np.any(imaginary)) else None
                order = [free[0], *(i for i in range(len(real)) if i != free[0])]
                real, imaginary = real[np.ix_(order, order)], imaginary[np.ix_(order, order)]
            p, r, i = real[0, 0], real[1:, 0], imaginary[1:, 0]
            found.append(p)
            outer = np.multiply.outer
            real = _divided(p * real[1:, 1:] - outer(r, r) - outer(i, i), before)
            imaginary = _divided(p * imaginary[1:, 1:] - outer(i, r) + outer(r, i), before)
            before = p
        return found

    def positive_at(self, transfer: Transfer, v: Fraction) -> bool:
        """Whether the left side is positive definite at the frequency v."""
        found = self.minors(transfer.at(v), pivoting=False)
        return found is not None and len(found) == len(self.W[0]) and all(m > 0 for m in found)

    def polynomial(self, points: Sequence[Gaussian]) -> list[int] | None:
        """Return the coefficients, ascending, of the determinant times |d|^2, times a positive
        number; None where it cannot be divided at one of the points -n .. n.
        """
        values = []
        for M in points:
            found = self.minors(M, pivoting=True)
            if found is None:
                return None
            values.append(found[-1] if found else 1)
        return _interpolated(values)


def _interpolated(values: list[int]) -> list[int]:
    """Return the coefficients, ascending, of the polynomial with these values at -n .. n, times a
    positive number.
    """
    count, n = len(values), len(values) // 2
    differences = list(values)
    for k in range(1, count):
        for j in range(count - 1, k - 1, -1):
            differences[j] -= differences[j - 1]
    out, factor = [differences[-1]], 1  # Newton's form, times (count - 1)!
    for k in range(count - 2, -1, -1):
        factor *= k + 1
        out = [a + (n - k) * b for a, b in zip([0, *out], [*out, 0], strict=True)]
        out[0] += differences[k] * factor
    common = math.gcd(*out) or 1
    return [v // common for v in out]


def _divided(M: Array, by: int) -> Array:
    """Return integers by a common factor of all."""
    out = M // by
    if np.any(out * by != M):
        raise ArithmeticError("a minor is no integer")  # an impossibility of our own
    return out


def _times(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
    return a[0] @ b[0] - a[1] @ b[1], a[0] @ b[1] + a[1] @ b[0]


def _integers(by: Scalings) -> list[tuple[Array, Array]]:
    """Return real and imaginary parts of all, times one power of two that makes them integers."""
    parts = [rationals(f(M)) for M in by for f in (np.real, np.imag)]
    common = max((v.denominator for M in parts for v in M.ravel().tolist()), default=1)
    turn = np.frompyfunc(lambda v: int(v * common), 1, 1)
    whole = [np.asarray(turn(M), dtype=object) for M in parts]
    return [(whole[2 * k], whole[2 * k + 1]) for k in range(3)]


def _hermitian(M: Array) -> bool:
    return np.array_equal(M, M.conj().T)


def _positive(M: Array) -> bool:
    """Whether a Hermitian matrix of doubles is positive definite; exact."""
    real, imaginary = rationals(np.real(M)), rationals(np.imag(M))
    return positive_definite(np.block([[real, -imaginary], [imaginary, real]]))
