"""What must be negative definite over the box, as polynomial matrices in p, linear in P.

Continuous time, V = x' P(p) x, at every corner nu of the box of rates, Pdot = sum_i nu_i dP/dp_i:

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
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from synthesis.certificate import Kind
from synthesis.polynomial.exact import Number, exact
from synthesis.polynomial.matrix import PolynomialMatrix, block
from synthesis.polynomial.pieces import Pieces
from synthesis.polynomial.regions import Region, model_on, now, successor
from synthesis.proof.drift import Drift

Array = np.ndarray


class Demand(NamedTuple):
    """What is asked: `kind`; the `drift` of the parameters; `shift`: alpha of a decay rate, 1/s,
    else 0.
    """

    kind: Kind
    drift: Drift
    shift: float = 0.0

    @property
    def rates(self) -> tuple[float, ...]:
        """Bounds on the rates, in units of the parameters per second."""
        return self.drift.rates


class Pair(NamedTuple):
    """P on the segment of p and, in discrete time, on the one of p(k+1)."""

    here: PolynomialMatrix
    there: PolynomialMatrix


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
        moving = [step > 0 for step in demand.drift.steps(model.dt, P.here.degrees)]
        there = successor(P.there, region, number, moving)
        unit = there.box[m:]
        A, B, C, D, here = (M.extend(unit) for M in (A, B, C, D, here))
        growth = number(math.exp(2.0 * demand.shift * model.dt))
        top = there.congruence(A) * growth - here
        side, corner = A.T @ there @ B, there.congruence(B)
        drifts: list[Any] = [None]
    else:
        PA = here @ A
        top = PA + PA.T + here * (2 * number(demand.shift)) if demand.shift else PA + PA.T
        side, corner = here @ B, B.T @ B * 0
        slopes = {i: here.derivative(i) for i in demand.drift.moving(here.degrees)}
        drifts = [
            sum((slopes[i] * number(v) for i, v in rest), slopes[first] * number(speed))
            for (first, speed), *rest in demand.drift.directions(here.degrees)
        ] or [None]
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
