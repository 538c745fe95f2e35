"""Functions V = x' P(theta) x of a model whose parameters are known functions of an angle theta
that turns at a known speed omega, in exact arithmetic.

p_i = mean + sum a_k cos(k theta) + b_k sin(k theta), and P has the same form with matrices; then

    [A'P + PA + omega dP/dtheta + C'C, PB + C'D; *, D'D - level I] < 0,  P > 0

at every theta. With q = tan(theta/2) the cosine is (1 - q^2)/(1 + q^2) and the sine 2 q/(1 + q^2),
so that each inequality, times a power of 1 + q^2, is a polynomial in q. -1 <= q <= 1 is the half of
the circle around theta = 0; the other half is the same with the odd harmonics of other sign.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from math import comb
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.definite import negative_definite_exactly
from synthesis.numerics.polynomial.exact import exact, rational
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.program.expression import block


class Turning(NamedTuple):
    """A, B, C, D by Bernstein coefficients over the box of the parameters, `ranges` (m, 2) of it,
    the parameters' `motion` (m, 1 + 2 K): mean, cosines and sines in turn; omega, rad/s.
    """

    matrices: tuple[Array, Array, Array, Array]
    ranges: Array
    motion: Array
    omega: float

    def exactly(self) -> Turning:
        """Return the same with rationals."""
        number = rational()
        A, B, C, D = (exact(M, number) for M in self.matrices)
        omega: Any = number(self.omega)
        return Turning((A, B, C, D), exact(self.ranges, number), exact(self.motion, number), omega)


class Half:
    """Functions of theta on one half of the circle, `side` 1 around 0 and -1 around pi, as
    polynomials in q; in the arithmetic of `zero`.
    """

    def __init__(self, side: int, zero: Any):
        self.side, self.zero = side, zero
        one = zero + 1
        self.box = ((-one, one),)
        # Bernstein coefficients of degree two over -1 <= q <= 1
        self.below = self._scalar([2, 0, 2])
        self.cosine, self.sine = self._scalar([0, 2, 0]), self._scalar([-2, 0, 2])

    def _scalar(self, coefficients: Sequence[int]) -> PolynomialMatrix:
        c = np.array(coefficients)[:, None, None] + self.zero
        return PolynomialMatrix(self.box, c)

    def known(self, M: Any) -> PolynomialMatrix:
        """Return a constant."""
        return PolynomialMatrix.constant(np.asarray(M) + self.zero, self.box)

    def power(self, of: PolynomialMatrix, k: int) -> PolynomialMatrix:
        """Return a power of a scalar."""
        return reduce(lambda a, b: a @ b, [of] * k, self.known([[1]]))

    def harmonics(self, most: int) -> list[tuple[PolynomialMatrix, PolynomialMatrix]]:
        """Return numerators of cos k theta and sin k theta over (1 + q^2)^most, k = 0 to most."""
        cosine, sine = self.known([[1]]), self.known([[0]])
        every = []
        for k in range(most + 1):
            rest = self.power(self.below, most - k)
            sign = self.side**k
            every.append((cosine @ rest * sign, sine @ rest * sign))
            cosine, sine = (
                cosine @ self.cosine - sine @ self.sine,
                sine @ self.cosine + cosine @ self.sine,
            )
        return every

    def times(self, M: Any, factor: PolynomialMatrix) -> Any:
        """Return a matrix of polynomials, known or not, times a scalar polynomial."""
        n = M.shape[1]
        wide = PolynomialMatrix(factor.box, factor.coefficients * np.eye(n, dtype=int))
        return M @ wide

    def series(self, terms: Sequence[Any]) -> Any:
        """Return the numerator of terms[0] + terms[1] cos + terms[2] sin + ... over (1 + q^2)^K."""
        most = len(terms) // 2
        basis = self.harmonics(most)
        total = self.times(terms[0], basis[0][0])
        for k in range(1, most + 1):
            total = total + self.times(terms[2 * k - 1], basis[k][0])
            total = total + self.times(terms[2 * k], basis[k][1])
        return total

    def composed(self, own: Turning) -> tuple[list[PolynomialMatrix], int]:
        """Return numerators of A, B, C, D along the motion over (1 + q^2)^a, and a."""
        degrees = [max(M.shape[i] for M in own.matrices) - 1 for i in range(len(own.ranges))]
        harmonics = own.motion.shape[1] // 2
        functions = []
        for (low, high), terms in zip(own.ranges, own.motion, strict=True):
            over = self.power(self.below, harmonics)
            u = self.series([self.known([[v]]) for v in terms]) - over * low
            functions.append((u * (1 / (high - low)), over - u * (1 / (high - low))))
        found = []
        for M in own.matrices:
            total = None
            for place in np.ndindex(*M.shape[:-2]):
                factor = self.known([[1]])
                for (up, down), i, d, most in zip(
                    functions, place, (k - 1 for k in M.shape[:-2]), degrees, strict=True
                ):
                    factor = factor @ self.power(up, i) @ self.power(down, d - i) * comb(d, i)
                    factor = factor @ self.power(self.below, harmonics * (most - d))
                term = self.times(self.known(M[place]), factor)
                total = term if total is None else total + term
            found.append(total)
        return found, harmonics * sum(degrees)


def slopes(terms: Sequence[Any], omega: Any) -> list[Any]:
    """Return the terms of the derivative of a series by time."""
    out = [terms[0] * (omega * 0)]
    for k in range(1, len(terms) // 2 + 1):
        out += [terms[2 * k] * (omega * k), terms[2 * k - 1] * (-omega * k)]
    return out


def inequalities(own: Turning, P: Sequence[Any], level: Any, half: Half) -> Iterator[Any]:
    """Yield what must be negative definite on a half: -P, then the fall of V. P are the terms of a
    series, `level` a number or an unknown (nu, nu).
    """
    (A, B, C, D), a = half.composed(own)
    m = len(P) // 2
    V, slope = half.series(P), half.series(slopes(P, own.omega))
    yield half.series([each * -1 for each in P])
    whole = max(m + a, 2 * a)

    def up(M: Any, power: int) -> Any:
        return half.times(M, half.power(half.below, whole - power))

    move = up(V @ A, m + a)
    top = move + move.T + up(slope, m) + up(C.T @ C, 2 * a)
    if not B.shape[1]:
        yield top
        return
    side = up(V @ B, m + a) + up(C.T @ D, 2 * a)
    last = up(D.T @ D, 2 * a) - up(level, 0)
    yield block([[top, side], [side.T, last]])


def holds(own: Turning, P: Array, gain: float) -> bool:
    """Whether the terms P (1 + 2 K, n, n) prove this gain, or stability of a model without inputs;
    in rational arithmetic.
    """
    if gain < 0 or not np.array_equal(P, np.swapaxes(P, -1, -2)):
        return False  # of P lower triangles alone are read below
    number: Any = rational()
    exactly, terms = own.exactly(), exact(P, number)
    for side in (1, -1):
        half = Half(side, number(0))
        each = [half.known(M) for M in terms]
        eye = np.eye(own.matrices[1].shape[-1], dtype=int) * number(float(gain)) ** 2
        forms = inequalities(exactly, each, half.known(eye), half)
        if not all(negative_definite_exactly(form) for form in forms):
            return False
    return True
