"""Functions V of the modes of a switched model that fall along every motion, in exact arithmetic.

V = x' P_i(t) x in mode i, t since it was entered. P_i(t) moves up to the dwell time T, piecewise
cubic in t (sampled: from sample to sample), and is constant afterwards; a jump x+ = J x from mode i
to j must not raise V:

    A'P + PA + dP/dt < 0  up to T;  A'P + PA + 2 lambda P < 0  afterwards;  J' P_j(0) J < mu P_i(T)

where mode j may follow mode i; sampled A'P(t+1) A - P(t) < 0 and A'PA - (1 - lambda) P < 0. With
P_i(T) > 0 and mu = 1 the model is stable for every signal that stays so long in each mode
(Allerhand and Shaked, IEEE Trans. Automatic Control 56, 2011; of fixed A the condition of Geromel
and Colaneri, SIAM J. Control and Optimization 45, 2006). With P_i constant it is for every signal
whose average dwell time is above ln(mu) / (2 lambda) (Hespanha and Morse, CDC 1999; Liberzon,
Switching in Systems and Control, 2003, theorem 3.2).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.numerics.polynomial.definite import negative_definite_exactly
from synthesis.numerics.polynomial.exact import exact, positive_definite, rational
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.regions import convert

DEGREE = 3
"""Degree of P between two knots of continuous time."""


class Modes(NamedTuple):
    """A(p) of every mode in polynomial pieces, the jumps {(from, to): J}, and the sample period, s;
    None: continuous.
    """

    A: tuple[tuple[PolynomialMatrix, ...], ...]
    jumps: Mapping[tuple[int, int], Array]
    dt: float | None


def holds(
    modes: Modes,
    P: Sequence[Array],
    lengths: Sequence[float] | Array,
    decay: float = 0.0,
    growth: float = 1.0,
) -> bool:
    """Whether these P prove it, at `decay` lambda and `growth` mu: in rational arithmetic on the
    doubles given.

    P[i] (3 K + 1, n, n) are the Bernstein coefficients of mode i on K segments of these `lengths`,
    s; sampled (samples + 1, n, n) its values.
    """
    if any(length <= 0 for length in lengths):
        return False
    if not all(np.array_equal(M, np.swapaxes(M, -1, -2)) for M in P):
        return False  # lower triangles alone are read below
    number = rational()
    own = [exact(each, number) for each in P]
    steps = [number(float(length)) for length in lengths]
    if not all(positive_definite(each[-1]) for each in own):
        return False
    for (i, j), J in modes.jumps.items():
        jump = exact(J, number)
        if not positive_definite(number(growth) * own[i][-1] - jump.T @ own[j][0] @ jump):
            return False
    return all(
        negative_definite_exactly(change)
        for pieces, each in zip(modes.A, own, strict=True)
        for piece in pieces
        for change in _changes(convert(piece, number), each, steps, modes.dt, number(decay))
    )


def _changes(
    A: PolynomialMatrix, P: Array, lengths: Sequence[Any], dt: float | None, decay: Any
) -> list[PolynomialMatrix]:
    """Return what must be negative definite on a piece of a mode."""
    last = PolynomialMatrix.constant(P[-1], A.box)
    if dt is not None:
        each = [PolynomialMatrix.constant(M, A.box) for M in P]
        moving = [each[k + 1].congruence(A) - each[k] for k in range(len(each) - 1)]
        return [last.congruence(A) - last + last * decay, *moving]
    found = [_sum(last @ A) + last * (decay + decay)]
    unit = ((decay * 0, decay * 0 + 1),)
    for k, length in enumerate(lengths):
        c = P[DEGREE * k : DEGREE * (k + 1) + 1]
        own = PolynomialMatrix((*A.box, *unit), c.reshape(*(1,) * len(A.box), *c.shape))
        slope = own.derivative(len(A.box)) * (1 / length)
        found.append(_sum(own @ A.extend(unit)) + slope)
    return found


def _sum(F: PolynomialMatrix) -> PolynomialMatrix:
    return F + F.T


def long_enough(
    seconds: float, lengths: Sequence[float] | Array, decay: float, growth: float, dt: float | None
) -> bool:
    """Whether P on segments of these `lengths` proves a dwell time of so many seconds; without
    segments, whether `decay` and `growth` prove it as an average: mu < exp(2 lambda T), sampled mu
    < (1 - lambda)^(-T/dt). In rational arithmetic.
    """
    if not 0 < seconds < math.inf:
        return False
    T, period = Fraction(seconds), None if dt is None else Fraction(dt)
    if len(lengths):
        whole = sum(map(Fraction, lengths)) if period is None else len(lengths) * period
        return (decay, growth) == (0.0, 1.0) and whole <= T
    if not (0 < decay < math.inf and 1 <= growth < math.inf):
        return False
    if period is None:
        return Fraction(growth) < _exponential(2 * Fraction(decay) * T)
    if decay >= 1:
        return False
    per_sample = Fraction(-math.log1p(-decay) * (1 - 1e-15))
    below = _exponential(per_sample, above=True) * (1 - Fraction(decay)) <= 1
    return below and Fraction(growth) < _exponential(per_sample * T / period)


TERMS = 60
"""Terms of the exponential series beyond twice its argument: the rest is below 2^-60 of it."""


def _exponential(x: Fraction, above: bool = False) -> Fraction:
    """A rational below exp(x), x >= 0, or above it: the series, and a bound of what it leaves."""
    x = Fraction(math.floor(x * 2**80) + above, 2**80)  # few digits keep the series fast
    term = total = Fraction(1)
    count = TERMS + 2 * math.ceil(x)
    for k in range(1, count):
        term = term * x / k
        total += term
    return total + 2 * term if above else total
