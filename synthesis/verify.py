"""Is this P(p) a proof? Recomputed from the model and P alone, in floating point or in exact rational arithmetic.

Nothing here is shared with the assembly of the cone program: an error there cannot pass here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from symheli.lpv import LPVStateSpace
from synthesis.bernstein import composition, elevate, multiply, restriction, transpose
from synthesis.cells import Cell, Strip, cells, strips
from synthesis.lyapunov import SplineLyapunov
from synthesis.pieces import ModelPiece
from synthesis.scaling import Scaling

Array = np.ndarray
Number = Callable[[float], Any]


class Findings(NamedTuple):
    """`positive`: P > 0 in every coefficient; `decreasing`: so is the state block; `g`: least gamma^2 the blocks admit.

    `conditioning` is the largest condition number of a coefficient of P in the scaled coordinates.
    """

    positive: bool
    decreasing: bool
    g: float
    conditioning: float


class Claim(NamedTuple):
    """What is to be verified: the pieces of the model, P, the rate (units of p per second) and dt (s, None: continuous).

    `elevation` raises the degree of the Bernstein forms, which brings their coefficients closer to the values.
    """

    pieces: tuple[ModelPiece, ...]
    P: SplineLyapunov
    rate: float
    dt: float | None
    elevation: int = 0

    @property
    def meaningful(self) -> bool:
        """False where a P that varies meets a p that may jump in continuous time: dV/dt has no bound then."""
        return self.dt is not None or self.P.degree == 0 or math.isfinite(self.rate)


def lmi_polynomials(claim: Claim, number: Number) -> Iterator[Array]:
    """Bernstein coefficients (a + 1, b + 1, N, N) of every block over the whole range, with g = 0.

    `number` turns a double into the arithmetic of the proof.
    """
    for F in _polynomials(claim, number):
        yield elevate(F, (F.shape[0] - 1 + claim.elevation, F.shape[1] - 1))


def _polynomials(claim: Claim, number: Number) -> Iterator[Array]:
    pieces, P, rate, dt, _ = claim
    assert claim.meaningful  # noqa: S101 - checked by the callers
    convert = np.frompyfunc(number, 1, 1)

    def exact(values: Array) -> Array:
        return np.asarray(values, dtype=float) if number is float else np.asarray(convert(values), dtype=object)

    if dt is None:
        for cell in cells(pieces, P.knots):
            yield from _continuous(cell, P, rate, number, exact)
    else:
        step = rate * dt if P.degree else 0.0
        for strip in strips(pieces, P.knots, step):
            yield _discrete(strip, P, number, exact)


def _continuous(cell: Cell, P: SplineLyapunov, rate: float, number: Number, exact: Callable[[Array], Array]) -> Iterator[Array]:
    A, B, C, D = _model(cell, number, exact)
    a, b, width = _local(cell.low, cell.high, P, cell.segment, number)
    Pc = _apply(restriction(P.degree, a, b), exact(P.segment(cell.segment)))[:, None]
    still = multiply(transpose(A), Pc)
    still, side = [still, transpose(still), multiply(transpose(C), C)], [multiply(Pc, B), multiply(transpose(C), D)]
    corner = [multiply(transpose(D), D)]
    if P.degree == 0 or rate == 0:
        yield _stack(still, side, corner)
        return
    slope = P.degree * (Pc[1:] - Pc[:-1]) / ((b - a) * width)
    for nu in (-number(rate), number(rate)):
        yield _stack([*still, nu * slope], side, corner)


def _discrete(strip: Strip, P: SplineLyapunov, number: Number, exact: Callable[[Array], Array]) -> Array:
    cell = strip.cell
    A, B, C, D = _model(cell, number, exact)
    a, b, _ = _local(cell.low, cell.high, P, cell.segment, number)
    now = _apply(restriction(P.degree, a, b), exact(P.segment(cell.segment)))[:, None]
    bottom, top = number(float(P.knots[strip.next_segment])), number(float(P.knots[strip.next_segment + 1]))
    corners = [[(number(q) - bottom) / (top - bottom) for q in pair] for pair in strip.corners]
    after = _apply(composition(P.degree, corners), exact(P.segment(strip.next_segment)))
    left_A, left_B = multiply(transpose(A), after), multiply(transpose(B), after)
    return _stack(
        [multiply(left_A, A), -now, multiply(transpose(C), C)],
        [multiply(left_A, B), multiply(transpose(C), D)],
        [multiply(left_B, B), multiply(transpose(D), D)],
    )


def _model(cell: Cell, number: Number, exact: Callable[[Array], Array]) -> list[Array]:
    low, high = number(cell.piece.low), number(cell.piece.high)
    a, b = (number(cell.low) - low) / (high - low), (number(cell.high) - low) / (high - low)
    return [_apply(restriction(len(M) - 1, a, b), exact(M))[:, None] for M in (cell.piece.A, cell.piece.B, cell.piece.C, cell.piece.D)]


def _local(low: float, high: float, P: SplineLyapunov, segment: int, number: Number) -> tuple[Any, Any, Any]:
    bottom, top = number(float(P.knots[segment])), number(float(P.knots[segment + 1]))
    return (number(low) - bottom) / (top - bottom), (number(high) - bottom) / (top - bottom), top - bottom


def _apply(weights: Array, coefficients: Array) -> Array:
    """sum_j weights[..., j] coefficients[j], in any arithmetic."""
    flat = coefficients.reshape(len(coefficients), -1)
    return (weights.reshape(-1, weights.shape[-1]) @ flat).reshape(*weights.shape[:-1], *coefficients.shape[1:])


def _stack(top: list[Array], side: list[Array], corner: list[Array]) -> Array:
    every = [*top, *side, *corner]
    degrees = (max(F.shape[0] for F in every) - 1, max(F.shape[1] for F in every) - 1)
    sums = [sum((elevate(F, degrees) for F in part[1:]), elevate(part[0], degrees)) for part in (top, side, corner)]
    upper = np.concatenate([sums[0], sums[1]], axis=-1)
    lower = np.concatenate([transpose(sums[1]), sums[2]], axis=-1)
    return np.concatenate([upper, lower], axis=-2)


def examine(claim: Claim) -> Findings:
    """Floating point: eigenvalues of every coefficient, and the least g by Schur complement. Pass scaled data."""
    P = claim.P
    if not claim.meaningful:
        return Findings(False, False, math.inf, math.inf)
    n = P.coefficients.shape[1]
    values = np.linalg.eigvalsh(P.coefficients)
    positive = bool(np.all(values[:, 0] > _rounding(n) * np.abs(values).max()))
    conditioning = float(np.max(values[:, -1] / values[:, 0])) if positive else math.inf
    decreasing, g = True, 0.0
    for F in lmi_polynomials(claim, float):
        F = F.reshape(-1, *F.shape[-2:])
        top = F[:, :n, :n]
        eigenvalues = np.linalg.eigvalsh(top)
        decreasing &= bool(np.all(eigenvalues[:, -1] < -_rounding(n) * np.abs(eigenvalues).max(axis=1)))
        if not decreasing:
            return Findings(positive, False, math.inf, conditioning)
        if F.shape[1] > n:
            side, corner = F[:, :n, n:], F[:, n:, n:]
            schur = corner - np.swapaxes(side, 1, 2) @ np.linalg.solve(top, side)
            g = max(g, float(np.linalg.eigvalsh(schur).max()))
    return Findings(positive, decreasing, g, conditioning)


def _rounding(n: int) -> float:
    return 20 * n * np.finfo(float).eps


def holds_on_grid(lpv: LPVStateSpace, P: SplineLyapunov, rate: float, gamma: float, transform: Array, points: int = 201) -> bool:
    """The LMI at `points` values of p (knots too) and the extreme rates, from the model's own matrices; g = gamma^2.

    `transform` (n, n) is a constant change of coordinates for the sake of rounding; gamma NaN tests stability alone.
    """
    low, high = lpv.scheduling.low, lpv.scheduling.high
    grid = np.unique(np.concatenate([np.linspace(low, high, points), P.knots]))
    A, B, C, D = lpv.matrices(grid)
    now = P.at(grid)
    if np.linalg.eigvalsh(transform.T @ now @ transform).min() <= 0:
        return False
    moving = P.degree > 0 and rate > 0
    outer = np.concatenate([C, D], 2)
    M = np.concatenate([A, B], 2)
    widen = np.zeros((A.shape[1], B.shape[2]))
    state, inputs = np.concatenate([np.eye(len(widen)), widen], 1), np.concatenate([widen.T, np.eye(B.shape[2])], 1)
    if lpv.dt is None:
        slopes = [nu * P.derivative(grid) for nu in ((-rate, rate) if moving else (0.0,))]
        moves = [state.T @ now @ M + transpose(M) @ now @ state + state.T @ slope @ state for slope in slopes]
    else:
        step = min(rate * lpv.dt, high - low) if moving else 0.0
        after = [P.at(np.clip(grid + side, low, high)) for side in (-step, 0.0, step)]
        moves = [transpose(M) @ Q @ M - state.T @ now @ state for Q in after]
    whole = np.block([[transform, widen], [widen.T, np.eye(B.shape[2])]])
    for move in moves:
        F = move if math.isnan(gamma) else move + transpose(outer) @ outer - gamma**2 * inputs.T @ inputs
        F = whole.T @ F @ whole
        if np.linalg.eigvalsh(0.5 * (F + transpose(F))).max() >= 0:
            return False
    return True


def proven(claim: Claim, gamma: float) -> bool:
    """Exact rational arithmetic over the whole interval: P > 0 and every block < 0 with g = gamma^2 (NaN: stability).

    The doubles of the pieces, of P, of rate and of gamma are taken as the rationals they are. Uses python-flint where
    installed, else the (slower) fractions of the standard library.
    """
    number, P = rational(), claim.P
    if not claim.meaningful:
        return False
    n = P.coefficients.shape[1]
    for coefficient in P.coefficients:
        if not positive_definite(np.array([[number(float(v)) for v in row] for row in coefficient], dtype=object)):
            return False
    g = None if math.isnan(gamma) else number(gamma) * number(gamma)
    for F in lmi_polynomials(claim, number):
        for M in F.reshape(-1, *F.shape[-2:]):
            M = -M
            if g is None:
                M = M[:n, :n]
            else:
                for i in range(n, len(M)):
                    M[i, i] = M[i, i] + g
            if not positive_definite(M):
                return False
    return True


def rational() -> Number:
    """The exact rational of a double, in the fastest arithmetic installed."""
    try:
        from flint import fmpq  # type: ignore[import-not-found]
    except ImportError:
        return Fraction

    def convert(value: float) -> Any:
        return fmpq(*float(value).as_integer_ratio())

    return convert


def positive_definite(M: Array) -> bool:
    """Whether the symmetric rational matrix is positive definite: all pivots of its LDL' factorisation positive."""
    M = M.copy()
    for k in range(len(M)):
        pivot = M[k, k]
        if not pivot > 0:
            return False
        for i in range(k + 1, len(M)):
            if M[i, k] != 0:
                factor = M[i, k] / pivot
                for j in range(k + 1, i + 1):
                    M[i, j] = M[i, j] - factor * M[j, k]
    return True


