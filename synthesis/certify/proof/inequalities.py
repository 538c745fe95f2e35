"""The polynomial matrices in p, linear in P, that must be negative definite over the box.

Continuous time, V = x' P(p) x, at every corner nu of the box of rates, Pdot = sum_i nu_i dP/dp_i,
nu_i = p_j where the rate of p_i is p_j:

    L2 gain          [A'P + PA + Pdot + C'C   PB + C'D; .   D'D - g I] < 0
    supply rate      [A'P + PA + Pdot   PB; .   0] - [C D; 0 I]'[q I  s I; s I  r I][C D; 0 I] < 0
    energy to peak   [A'P + PA + Pdot   PB; .   -I] < 0  and  [P   C'; .   g I] > 0, D = 0
    H2               the first of these  and  [diag(P, .., P)   (c_1, .., c_ny)'; .   g] > 0, D = 0
    decay rate       A'P + PA + Pdot + 2 alpha P < 0

discrete time, P+ = P(p(k+1)):

    L2 gain          [A'P+A - P + C'C   A'P+B + C'D; .   B'P+B + D'D - g I] < 0
    energy to peak   [A'P+A - P   A'P+B; .   B'P+B - I] < 0  and  [P 0 C'; 0 I D'; C D g I] > 0
    H2               the first of these  and  the second of H2 for diag(P, I) and rows (c_i, d_i)
    decay rate       A'P+A exp(2 alpha dt) - P < 0

and P > 0; gain^2 = g; q, s, r are affine in g, see `statement.kind`, in discrete time too; c_i is
row i of C. P^-1 bounds the variance of the state in white noise, and g is then at least the trace
of C P^-1 C'. Sources: Wu, Yang, Packard and Becker, Int. J. Robust and Nonlinear Control 6 (1996),
theorem 3.1; Rotea, "The generalized H2 control problem", Automatica
29 (1993); Boyd, El Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and
Control Theory" (1994), sections 5.1 and 6.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from symheli.values.arrays import Array
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import L2_GAIN, Supply
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.certify.statement.spline import Lyapunov, MemoryLyapunov, SplineLyapunov
from synthesis.numerics.polynomial.exact import Number, exact, growth_of
from synthesis.numerics.polynomial.matrix import PolynomialMatrix, block
from synthesis.numerics.polynomial.motion import Drift, Motion
from synthesis.numerics.polynomial.pieces import Pieces
from synthesis.numerics.polynomial.regions import Region, convert, model_on, now, regions, successor
from synthesis.numerics.polynomial.symmetric_power import generator, null_matrix


class Pair(NamedTuple):
    """P on the segment of p and, in discrete time, on the one of p(k+1)."""

    here: PolynomialMatrix
    there: PolynomialMatrix


def positivity(P: PolynomialMatrix) -> PolynomialMatrix:
    """Return -P, which must be negative definite."""
    return -P


def decrease(
    model: Pieces, region: Region, P: Pair, demand: Demand, number: Number, level: Any = 0
) -> Iterator[PolynomialMatrix]:
    """Yield the dissipation inequalities on a region at a level g of the supply rate; one a corner
    of the box of rates.
    """
    supply = demand.supply(level, number)
    m = len(model.parameters)
    system, here = model_on(model, region, number), now(P.here, region, number)
    moving = demand.moving(here.degrees)
    if model.dt is not None:
        there = successor(P.there, region, number, moving)
        system, here = [M.extend(there.box[m:]) for M in system], here.extend(there.box[m:])
        growth = number(growth_of(demand.shift, model.dt))
        yield from dissipation(system, here, supply, demand.kind.driven, after=there * growth)
        return
    drifts = [
        slope_along(here, drift, demand.time, number) for drift in demand.motion.drifts(moving)
    ]
    if demand.shift:
        rising = here * (2 * number(demand.shift))
        drifts = [rising if drift is None else rising + drift for drift in drifts]
    yield from dissipation(system, here, supply, demand.kind.driven, drifts)


def dissipation(
    system: Sequence[PolynomialMatrix],
    P: PolynomialMatrix,
    supply: Supply | None,
    driven: bool,
    drifts: Sequence[PolynomialMatrix | None] = (None,),
    after: PolynomialMatrix | None = None,
) -> Iterator[PolynomialMatrix]:
    """Yield the blocks of the table above for the `system` A, B, C, D, of the states alone where it
    is not `driven`; one for each of the `drifts` dP/dt (None: 0), or in discrete time for P+ =
    `after`.
    """
    A, B, C, D = system
    if after is not None:
        top, side, corner = after.congruence(A) - P, A.T @ after @ B, after.congruence(B)
    else:
        PA = P @ A
        top, side, corner = PA + PA.T, P @ B, B.T @ B * 0
    q, s, r = supply or (0, 0, 0)
    if q:
        top, side, corner = top - C.T @ C * q, side - C.T @ D * q, corner - D.T @ D * q
    if s:
        side, corner = side - C.T * s, corner - (D + D.T) * s
    if r:
        corner = corner - PolynomialMatrix.constant(np.eye(B.shape[1], dtype=int) * r, B.box)
    for drift in drifts:
        whole = top if drift is None else top + drift
        yield block([[whole, side], [side.T, corner]]) if driven else whole


def output_form(
    model: Pieces, region: Region, P: PolynomialMatrix, demand: Demand, number: Number
) -> PolynomialMatrix:
    """Return the second inequality of the energy-to-peak or H2 gain, negated and without the term
    in g.
    """
    _, _, C, D = model_on(model, region, number)
    here = now(P, region, number)
    nx, nu, ny = model.sizes
    if model.dt is not None:
        eye = PolynomialMatrix.constant(exact(np.eye(nu), number), here.box)
        zero = PolynomialMatrix.constant(exact(np.zeros((nx, nu)), number), here.box)
        here, C = block([[here, zero], [zero.T, eye]]), block([[C, D]])
    if not demand.kind.facets.rows:
        return -block([[here, C.T], [C, C @ C.T * 0]])
    rows = [PolynomialMatrix(C.box, C.coefficients[..., i : i + 1, :]) for i in range(ny)]
    none = here * 0
    copies = [[here if i == j else none for j in range(ny)] + [row.T] for i, row in enumerate(rows)]
    return -block([*copies, [*rows, rows[0] @ rows[0].T * 0]])


class Form(NamedTuple):
    """A block with g = 0, and the positive weight of g, (1, 1)."""

    block: PolynomialMatrix
    weight: PolynomialMatrix


class Statement(NamedTuple):
    """The statement to verify for a model of one parameter: P, and the rate (units of p per
    second).

    `elevation` raises the degree of the Bernstein forms, which brings their coefficients closer to
    the values.
    """

    model: Pieces
    P: Lyapunov
    rate: float
    elevation: int = 0
    block: NormBounded | None = None

    @property
    def strict(self) -> int:
        """Number of rows of a block of the LMI without g."""
        return self.P.coefficients.shape[-1] + (0 if self.block is None else self.block.inputs)

    @property
    def meaningful(self) -> bool:
        """False where P varies with a p that may jump in continuous time: dV/dt is unbounded then.

        False also where this form of V is not written for the model: a memory or a higher order in
        discrete time or with channels, or a multiplier without a block and a block without one.
        """
        if (self.block is None) != (self.P.multiplier is None):
            return False
        if isinstance(self.P, MemoryLyapunov):
            return self.model.dt is None and math.isfinite(self.rate)
        if self.P.order > 1 and (self.model.dt is not None or any(self.model.sizes[1:])):
            return False
        return self.model.dt is not None or self.P.degree == 0 or math.isfinite(self.rate)

    def invariant(self, number: Number) -> bool:
        """Whether p, with its lag where P has one, stays in the region of the statement."""
        return not isinstance(self.P, MemoryLyapunov) or self.P.region.invariant(self.rate, number)


def lmi_polynomials(statement: Statement, number: Number) -> Iterator[Form]:
    """Yield every block over the whole range, with g = 0. `number` turns a double into the
    arithmetic of the proof.
    """
    P, used = statement.P, 0
    slack = (
        None
        if P.slack is None
        else null_matrix(exact(P.slack, number), statement.model.sizes[0], P.order)
    )
    for F, weight in _polynomials(statement, number):
        F = F.elevate((F.degrees[0] + statement.elevation, *F.degrees[1:]))
        if slack is not None:
            c = F.coefficients
            own = slack[used : used + len(c)]
            # where P carries too little of it the blocks stand as they are
            c, used = np.concatenate([c[: len(own)] + own, c[len(own) :]]), used + len(own)
            F = PolynomialMatrix(F.box, c)
        yield Form(F, weight.elevate(F.degrees))


def _polynomials(
    statement: Statement, number: Number
) -> Iterator[tuple[PolynomialMatrix, PolynomialMatrix]]:
    model, P, rate, _, channel = statement
    assert statement.meaningful  # noqa: S101 - checked by the callers
    ends = ((model.breaks[0][0], model.breaks[0][-1]),)
    demand = Demand(L2_GAIN, Motion(ends, (rate,), (None,)))
    one, own = np.array([[number(1.0)]]), _observed(model, P.order, channel)
    for region in regions(model, [P.knots], demand.motion, demand.moving([P.degree])):
        if isinstance(P, MemoryLyapunov):
            yield from _remembering(model_on(model, region, number), region, P, rate, number)
            continue
        pair = Pair(*(_of_states(P, j, number) for (j,) in (region.segment, region.next_segment)))
        supply = None if channel is None else _supply(model, region, P, channel, number)
        for F in decrease(own, region, pair, demand, number):
            if supply is not None:
                F = F + supply.extend(F.box[1:])
            yield F, PolynomialMatrix.constant(one, F.box)


def _of_states(P: SplineLyapunov, j: int, number: Number) -> PolynomialMatrix:
    """Return P on segment j, as a form in the states."""
    own = convert(_on_segment(P.knots, P.segment(j), j), number)
    if P.coordinates is None:
        return own
    return own.congruence(PolynomialMatrix.constant(exact(P.coordinates, number), own.box))


def _on_segment(knots: Array, coefficients: Array, j: int) -> PolynomialMatrix:
    return PolynomialMatrix(((float(knots[j]), float(knots[j + 1])),), coefficients)


def _observed(model: Pieces, order: int, channel: NormBounded | None) -> Pieces:
    """Return the model without the outputs v of a norm-bounded block; for `order` > 1 the linear
    system of the monomials.
    """
    if order == 1 and channel is None:
        return model
    y = slice(None, None if channel is None else -channel.outputs)
    models = {}
    for key, (A, B, C, D) in model.models.items():
        A, C, D = (
            PolynomialMatrix(A.box, M)
            for M in (
                generator(A.coefficients, order),
                C.coefficients[..., y, :],
                D.coefficients[..., y, :],
            )
        )
        if order > 1:
            N = A.shape[0]
            B, C = (PolynomialMatrix.constant(np.zeros(n), A.box) for n in ((N, 0), (0, N)))
        models[key] = (A, B, C, D)
    return model._replace(models=models)


def _supply(
    model: Pieces, region: Region, P: SplineLyapunov, channel: NormBounded, number: Number
) -> PolynomialMatrix:
    """Return lambda (bound^2 [G J H]'[G J H] - diag(0, I, 0)) on a region for a block d = Delta v,
    v = G x + J d + H u: the sum over its parts.
    """
    _, _, C, D = (M.T for M in model_on(model, region, number))
    (nx, nu, ny), bound = model.sizes, number(channel.bound)
    (j,), total = region.segment, None
    for (d, v), values in zip(channel.places(nx, ny), P.multiplier_segment(j).T, strict=True):
        rows = block([[PolynomialMatrix(M.box, M.coefficients[..., v])] for M in (C, D)])
        of_d = np.zeros((nx + nu, nx + nu))
        of_d[d, d] = 1.0
        factor = _on_segment(P.knots, values[:, None, None], j)
        factor = now(convert(factor, number), region, number)
        whole = rows @ rows.T * (bound * bound)
        own = whole - PolynomialMatrix.constant(exact(of_d, number), whole.box)
        total = _scaled(factor, own) if total is None else total + _scaled(factor, own)
    assert total is not None  # noqa: S101 - a block has a part
    return total


def _remembering(
    system: Sequence[PolynomialMatrix],
    region: Region,
    P: MemoryLyapunov,
    rate: float,
    number: Number,
) -> Iterator[tuple[PolynomialMatrix, PolynomialMatrix]]:
    """Yield the blocks times height(p) = upper - lower, in p and the share s of the lag error, e =
    lower + s height.
    """
    (j,), lag, (cell,) = region.segment, P.region, system[0].box
    lower, upper = (
        now(convert(_on_segment(P.knots, v[j : j + 2, None, None], j), number), region, number)
        for v in (lag.lower, lag.upper)
    )
    for i, ends in enumerate(pairwise(P.lead_knots)):
        share = tuple(number(float(s)) for s in ends)
        segment = tuple(number(float(p)) for p in P.knots[j : j + 2])
        here = PolynomialMatrix((segment, share), exact(P.patch(j, i), number))
        here = here.restrict((cell, share))
        model = [M.extend((share,)) for M in system]
        low, height = lower.extend((share,)), (upper - lower).extend((share,))
        s = PolynomialMatrix(here.box, np.array(share)[None, :, None, None])
        slopes = [nu * here.derivative(0) for nu in (-number(rate), number(rate))]
        gain = Demand(L2_GAIN, Motion((), (), ())).supply(0, number)
        blocks = dissipation(model, here, gain, True, slopes)
        for nu, F in zip((-number(rate), number(rate)), blocks, strict=True):
            # height ds/dt = de/dt - dp/dt (lower' + s height')
            lead = (low + height @ s) * (number(1.0) / number(lag.time))
            steeper = low.derivative(0) + height.derivative(0) @ s
            drift = PolynomialMatrix.constant(np.array([[nu]]), here.box) - lead - steeper * nu
            corner = _scaled(drift, here.derivative(1))
            side = model[1] * 0
            yield (_scaled(height, F) + block([[corner, side], [side.T, side.T @ side]]), height)


def _scaled(f: PolynomialMatrix, F: PolynomialMatrix) -> PolynomialMatrix:
    """Return f F for a scalar polynomial f."""
    return PolynomialMatrix(f.box, f.coefficients * np.eye(F.shape[0], dtype=int)) @ F


def slope_along(
    here: PolynomialMatrix, drift: Drift, time: float, number: Number
) -> PolynomialMatrix | None:
    """Return dP/dt for this motion of p; None where P does not change."""
    total = None
    for i, (rate, j) in enumerate(zip(drift.rates, drift.ties, strict=True)):
        if rate == 0 and j is None:
            continue
        term = here.derivative(i)
        term = term * (number(rate) * number(time)) if j is None else _times(term, j) * number(time)
        total = term if total is None else total + term
    return total


def _times(F: PolynomialMatrix, axis: int) -> PolynomialMatrix:
    """Return the polynomial times the parameter of that axis."""
    low, high = F.box[axis]
    shape = [1] * len(F.box)
    shape[axis] = 2
    return _scaled(PolynomialMatrix(F.box, np.array([low, high]).reshape(*shape, 1, 1)), F)
