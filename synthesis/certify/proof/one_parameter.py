"""Verification of P for one parameter, from the model and P alone, in floating point or in exact
rational arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symheli.lpv.lpv_matrices import LPVMatrices, Matrices
from symheli.lpv.scheduling import Scheduling
from symheli.values.arrays import Array
from symheli.values.tracking import tracked
from synthesis.certify.proof import pointwise
from synthesis.certify.proof.inequalities import Statement, lmi_polynomials
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.kind import L2_GAIN, STABILITY
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.certify.statement.spline import Lyapunov, MemoryLyapunov, SplineLyapunov
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.polynomial import structure
from synthesis.numerics.polynomial.exact import Number, exact, positive_definite, rational
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import ModelPiece, joined, model_pieces, same_pieces
from synthesis.numerics.polynomial.symmetric import extended, schur_complement, symmetrized

GRID = 100
"""Least number of values of p at which a P(p) is checked in floating point."""


class Findings(NamedTuple):
    """Result of a check: `positive`: P > 0 in every coefficient; `decreasing`: the state block is
    negative; `g`: least gamma^2 the blocks admit.

    `conditioning` is the largest condition number of a coefficient of P in the scaled coordinates.
    """

    positive: bool
    decreasing: bool
    g: float
    conditioning: float


def examine(statement: Statement, weight: Array) -> Findings:
    """Check by eigenvalues of every coefficient in floating point, and return the least g by Schur
    complement. Pass scaled data.

    `weight` changes the coordinates of the state blocks for the sake of rounding.
    """
    P = statement.P
    if not statement.meaningful:
        return Findings(False, False, math.inf, math.inf)
    states, n = P.coefficients.shape[-1], statement.strict
    values = np.linalg.eigvalsh(P.coefficients.reshape(-1, states, states))
    positive = bool(np.all(values[:, 0] > _rounding(states) * np.abs(values).max()))
    conditioning = float(np.max(values[:, -1] / values[:, 0])) if positive else math.inf
    decreasing, g = True, 0.0
    for form in lmi_polynomials(statement, float):
        F = form.block.coefficients.reshape(-1, *form.block.shape)
        if len(weight) == states:
            W = extended(weight, F.shape[1] - states)
            F = symmetrized(W.T @ F @ W)
        eigenvalues = np.linalg.eigvalsh(F[:, :n, :n])
        decreasing &= bool(
            np.all(eigenvalues[:, -1] < -_rounding(n) * np.abs(eigenvalues).max(axis=1))
        )
        if not decreasing:
            return Findings(positive, False, math.inf, conditioning)
        if F.shape[1] > n:
            levels = np.linalg.eigvalsh(schur_complement(F, n))[:, -1]
            g = max(g, float((levels / form.weight.coefficients.ravel()).max()))
    return Findings(positive, decreasing, g, conditioning)


def _rounding(n: int) -> float:
    return 20 * n * np.finfo(float).eps


def proven(statement: Statement, gamma: float) -> bool:
    """Check in exact rational arithmetic over the whole interval: P > 0 and every block < 0 with g
    = gamma^2 (NaN: stability).

    The doubles of the pieces, of P, of rate and of gamma are taken as the rationals they are.
    """
    number, P = rational(), statement.P
    if not (statement.meaningful and statement.invariant(number)):
        return False
    states, n = P.coefficients.shape[-1], statement.strict
    if P.multiplier is not None and not np.all(P.multiplier >= 0):
        return False
    # `coordinates` are regular where every block is negative: where T x = 0, it is not
    forms = P.coefficients.reshape(-1, states, states)
    if not all(positive_definite(exact(form, number)) for form in forms):
        return False
    g = None if math.isnan(gamma) else number(gamma) * number(gamma)
    count = sum(1 for _ in lmi_polynomials(statement, float))
    blocks = lmi_polynomials(statement, number)
    for block, weight in tracked("verifying in rational arithmetic", blocks, count):
        for F, factor in zip(
            block.coefficients.reshape(-1, *block.shape), weight.coefficients.ravel(), strict=True
        ):
            M = -F
            if g is None:
                M = M[:n, :n]
            else:
                for i in range(n, len(M)):
                    M[i, i] = M[i, i] + g * factor
            if not positive_definite(M):
                return False
    return True


class IntervalEvidence(NamedTuple):
    """A model with a rate, against which any P(p) and gain can be checked.

    `pieces` of the model in physical units, `units` in which its numbers are of order one. Around a
    `block` the inputs are (d, u) and the outputs (y, v).
    """

    lpv: LPVMatrices
    pieces: tuple[ModelPiece, ...]
    units: Scaling
    rate: float
    elevation: int
    block: NormBounded | None = None

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The parameter of the model, as a tuple."""
        return (self.lpv.scheduling,)

    @property
    def matrices(self) -> LPVMatrices:
        """The model."""
        return self.lpv

    def fault(self, P: Lyapunov, kind: str, rates: tuple[float, ...]) -> str | None:
        """Return why P does not belong to this model and statement, before any inequality is
        checked; None where it does.
        """
        if not isinstance(P, SplineLyapunov | MemoryLyapunov):
            return f"expected a SplineLyapunov or a MemoryLyapunov, got {type(P).__name__}"
        if fault := self._fault_of_block(P):
            return fault
        own = 0 if self.block is None else self.block.inputs
        if kind != (L2_GAIN if len(self.lpv.inputs) > own else STABILITY):
            return f"the model of the proof is not one of the kind {kind!r}"
        if not self.rate >= 0 or rates != (self.rate,):
            return f"the proof is for rates {(self.rate,)}, the certificate for {rates}"
        s = self.lpv.scheduling
        return structure.first(
            P.fault_for(s.low, s.high, len(self.lpv.states)),
            structure.whole(self.elevation, 0, "elevation"),
            self.units.fault(len(self.lpv.states)),
            (
                None
                if same_pieces(self.pieces, model_pieces(self.lpv))
                else "the pieces are not those of the model"
            ),
        )

    def _fault_of_block(self, P: Lyapunov) -> str | None:
        if self.block is None:
            return None if P.multiplier is None else "a multiplier needs a norm-bounded block"
        if not isinstance(self.block, NormBounded):
            return f"expected a NormBounded block or None, got {self.block!r:.60}"
        if not isinstance(P, SplineLyapunov) or P.multiplier is None or P.order > 1:
            return "a norm-bounded block needs V = x' P(p) x with a multiplier"
        return self.block.fault(self.lpv) or self.block.multiplier_fault(P.multipliers)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sentences on the perturbations for which a proof holds; none without a block."""
        return () if self.block is None else (self.block.sentence,)

    def least_gain(self, P: Lyapunov) -> tuple[float, float]:
        """Return (gain that P admits, conditioning of P); inf where it proves nothing, NaN without
        channels. Floating point.
        """
        units, scaled = self.units, self.units.of_pieces(self.pieces, self.block)
        model = joined(self.lpv, scaled)
        statement = Statement(model, self._scaled(P), self._rate, self.elevation, self.block)
        findings = examine(statement, units.weight)
        if not (findings.positive and findings.decreasing and math.isfinite(findings.g)):
            return math.inf, math.inf
        own = 0 if self.block is None else self.block.inputs
        gains = len(self.lpv.inputs) > own
        return (units.channel * math.sqrt(findings.g) if gains else math.nan), findings.conditioning

    def _scaled(self, P: Lyapunov) -> Lyapunov:
        u, back = self.units, self.units.right
        if P.coordinates is not None and np.array_equal(P.coordinates, u.left):
            P, back = replace(P, coordinates=None), np.eye(len(back))
        return P.in_units(back, u.channel**-2, u.time, 1.0 / u.multiplier)

    @property
    def _rate(self) -> float:
        """Rate of p, per scaled unit of time."""
        return self.rate * self.units.time if self.lpv.dt is None else self.rate

    def floating(self, P: Lyapunov, gamma: float) -> bool:
        """Check every Bernstein coefficient and a grid of p, in floating point."""
        least = self.least_gain(P)[0]
        enough = math.isnan(least) if math.isnan(gamma) else least < gamma
        statement = self._statement(P)
        if not (enough and statement.meaningful and statement.invariant(rational())):
            return False
        return self.on_grid(P, gamma)

    def on_grid(self, P: Lyapunov, gamma: float) -> bool:
        """Check the inequalities at many p, from the model's own matrices in scaled units."""
        plain = isinstance(P, SplineLyapunov) and P.order == 1
        u, points = self.units, pointwise.inside(self._ends(P), GRID if plain else 1)
        model = u.of_matrices(self.lpv.matrices(np.array(points)), self.block)
        every = _at_points(
            *(self._scaled(P), points, model, self._demand(self._rate, gamma), self.lpv.dt),
            *(gamma / u.channel, u.weight, float, self.block),
        )
        return pointwise.negative(every, float, u.weight)

    def exact(self, P: Lyapunov, gamma: float) -> bool:
        """Check the whole interval in rational arithmetic, and again some p through the model's own
        matrices.
        """
        return proven(self._statement(P), gamma) and self.checked_independently(
            P, gamma, rational()
        )

    def checked_independently(self, P: Lyapunov, gamma: float, number: Number) -> bool:
        """Check that the pieces are the model, and that the inequalities hold at some p without
        them; see `pointwise`.
        """
        if not all(self._reproduced(p) for p in pointwise.inside(self._ends())):
            return False
        points = pointwise.inside(self._ends(P))
        every = _at_points(
            *(P, points, self.lpv.matrices(np.array(points)), self._demand(self.rate, gamma)),
            *(self.lpv.dt, gamma, self.units.right, number, self.block),
        )
        return pointwise.negative(every, number)

    def _demand(self, rate: float, gamma: float) -> Demand:
        s = self.lpv.scheduling
        kind = STABILITY if math.isnan(gamma) else L2_GAIN
        return Demand(kind, Motion(((s.low, s.high),), (rate,), (None,)))

    def _ends(self, P: Lyapunov | None = None) -> list[float]:
        """Return the ends of the intervals on which model and P are polynomial, by the model's own
        breaks.
        """
        s = self.lpv.scheduling
        breaks = [b for piece in self.lpv.basis.pieces() for b in (piece.low, piece.high)]
        knots = [] if P is None else P.knots.tolist()
        return [s.low, s.high, *knots, *(b for b in breaks if s.low < b < s.high)]

    def _reproduced(self, p: float) -> bool:
        piece = next(piece for piece in self.pieces if p <= piece.high)
        t, weights, lpv = (
            (p - piece.low) / (piece.high - piece.low),
            np.abs(self.lpv.basis(p)),
            self.lpv,
        )
        for coefficients, own, terms in zip(
            piece[2:], lpv.matrices(p), (lpv.A, lpv.B, lpv.C, lpv.D), strict=True
        ):
            size = np.tensordot(weights, np.abs(terms), axes=1)
            if not pointwise.same_entries(pointwise.bernstein(coefficients, t), own, size):
                return False
        return True

    def _statement(self, P: Lyapunov) -> Statement:
        model = joined(self.lpv, self.pieces)
        return Statement(model, P, self.rate, self.elevation, self.block)


def _at_points(
    P: Lyapunov,
    points: Sequence[float],
    model: Matrices,
    demand: Demand,
    dt: float | None,
    gamma: float,
    transform: Array,
    number: Number,
    channel: NormBounded | None,
) -> Iterator[Array]:
    """Yield the matrices that must be negative definite at the points, where the model has these
    matrices (K, ...).
    """
    (rate,) = demand.rates
    for k, p in enumerate(points):
        own = Matrices(*(exact(M[k], number) for M in model))
        if isinstance(P, MemoryLyapunov):
            g = None if math.isnan(gamma) else number(gamma) * number(gamma)
            yield from pointwise.memory_inequalities(P, p, own, rate, g, number)
        elif P.order > 1:
            yield from pointwise.monomial_inequalities(P, p, own.A, rate, transform, number)
        else:
            yield from pointwise.inequalities(P, (p,), own, demand, dt, gamma, number, channel)