class Evidence(NamedTuple):
    """A model with a rate, against which any P(p) and gain can be checked.

    `pieces` of the model in physical units, `units` in which its numbers are of order one.
    """

    lpv: LPVStateSpace
    pieces: tuple[ModelPiece, ...]
    units: Scaling
    rate: float
    elevation: int

    def least_gain(self, P: SplineLyapunov) -> tuple[float, float]:
        """(gain that P admits, conditioning of P); inf where P proves nothing, NaN without channels. Floating point."""
        units = self.units
        scaled = tuple(piece.scaled(units.left, units.right, units.channel, units.time) for piece in self.pieces)
        back = SplineLyapunov(P.knots, P.degree, units.to_scaled(P.coefficients))
        rate = self.rate * units.time if self.lpv.dt is None else self.rate
        findings = examine(Claim(scaled, back, rate, self.lpv.dt, self.elevation))
        if not (findings.positive and findings.decreasing and math.isfinite(findings.g)):
            return math.inf, math.inf
        return (units.channel * math.sqrt(findings.g) if self.lpv.inputs else math.nan), findings.conditioning

    def floating(self, P: SplineLyapunov, gamma: float) -> bool:
        """Every Bernstein coefficient and a grid of p, in floating point."""
        least = self.least_gain(P)[0]
        enough = math.isnan(least) if math.isnan(gamma) else least < gamma
        return enough and holds_on_grid(self.lpv, P, self.rate, gamma, self.units.right)

    def exact(self, P: SplineLyapunov, gamma: float) -> bool:
        """The same over the whole interval in rational arithmetic."""
        return proven(Claim(self.pieces, P, self.rate, self.lpv.dt, self.elevation), gamma)
