"""Functions V = x' P(delta) x of an LFT whose parameters move at limited rates.

The LFT closes w = Delta z, z = Cz x + Dzw w + Dzu u, so that N(delta) (x, w, u) = 0 with N =
[-Delta Cz, I - Delta Dzw, -Delta Dzu], a polynomial although A(delta), ... are rational. By
Finsler's lemma, with a matrix F(delta) of polynomials and every extreme rate of delta,

    2 x' P dx/dt + x' dP/dt x + |y|^2 - level |u|^2 + 2 (x, w, u)' F N (x, w, u) < 0,  P > 0

for all (x, w, u) other than zero bounds the gain, and shows that the loop is well posed: where x
and u are zero it leaves no w with N w = 0. (Coutinho, Bazanella, Trofino and Silva, Int. J. Robust
and Nonlinear Control 14, 2004.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from symheli.lpv.lft_matrices import LFTMatrices, parts
from symheli.values.arrays import Array
from synthesis.numerics.polynomial.definite import negative_definite_exactly
from synthesis.numerics.polynomial.exact import exact, rational
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.regions import convert

Box = tuple[tuple[Any, Any], ...]


class Parts(NamedTuple):
    """Rows of the LFT as functions of (x, w, u): dx/dt, z and y, with the sizes of the blocks."""

    moves: Array
    into: Array
    shows: Array
    sizes: tuple[int, ...]
    states: int
    inputs: int

    @classmethod
    def of(cls, lft: LFTMatrices) -> Parts:
        """Return the rows of an LFT."""
        n, nu = len(lft.states), len(lft.inputs)

        def across(left: Array, right: Array) -> Array:
            return np.hstack([right[:, :n], left, right[:, n:]])

        return cls(
            across(lft.M21[:n], lft.M22[:n]),
            across(lft.M11, lft.M12),
            across(lft.M21[n:], lft.M22[n:]),
            tuple(each.size for each in lft.blocks),
            n,
            nu,
        )

    def exactly(self) -> Parts:
        """Return the same rows as rationals."""
        number = rational()
        moves, into, shows = (exact(M, number) for M in (self.moves, self.into, self.shows))
        return self._replace(moves=moves, into=into, shows=shows)


def box_of(sizes: Sequence[Any]) -> Box:
    """Return the box of the normalised parameters."""
    return ((-1.0, 1.0),) * len(sizes)


def constraint(own: Parts, box: Box) -> PolynomialMatrix:
    """Return N(delta), (order, n + order + nu)."""
    m = len(own.sizes)
    order, width = own.into.shape
    plain = own.into * 0
    plain[:, own.states : own.states + order] += np.eye(order, dtype=int)
    found = np.zeros((*(2,) * m, order, width), dtype=own.into.dtype)
    for corner in product((0, 1), repeat=m):
        found[corner] = plain
        for rows, end in zip(parts(own.sizes), corner, strict=True):
            found[corner][rows] -= (2 * end - 1) * own.into[rows]
    return PolynomialMatrix(box, found)


def inequalities(own: Parts, P: Any, F: Any, rates: Sequence[Any], level: Any) -> Iterator[Any]:
    """Yield what must be negative definite, one for every corner of the rates (1/s) of delta; P and
    F are polynomials or unknowns of a program, `level` a polynomial (nu, nu).
    """
    box: Box = P.box
    n, nu, width = own.states, own.inputs, own.moves.shape[1]

    def known(M: Array) -> PolynomialMatrix:
        return PolynomialMatrix.constant(M, box)

    zero = own.moves[0, 0] * 0
    every = np.eye(width, dtype=int) + zero
    state = every[:n]
    moved = known(state.T) @ (P @ known(own.moves))
    held = F @ constraint(own, box)
    form = moved + moved.T + held + held.T + known(own.shows.T @ own.shows)
    if nu:
        last = every[width - nu :]
        form = form - known(last.T) @ (level @ known(last))
    moving = [i for i, rate in enumerate(rates) if rate]
    for signs in product((-1, 1), repeat=len(moving)):
        total = form
        for i, sign in zip(moving, signs, strict=True):
            along = known(state.T) @ (P.derivative(i) @ known(state))
            total = total + along * (sign * rates[i])
        yield total


def holds(lft: LFTMatrices, P: Array, F: Array, gain: float) -> bool:
    """Whether P and F, by Bernstein coefficients on [-1, 1]^m, prove this gain: in rational
    arithmetic.
    """
    if gain < 0 or not np.array_equal(P, np.swapaxes(P, -1, -2)):
        return False  # of P lower triangles alone are read below
    number: Any = rational()
    own, box = Parts.of(lft).exactly(), box_of(lft.blocks)
    rates = delta_rates(lft)
    for i, rate in enumerate(rates):
        if rate is None and P.shape[i] > 1:
            return False
    V, held = (convert(PolynomialMatrix(box, M), number) for M in (P, F))
    if not negative_definite_exactly(-V):
        return False
    eye = np.eye(own.inputs, dtype=int) * number(float(gain)) ** 2 + number(0)
    bound = PolynomialMatrix.constant(eye, V.box)
    limits = [number(0 if rate is None else rate) for rate in rates]
    return all(
        negative_definite_exactly(each) for each in inequalities(own, V, held, limits, bound)
    )


def delta_rates(lft: LFTMatrices) -> list[Fraction | None]:
    """Return the largest rate of every normalised parameter, 1/s; None: it may jump."""
    found: list[Fraction | None] = []
    for each in lft.blocks:
        s = each.scheduling
        width = (Fraction(s.high) - Fraction(s.low)) / 2
        found.append(None if s.limit == float("inf") else Fraction(s.limit) / width)
    return found
