"""What must be negative definite over the box, as polynomial matrices in p, linear in P.

Continuous time, V = x' P(p) x, at every corner nu of the box of rates, Pdot = sum_i nu_i dP/dp_i,
nu_i = p_j where the rate of p_i is p_j:

    L2 gain          [A'P + PA + Pdot + C'C   PB + C'D; .   D'D - g I] < 0
    energy to peak   [A'P + PA + Pdot   PB; .   -I] < 0  and  [P   C'; .   g I] > 0, D = 0
    decay rate       A'P + PA + Pdot + 2 alpha P < 0

discrete time, P+ = P(p(k+1)):

    L2 gain          [A'P+A - P + C'C   A'P+B + C'D; .   B'P+B + D'D - g I] < 0
    energy to peak   [A'P+A - P   A'P+B; .   B'P+B - I] < 0  and  [P 0 C'; 0 I D'; C D g I] > 0
    decay rate       A'P+A exp(2 alpha dt) - P < 0

and P > 0; gain^2 = g. Sources: Wu, Yang, Packard and Becker, Int. J. Robust and Nonlinear Control 6
(1996), theorem 3.1; Rotea, "The generalized H2 control problem", Automatica 29 (1993); Boyd, El
Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and Control Theory" (1994),
sections 5.1 and 6.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.certificate import Kind
from synthesis.polynomial.exact import Number, exact
from synthesis.polynomial.matrix import PolynomialMatrix, block
from synthesis.polynomial.motion import Drift, Motion
from synthesis.polynomial.pieces import Pieces
from synthesis.polynomial.regions import Region, model_on, now, successor

Array = np.ndarray


class Demand(NamedTuple):
    """What is asked: `kind`; how p moves; `shift`: alpha of a decay rate, 1/s, else 0.

    `time`: seconds in the unit of time of the model in continuous time.
    """

    kind: Kind
    motion: Motion
    shift: float = 0.0
    time: float = 1.0

    @property
    def rates(self) -> tuple[float, ...]:
        """Largest rate of each parameter, in its unit per second."""
        return self.motion.rates

    def moving(self, degrees: Sequence[int]) -> list[bool]:
        """Which parameters move in a way that matters to P."""
        return [bool(d) and rate > 0 for d, rate in zip(degrees, self.rates, strict=True)]

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


class Pair(NamedTuple):
    """P on the segment of p and, in discrete time, on the one of p(k+1)."""

    here: PolynomialMatrix
    there: PolynomialMatrix


def growth_of(alpha: float, dt: float) -> float:
    """exp(2 alpha dt) or a few units in the last place more: what is proven with it holds for
    alpha, however exp and its argument are rounded.
    """
    if alpha == 0.0:
        return 1.0
    exponent = 2.0 * alpha * dt
    exponent += 4.0 * math.ulp(exponent)
    return math.exp(exponent) * (1.0 + 8.0 * math.ulp(1.0))


def positivity(P: PolynomialMatrix) -> PolynomialMatrix:
    """-P, which must be negative definite."""
    return -P


def decrease(
    model: Pieces, region: Region, P: Pair, demand: Demand, number: Number
) -> Iterator[PolynomialMatrix]:
    """The dissipation inequalities on a region, without the term in g; one a corner of the box of
    rates.
    """
    m = len(model.parameters)
    A, B, C, D = model_on(model, region, number)
    here = now(P.here, region, number)
    gain = demand.kind == "l2 gain"
    channels = demand.kind in ("l2 gain", "energy-to-peak gain")
    if model.dt is not None:
        moving = demand.moving(P.here.degrees)
        there = successor(P.there, region, number, moving)
        unit = there.box[m:]
        A, B, C, D, here = (M.extend(unit) for M in (A, B, C, D, here))
        growth = number(growth_of(demand.shift, model.dt))
        top = there.congruence(A) * growth - here
        side, corner = A.T @ there @ B, there.congruence(B)
        drifts: list[Any] = [None]
    else:
        PA = here @ A
        top = PA + PA.T + here * (2 * number(demand.shift)) if demand.shift else PA + PA.T
        side, corner = here @ B, B.T @ B * 0
        drifts = [
            _slope(here, drift, demand.time, number)
            for drift in demand.motion.drifts(demand.moving(here.degrees))
        ]
    if gain:
        top, side, corner = top + C.T @ C, side + C.T @ D, corner + D.T @ D
    for drift in drifts:
        whole = top if drift is None else top + drift
        yield block([[whole, side], [side.T, corner]]) if channels else whole


def peak(model: Pieces, region: Region, P: PolynomialMatrix, number: Number) -> PolynomialMatrix:
    """The second inequality of the energy-to-peak gain, negated and without the term in g."""
    _, _, C, D = model_on(model, region, number)
    here = now(P, region, number)
    if model.dt is None:
        return -block([[here, C.T], [C, C @ C.T * 0]])
    nx, nu, _ = model.sizes
    eye = PolynomialMatrix.constant(exact(np.eye(nu), number), here.box)
    zero = PolynomialMatrix.constant(exact(np.zeros((nx, nu)), number), here.box)
    return -block([[here, zero, C.T], [zero.T, eye, D.T], [C, D, C @ C.T * 0]])


def _slope(
    here: PolynomialMatrix, drift: Drift, time: float, number: Number
) -> PolynomialMatrix | None:
    """dP/dt while p moves so; None where it does not."""
    total = None
    for i, (rate, j) in enumerate(zip(drift.rates, drift.ties, strict=True)):
        if rate == 0 and j is None:
            continue
        term = here.derivative(i)
        term = term * (number(rate) * number(time)) if j is None else _times(term, j) * number(time)
        total = term if total is None else total + term
    return total


def _times(F: PolynomialMatrix, axis: int) -> PolynomialMatrix:
    """The polynomial times the parameter of that axis."""
    low, high = F.box[axis]
    shape = [1] * len(F.box)
    shape[axis] = 2
    eye = np.eye(F.shape[0], dtype=int)
    ends = np.stack([low * eye, high * eye]).reshape(*shape, *eye.shape)
    return F @ PolynomialMatrix(F.box, ends)
