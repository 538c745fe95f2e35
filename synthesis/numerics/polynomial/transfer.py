"""The transfer matrix of a linear model as polynomials with integer coefficients, exact."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.positive import hurwitz, product


class Gaussian(NamedTuple):
    """N/(gain d) at one frequency: real and imaginary parts of N (nz, nw) and of d, integers."""

    real: Array
    imaginary: Array
    below: tuple[int, int]


class Transfer(NamedTuple):
    """C (s - A)^-1 B + D = N(s)/(gain d(s)): the coefficients of N (n + 1, nz, nw) and d (n + 1,),
    ascending, integers; s in units of 2^`pace` rad/s. Of a sampled model s = (z - 1)/(z + 1).
    """

    above: Array
    below: Array
    gain: int
    pace: int

    @classmethod
    def of(cls, A: Array, B: Array, C: Array, D: Array, sampled: bool = False) -> Transfer:
        """Return the transfer matrix of doubles, or of rationals in object arrays."""
        A, B, C, D = (rationals(M) for M in (A, B, C, D))
        n = len(A)
        units, pace = _units(A, sampled)
        grow = np.array([Fraction(float(u)) for u in units], dtype=object)
        rate: Any = Fraction(2) ** (0 if sampled else -pace)
        A, B, C = A * grow / grow[:, None] * rate, B / grow[:, None] * rate, C * grow
        (A, alpha), (B, beta), (C, gamma), (D, delta) = map(_whole, (A, B, C, D))
        p = characteristic(A)
        markov, power = [], B
        for _ in range(n):
            markov.append(C @ power if n else 0)
            power = A @ power
        # (alpha s - A)^-1 = adj/p(alpha s)
        below = np.array([p[k] * alpha**k for k in range(n + 1)], dtype=object)
        above = [beta * gamma * D * below[n]]
        for k in range(n - 1, -1, -1):
            own = sum(p[i] * markov[i - k - 1] for i in range(k + 1, n + 1))
            above.append(beta * gamma * D * below[k] + delta * alpha ** (k + 1) * own)
        found = cls(np.array(above[::-1], dtype=object), below, beta * gamma * delta, 0)
        return found._tustin(pace) if sampled else found._replace(pace=pace)

    def _tustin(self, pace: int) -> Transfer:
        """Return the transfer matrix with z = (1 + s)/(1 - s), s in units of 2^`pace`."""
        n = len(self.below) - 1
        powers = [product([1], *[[1, 1]] * k, *[[1, -1]] * (n - k)) for k in range(n + 1)]
        size = np.array(
            [1 << (pace * k if pace >= 0 else -pace * (n - k)) for k in range(n + 1)], dtype=object
        )
        change = size[:, None] * np.array(powers, dtype=object).reshape(n + 1, n + 1).T
        above = np.tensordot(change, self.above, axes=1)
        return self._replace(above=above, below=change @ self.below, pace=pace)

    def scaled(self, rows: Array, columns: Array) -> Transfer:
        """Return it with rows (nz,) and columns (nw,) times these rationals."""
        (rows, a), (columns, b) = _whole(rationals(rows)), _whole(rationals(columns))
        return self._replace(above=self.above * rows[:, None] * columns, gain=self.gain * a * b)

    @property
    def stable(self) -> bool:
        """Whether all roots of d lie left of the axis: those of the whole model do then."""
        return hurwitz(self.below)

    def at(self, v: Fraction | int) -> Gaussian:
        """Return the response at the frequency v, in units of 2^`pace` rad/s, times one factor."""
        n, v = len(self.below) - 1, Fraction(v)
        size = [v.numerator**k * v.denominator ** (n - k) for k in range(n + 1)]
        parts: list[list[Any]] = []
        for c in (self.above, self.below):
            real, imaginary = 0 * c[0], 0 * c[0]
            for k in range(n + 1):
                term = c[k] * (size[k] if k % 4 < 2 else -size[k])
                real, imaginary = (
                    (real + term, imaginary) if k % 2 == 0 else (real, imaginary + term)
                )
            parts.append([real, imaginary])
        (real, imaginary), (a, b) = parts
        return Gaussian(real, imaginary, (a, b))

    def at_infinity(self) -> Gaussian:
        """Return the response at infinite frequency."""
        return Gaussian(self.above[-1], 0 * self.above[-1], (self.below[-1], 0))

    def response(self, omega: float) -> Array:
        """Return the response (nz, nw) at a frequency, rad/s, each part right to a few last
        places."""
        if math.isinf(omega):
            found = self.at_infinity()
        else:
            found = self.at(Fraction(omega) / Fraction(2) ** self.pace)
        (a, b), size = found.below, 0
        size = self.gain * (a * a + b * b)
        real = found.real * a + found.imaginary * b
        imaginary = found.imaginary * a - found.real * b
        part: Callable[[Any], float] = lambda v: float(Fraction(int(v), int(size)))  # noqa: E731
        turn = np.frompyfunc(part, 1, 1)
        return np.asarray(turn(real) + 1j * turn(imaginary), dtype=complex)


def rationals(M: Any) -> Array:
    """Return doubles, integers or rationals as Fractions."""
    M = np.asarray(M)
    out = np.empty(M.shape, dtype=object)
    out.ravel()[:] = [Fraction(v) for v in M.ravel().tolist()]
    return out


def inverse(M: Array) -> Array:
    """Return the inverse of a matrix of rationals; raise `InputError` where it is singular."""
    n = len(M)
    whole = np.hstack([M, rationals(np.eye(n))])
    for k in range(n):
        pivot = next((i for i in range(k, n) if whole[i, k] != 0), None)
        if pivot is None:
            raise InputError("the loop is not well posed: I - K D is singular")
        whole[[k, pivot]] = whole[[pivot, k]]
        whole[k] = whole[k] / whole[k, k]
        for i in range(n):
            if i != k:
                whole[i] = whole[i] - whole[i, k] * whole[k]
    return whole[:, n:]


def _whole(M: Array) -> tuple[Array, int]:
    """Return (integers, k): rationals times their least common denominator k."""
    k = math.lcm(*(v.denominator for v in M.ravel().tolist()))
    out = np.empty(M.shape, dtype=object)
    out.ravel()[:] = [int(v * k) for v in M.ravel().tolist()]
    return out, k


def _units(A: Array, sampled: bool) -> tuple[Array, int]:
    """Return units of the states, powers of two, and the power of two next to the mean pole."""
    if not len(A):
        return np.ones(0), 0
    rounded = A.astype(float)
    _, (units, _) = linalg.matrix_balance(rounded, permute=False, separate=True)
    poles = np.linalg.eigvals(rounded)
    if sampled:
        poles = (poles - 1) / np.where(poles == -1, 1.0, poles + 1)
    size = np.abs(poles)[np.abs(poles) > 0]
    pace = round(float(np.log2(size).mean())) if len(size) else 0
    return units, pace


def characteristic(A: Array) -> list[int]:
    """Return the coefficients, ascending, of det(s - A) of integers."""
    try:
        from flint import fmpz_mat  # type: ignore[import-not-found]
    except ImportError:
        return _leverrier(A)
    return [int(v) for v in fmpz_mat(A.tolist()).charpoly().coeffs()] if len(A) else [1]


def _leverrier(A: Array) -> list[int]:
    n = len(A)
    unit = np.zeros((n, n), dtype=object)
    unit[range(n), range(n)] = 1
    found, M = [1], unit
    for k in range(1, n + 1):
        M = A @ M
        found.append(-int(np.trace(M)) // k)
        M = M + found[-1] * unit
    return found[::-1]
