"""Is this P a proof? Recomputed from the model and P alone, in floating point or in exact rational
arithmetic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from symheli.lpv import LPVStateSpace, Matrices, Scheduling
from symheli.progress import tracked
from synthesis.lyapunov.spline import Lyapunov, MemoryLyapunov, SplineLyapunov
from synthesis.norm_bounded import NormBounded
from synthesis.polynomial import structure
from synthesis.polynomial.exact import Number, exact, positive_definite, rational
from synthesis.polynomial.pieces import ModelPiece, joined, model_pieces, same_pieces
from synthesis.polynomial.symmetric import extended, symmetrized
from synthesis.polynomial.symmetric_power import generator, monomials
from synthesis.program.scaling import Scaling
from synthesis.proof import pointwise
from synthesis.proof.inequalities import Claim, lmi_polynomials

Array = np.ndarray


class Findings(NamedTuple):
    """`positive`: P > 0 in every coefficient; `decreasing`: so is the state block; `g`: least
    gamma^2 the blocks admit.

    `conditioning` is the largest condition number of a coefficient of P in the scaled coordinates.
    """

    positive: bool
    decreasing: bool
    g: float
    conditioning: float


def examine(claim: Claim, weight: Array) -> Findings:
    """Floating point: eigenvalues of every coefficient, and the least g by Schur complement. Pass
    scaled data.

    `weight` changes the coordinates of the state blocks for the sake of rounding.
    """
    P = claim.P
    if not claim.meaningful:
        return Findings(False, False, math.inf, math.inf)
    states, n = P.coefficients.shape[-1], claim.strict
    values = np.linalg.eigvalsh(P.coefficients.reshape(-1, states, states))
    positive = bool(np.all(values[:, 0] > _rounding(states) * np.abs(values).max()))
    conditioning = float(np.max(values[:, -1] / values[:, 0])) if positive else math.inf
    decreasing, g = True, 0.0
    for form in lmi_polynomials(claim, float):
        F = form.block.coefficients.reshape(-1, *form.block.shape)
        if len(weight) == states:
            W = extended(weight, F.shape[1] - states)
            F = symmetrized(W.T @ F @ W)
        top = F[:, :n, :n]
        eigenvalues = np.linalg.eigvalsh(top)
        decreasing &= bool(
            np.all(eigenvalues[:, -1] < -_rounding(n) * np.abs(eigenvalues).max(axis=1))
        )
        if not decreasing:
            return Findings(positive, False, math.inf, conditioning)
        if F.shape[1] > n:
            side, corner = F[:, :n, n:], F[:, n:, n:]
            schur = corner - np.swapaxes(side, 1, 2) @ np.linalg.solve(top, side)
            g = max(
                g,
                float((np.linalg.eigvalsh(schur)[:, -1] / form.weight.coefficients.ravel()).max()),
            )
    return Findings(positive, decreasing, g, conditioning)


def _rounding(n: int) -> float:
    return 20 * n * np.finfo(float).eps


def holds_on_grid(
    lpv: LPVStateSpace,
    P: Lyapunov,
    rate: float,
    gamma: float,
    units: Scaling,
    block: NormBounded | None = None,
) -> bool:
    """The LMI at some hundred points and the extreme rates, from the model's own matrices; g =
    gamma^2.

    In the coordinates of the `units` for the sake of rounding; gamma NaN tests stability alone.
    """
    transform = units.right @ units.weight
    if isinstance(P, MemoryLyapunov):
        return _holds_with_memory(lpv, P, rate, gamma, transform)
    if P.order > 1:
        return _decreases_on_states(lpv, P, rate, transform)
    return _holds_in_p(lpv, P, rate, gamma, units, block)


def _holds_in_p(
    lpv: LPVStateSpace,
    P: SplineLyapunov,
    rate: float,
    gamma: float,
    units: Scaling,
    block: NormBounded | None,
) -> bool:
    low, high = lpv.scheduling.low, lpv.scheduling.high
    grid = np.unique(np.concatenate([np.linspace(low, high, 201), P.knots]))
    A, B, C, D = lpv.matrices(grid)
    # in these coordinates from the start: rounding is relative to what is computed
    A, B, C, P = (
        units.left @ A @ units.right,
        units.left @ B,
        C @ units.right,
        P.in_units(units.right),
    )
    whole = extended(units.weight, B.shape[2])
    now = P.at(grid)
    if np.linalg.eigvalsh(now).min() <= 0:
        return False
    moving = P.degree > 0 and rate > 0
    outer = np.concatenate([C, D], 2)
    M = np.concatenate([A, B], 2)
    nx, own = A.shape[1], 0 if block is None else block.inputs
    state, d, inputs = np.split(np.eye(M.shape[2]), [nx, nx + own])
    supply = np.zeros((M.shape[2], M.shape[2]))
    if block is not None:
        outer, v = np.split(outer, [-block.outputs], axis=1)
        lam = P.multiplier_at(grid)[:, None, None]
        supply = lam * (block.bound**2 * np.swapaxes(v, -1, -2) @ v - d.T @ d)
    if lpv.dt is None:
        slopes = [nu * P.derivative(grid) for nu in ((-rate, rate) if moving else (0.0,))]
        moves = [
            state.T @ now @ M + np.swapaxes(M, -1, -2) @ now @ state + state.T @ slope @ state
            for slope in slopes
        ]
    else:
        step = min(rate * lpv.dt, high - low) if moving else 0.0
        after = [P.at(np.clip(grid + side, low, high)) for side in (-step, 0.0, step)]
        moves = [np.swapaxes(M, -1, -2) @ Q @ M - state.T @ now @ state for Q in after]
    for move in moves:
        move = move + supply
        F = (
            move
            if math.isnan(gamma)
            else move + np.swapaxes(outer, -1, -2) @ outer - gamma**2 * inputs.T @ inputs
        )
        if np.linalg.eigvalsh(symmetrized(whole.T @ symmetrized(F) @ whole)).max() >= 0:
            return False
    return True


def _holds_with_memory(
    lpv: LPVStateSpace, P: MemoryLyapunov, rate: float, gamma: float, transform: Array
) -> bool:
    low, high = lpv.scheduling.low, lpv.scheduling.high
    nu = lpv.B.shape[2]
    whole = np.block(
        [[transform, np.zeros((len(transform), nu))], [np.zeros((nu, len(transform))), np.eye(nu)]]
    )
    for p in np.unique(np.concatenate([np.linspace(low, high, 41), P.knots])):
        A, B, C, D = lpv.matrices(float(p))
        outer = np.concatenate([C, D], 1)
        lower, height, _, _ = (float(v) for v in P.region.locate(np.array(p)))
        for share in np.linspace(0.0, 1.0, 9):
            now, in_p, in_lead = P.at(float(p), float(share))
            if np.linalg.eigvalsh(transform.T @ now @ transform)[0] <= 0:
                return False
            for slope in (-rate, rate):
                top = (
                    A.T @ now
                    + now @ A
                    + slope * in_p
                    + (slope - (lower + share * height) / P.region.time) * in_lead
                )
                F = np.block([[top, now @ B], [B.T @ now, np.zeros((nu, nu))]])
                if not math.isnan(gamma):
                    F = (
                        F
                        + outer.T @ outer
                        - gamma**2 * np.diag(np.concatenate([np.zeros(len(A)), np.ones(nu)]))
                    )
                if np.linalg.eigvalsh(whole.T @ F @ whole)[-1] >= 0:
                    return False
    return True


def _decreases_on_states(
    lpv: LPVStateSpace, P: SplineLyapunov, rate: float, transform: Array
) -> bool:
    """V > 0 > dV/dt at states in all directions: what the slack cannot change."""
    directions = transform @ np.random.default_rng(0).standard_normal((lpv.A.shape[1], 400))
    z = np.array(
        [
            np.prod(directions[list(factors)], axis=0)
            for factors in monomials(len(directions), P.order)
        ]
    )
    grid = np.unique(
        np.concatenate([np.linspace(lpv.scheduling.low, lpv.scheduling.high, 101), P.knots])
    )
    for A, now, slope in zip(
        generator(lpv.matrices(grid).A, P.order), P.at(grid), P.derivative(grid), strict=True
    ):
        flow = 2 * np.sum(z * (now @ (A @ z)), axis=0)
        drift = rate * np.abs(np.sum(z * (slope @ z), axis=0)) if P.degree else 0.0
        if np.any(np.sum(z * (now @ z), axis=0) <= 0) or np.any(flow + drift >= 0):
            return False
    return True


def proven(claim: Claim, gamma: float) -> bool:
    """Exact rational arithmetic over the whole interval: P > 0 and every block < 0 with g = gamma^2
    (NaN: stability).

    The doubles of the pieces, of P, of rate and of gamma are taken as the rationals they are. Uses
    python-flint where installed, else the (slower) fractions of the standard library.
    """
    number, P = rational(), claim.P
    if not (claim.meaningful and claim.invariant(number)):
        return False
    states, n = P.coefficients.shape[-1], claim.strict
    if P.multiplier is not None and not np.all(P.multiplier >= 0):
        return False
    for coefficient in P.coefficients.reshape(-1, states, states):
        if not positive_definite(
            np.array([[number(float(v)) for v in row] for row in coefficient], dtype=object)
        ):
            return False
    g = None if math.isnan(gamma) else number(gamma) * number(gamma)
    count = sum(1 for _ in lmi_polynomials(claim, float))
    blocks = lmi_polynomials(claim, number)
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


class Evidence(NamedTuple):
    """A model with a rate, against which any P(p) and gain can be checked.

    `pieces` of the model in physical units, `units` in which its numbers are of order one. Around a
    `block` the inputs are (d, u) and the outputs (y, v).
    """

    lpv: LPVStateSpace
    pieces: tuple[ModelPiece, ...]
    units: Scaling
    rate: float
    elevation: int
    block: NormBounded | None = None

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The one parameter of the model."""
        return (self.lpv.scheduling,)

    def fault(self, P: Lyapunov, kind: str, rates: tuple[float, ...]) -> str | None:
        """What keeps P from being about this model and this claim, before any inequality; None
        where nothing does.
        """
        if not isinstance(P, SplineLyapunov | MemoryLyapunov):
            return f"expected a SplineLyapunov or a MemoryLyapunov, got {type(P).__name__}"
        if fault := self._fault_of_block(P):
            return fault
        own = 0 if self.block is None else self.block.inputs
        if kind != ("l2 gain" if len(self.lpv.inputs) > own else "stability"):
            return f"the model of the proof is not one of the kind {kind!r}"
        if not self.rate >= 0 or rates != (self.rate,):
            return f"the proof is for rates {(self.rate,)}, the claim for {rates}"
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
        if P.multiplier is None or P.order > 1:
            return "a norm-bounded block needs V = x' P(p) x with a multiplier"
        return self.block.fault(self.lpv)

    @property
    def sentences(self) -> tuple[str, ...]:
        """For which perturbations a proof holds; nothing without a block."""
        return () if self.block is None else (self.block.sentence,)

    def least_gain(self, P: Lyapunov) -> tuple[float, float]:
        """(gain that P admits, conditioning of P); inf where P proves nothing, NaN without
        channels. Floating point.
        """
        units = self.units
        scaled = units.of_pieces(self.pieces, self.block)
        back = P.in_units(units.right, units.channel**-2, units.time, 1.0 / units.multiplier)
        rate = self.rate * units.time if self.lpv.dt is None else self.rate
        model = joined(self.lpv, scaled)
        claim = Claim(model, back, rate, self.elevation, self.block)
        findings = examine(claim, units.weight)
        if not (findings.positive and findings.decreasing and math.isfinite(findings.g)):
            return math.inf, math.inf
        own = 0 if self.block is None else self.block.inputs
        gains = len(self.lpv.inputs) > own
        return (units.channel * math.sqrt(findings.g) if gains else math.nan), findings.conditioning

    def floating(self, P: Lyapunov, gamma: float) -> bool:
        """Every Bernstein coefficient and a grid of p, in floating point."""
        least = self.least_gain(P)[0]
        enough = math.isnan(least) if math.isnan(gamma) else least < gamma
        claim = self._claim(P)
        if not (enough and claim.meaningful and claim.invariant(rational())):
            return False
        return holds_on_grid(self.lpv, P, self.rate, gamma, self.units, self.block)

    def exact(self, P: Lyapunov, gamma: float) -> bool:
        """The same over the whole interval in rational arithmetic, and again at some p through the
        model's own matrices.
        """
        return proven(self._claim(P), gamma) and self.witnessed(P, gamma, rational())

    def witnessed(self, P: Lyapunov, gamma: float, number: Number) -> bool:
        """The pieces are the model, and the inequalities hold at some p without them; see
        `pointwise`.
        """
        lpv, g = self.lpv, None if math.isnan(gamma) else number(gamma) * number(gamma)
        s = lpv.scheduling
        breaks = [
            b for piece in lpv.basis.pieces() for b in (piece.low, piece.high) if s.low < b < s.high
        ]
        points = pointwise.inside([s.low, s.high, *P.knots, *breaks])
        if not all(self._reproduced(p) for p in pointwise.inside([s.low, s.high, *breaks])):
            return False
        for p in points:
            model = Matrices(*(exact(M, number) for M in lpv.matrices(p)))
            if isinstance(P, SplineLyapunov) and P.order > 1:
                if not pointwise.decreases(P, p, model.A, self.rate, self.units.right, number):
                    return False
                continue
            every = (
                pointwise.memory_inequalities(P, p, model, self.rate, g, number)
                if isinstance(P, MemoryLyapunov)
                else pointwise.spline_inequalities(
                    P, p, model, self.rate, lpv.dt, g, (s.low, s.high), number, self.block
                )
            )
            if not all(positive_definite(-F) for F in every):
                return False
        return True

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

    def _claim(self, P: Lyapunov) -> Claim:
        model = joined(self.lpv, self.pieces)
        return Claim(model, P, self.rate, self.elevation, self.block)
