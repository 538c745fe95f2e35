"""The search for P(p): assemble, solve, verify; finer P or a larger margin where that fails."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LPVStateSpace
from synthesis.bounded_real import Blocks, assemble, continuous_blocks, discrete_blocks
from synthesis.cells import cells, strips
from synthesis.certificate import Attempt, Seconds
from synthesis.cone_program import Answer, Candidate, Solver, solve
from synthesis.lyapunov import SplineLyapunov, graded_knots
from synthesis.pieces import ModelPiece, model_pieces
from synthesis.scaling import Scaling, scaling
from synthesis.symmetric import smat
from synthesis.verify import Evidence

Array = np.ndarray

INFLATION = 1e-6
"""gamma^2 is raised by this fraction above what P admits in floating point, so that an exact proof has room."""

VIOLATED = 1e-8
"""A block left out of the program joins it when its largest eigenvalue (scaled) exceeds this."""
ROUNDS = 12
"""Most rounds of adding violated blocks; what then remains violated only makes the recomputed gain larger."""


@dataclass(frozen=True)
class Relaxation:
    """The form of P(p) and of the LMIs.

    P is a continuous spline of `degree` (None: 3 in continuous, 2 in discrete time) on K segments, K from `segments`
    (None: 16, 32 in continuous, 8, 16 in discrete time) in turn until the bound is proven and gamma <= `accept` times the
    lower bound. Knots low + (high - low)(k/K)^`grading`.
    `elevation` raises the Bernstein degree of the LMIs. `margins`: state blocks are held below -margin I in scaled
    coordinates, tried in turn. `floor`: P >= floor I.
    """

    degree: int | None = None
    segments: tuple[int, ...] | None = None
    grading: float = 2.0
    elevation: int = 0
    margins: tuple[float, ...] = (1e-6, 1e-4)
    floor: float = 1e-6
    accept: float = 2.0

    def __post_init__(self) -> None:
        if self.degree is not None and self.degree not in (0, 1, 2, 3, 4):
            raise InputError(f"degree of P must be 0 .. 4, got {self.degree}")
        if self.segments is not None and (not self.segments or min(self.segments) < 1):
            raise InputError(f"segments must be a tuple of integers >= 1, got {self.segments}")
        if self.grading < 1 or self.elevation < 0 or self.floor < 0 or not self.margins or min(self.margins) < 0 or self.accept < 1:
            raise InputError("expected grading >= 1, elevation >= 0, floor >= 0, margins >= 0 and accept >= 1")


class Problem(NamedTuple):
    """What every attempt shares: the model in physical and in scaled units."""

    lpv: LPVStateSpace
    rate: float
    pieces: tuple[ModelPiece, ...]
    scaled: tuple[ModelPiece, ...]
    units: Scaling
    with_gain: bool

    @property
    def scaled_rate(self) -> float:
        """Largest change of p per scaled unit of time."""
        return self.rate * self.units.time

    def evidence(self, elevation: int) -> Evidence:
        """What verifies a P for this problem."""
        return Evidence(self.lpv, self.pieces, self.units, self.rate, elevation)

    @property
    def step(self) -> float:
        """Largest change of p in one sample."""
        return self.rate * (self.lpv.dt or 0.0)


class Result(NamedTuple):
    """The best P verified (None: none was), the gain it proves (inf, NaN without channels) and how it came about."""

    gamma: float
    lyapunov: SplineLyapunov | None
    conditioning: float
    answer: Answer
    seconds: Seconds
    attempts: tuple[Attempt, ...]


def scaled_problem(lpv: LPVStateSpace, rate: float, gain: float, *, with_gain: bool) -> Problem:
    """The model scaled for an expected `gain`; without channels where only stability is asked."""
    if not with_gain:
        lpv = replace(lpv, B=lpv.B[:, :, :0], C=lpv.C[:, :0], D=lpv.D[:, :0, :0], inputs=(), outputs=(), trim=None, residuals=None)
    units, pieces = scaling(lpv, gain), model_pieces(lpv)
    scaled = tuple(piece.scaled(units.left, units.right, units.channel, units.time) for piece in pieces)
    return Problem(lpv, rate, pieces, scaled, units, with_gain)


def prove(problem: Problem, relaxation: Relaxation, solver: Solver, accept: float) -> Result:
    """Finer and finer P until the bound is good enough; the best verified one."""
    best = Result(math.inf, None, math.inf, Answer.FAILED, Seconds(), ())
    spent, attempts = np.zeros(4), []
    degree = _degree(problem, relaxation)
    default = (16, 32) if problem.lpv.dt is None else (8, 16)
    sizes = (relaxation.segments or default) if degree else (1,)
    tried: set[int] = set()
    for segments in sizes:
        knots = _knots(problem, relaxation, segments, degree)
        if len(knots) in tried:
            continue
        tried.add(len(knots))
        for margin in relaxation.margins:
            result = _attempt(problem, relaxation, solver, knots, degree, margin)
            spent += np.array(result.seconds)
            attempts += result.attempts
            if result.lyapunov is not None and (best.lyapunov is None or result.gamma < best.gamma):
                best = result
            elif best.lyapunov is None:
                best = best._replace(answer=result.answer)
            if result.lyapunov is not None or result.answer is Answer.INFEASIBLE:
                break
        if best.lyapunov is not None and not best.gamma > accept:
            break
    return best._replace(seconds=Seconds(*map(float, spent)), attempts=tuple(attempts))


def _degree(problem: Problem, relaxation: Relaxation) -> int:
    if math.isinf(problem.rate) or relaxation.degree == 0:
        return 0
    return relaxation.degree or (3 if problem.lpv.dt is None else 2)


def _knots(problem: Problem, relaxation: Relaxation, segments: int, degree: int) -> Array:
    low, high = problem.pieces[0].low, problem.pieces[-1].high
    breaks = [piece.low for piece in problem.pieces[1:]]
    if degree == 0 or 2.5 * problem.step >= high - low:
        return np.array([low, high])
    return graded_knots(low, high, segments, relaxation.grading, breaks, shortest=2.5 * problem.step)


def _blocks(problem: Problem, relaxation: Relaxation, knots: Array, degree: int) -> list[Blocks]:
    if problem.lpv.dt is None:
        rate = problem.scaled_rate if degree else 0.0
        return list(continuous_blocks(cells(problem.scaled, knots), knots, degree, rate, relaxation.elevation))
    regions = strips(problem.scaled, knots, problem.step if degree else 0.0)
    return list(discrete_blocks(regions, knots, degree, relaxation.elevation))


def _attempt(problem: Problem, relaxation: Relaxation, solver: Solver, knots: Array, degree: int, margin: float) -> Result:
    start = time.perf_counter()
    unknowns = (len(knots) - 1) * degree + 1
    blocks = _blocks(problem, relaxation, knots, degree)
    candidate, rounds = _solve_by_rounds(problem, relaxation, solver, blocks, unknowns, margin)
    solved = time.perf_counter()
    gamma, lyapunov, conditioning = _verified(problem, candidate, knots, degree, unknowns, relaxation.elevation)
    seconds = Seconds(solved - start - candidate.seconds, candidate.seconds, time.perf_counter() - solved)
    words = f"{candidate.message} ({rounds} round(s)), {'verified' if lyapunov is not None else 'not verified'}"
    if problem.with_gain and lyapunov is not None:
        words += f", gamma {gamma:.6g}"
    attempt = Attempt(len(knots) - 1, degree, margin, words, gamma)
    return Result(gamma, lyapunov, conditioning, candidate.answer, seconds, (attempt,))


def _solve_by_rounds(
    problem: Problem, relaxation: Relaxation, solver: Solver, blocks: list[Blocks], unknowns: int, margin: float
) -> tuple[Candidate, int]:  # fmt: skip
    """Solve with the blocks likely to bind, add those that came out violated, and so on: far fewer blocks in all."""
    n, m = len(problem.lpv.states), len(problem.lpv.inputs)
    active = [np.full(len(block.constant), block.likely) for block in blocks]
    seconds, rounds = 0.0, 0
    while True:
        rounds += 1
        chosen = [block.keep(which) for block, which in zip(blocks, active, strict=True) if which.any()]
        candidate = solve(assemble(chosen, n, m, unknowns, margin, relaxation.floor), solver)
        seconds += candidate.seconds
        if candidate.x is None or rounds == ROUNDS:
            break
        P, level = candidate.x[:-1].reshape(unknowns, -1), candidate.x[-1]
        target = np.diag(np.concatenate([np.zeros(n), np.full(m, level)])) if problem.with_gain else -level * np.eye(n)
        added = 0
        for block, which in zip(blocks, active, strict=True):
            if which.all():
                continue
            new = ~which & (np.linalg.eigvalsh(block.values(P, n + m) - target)[:, -1] > VIOLATED)
            which |= new
            added += int(new.sum())
        if not added:
            break
    return replace(candidate, seconds=seconds), rounds


def _verified(
    problem: Problem, candidate: Candidate, knots: Array, degree: int, unknowns: int, elevation: int
) -> tuple[float, SplineLyapunov | None, float]:
    """The gain that P itself admits, whatever the solver said; None where P proves nothing."""
    nothing = math.inf, None, math.inf
    if candidate.x is None:
        return nothing
    scaled = smat(candidate.x[:-1].reshape(unknowns, -1), len(problem.lpv.states))
    # judged as it is stored, in physical units
    P = SplineLyapunov(knots, degree, problem.units.to_physical(scaled))
    evidence = problem.evidence(elevation)
    least, conditioning = evidence.least_gain(P)
    gamma = least * math.sqrt(1 + INFLATION)
    if math.isinf(least) or not evidence.floating(P, gamma):
        return nothing
    return gamma, P, conditioning
