"""The search for P(p): assemble, solve, verify; finer P or a larger margin where that fails."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from symheli.lpv import LPVStateSpace
from synthesis.assemble.bounded_real import Blocks, assemble
from synthesis.certificate import Attempt
from synthesis.forms import Form, Problem, Relaxation, constant_form, forms, scaled_problem
from synthesis.lyapunov.spline import Lyapunov
from synthesis.program.cone_program import Answer, Candidate, Solver, solve
from synthesis.program.scaling import in_its_own_scale
from synthesis.verdict import Seconds

Array = np.ndarray

INFLATION = 1e-6
"""gamma^2 is raised by this fraction above what P admits in floating point, so that an exact proof
has room.
"""

SMALLEST = 1e-6
"""Least gain in scaled units: a model without response is given a small gain rather than none,
which no strict inequality proves.
"""

VIOLATED = 1e-8
"""A block left out of the program joins it when its largest eigenvalue (scaled) exceeds this."""
NOTHING = 1e-6
"""A largest margin of stability below this (P <= I, scaled) counts as none: the solver is no more
accurate than that.
"""
ROUNDS = 12
"""Most rounds of adding violated blocks; what then remains violated only makes the recomputed gain
larger.
"""


CLOSE = 1e-3
"""A bound within this fraction of what no proof can beat is not tried to improve upon by a constant
P.
"""


class Result(NamedTuple):
    """The best P verified (None: none was), the gain it proves (inf, NaN without channels) and how
    it came about.
    """

    gamma: float
    lyapunov: Lyapunov | None
    conditioning: float
    answer: Answer
    seconds: Seconds
    attempts: tuple[Attempt, ...]


def prove(problem: Problem, relaxation: Relaxation, solver: Solver, limit: float) -> Result:
    """Finer and finer P until the bound is within `relaxation.accept` of `limit`, then a constant
    P; the best verified one.

    The constant one proves for every rate what it proves for jumps, so that no rate is worse than
    jumps. That there is no P is said of the form that was asked for, of which a constant is one.
    """
    best = Result(math.inf, None, math.inf, Answer.UNTRIED, Seconds(), ())
    spent, attempts = np.zeros(4), []
    tried: set[int] = set()

    def attempt(form: Form, best: Result) -> Result:
        nonlocal spent, attempts
        for margin in relaxation.margins:
            result = _attempt(problem, relaxation, solver, form, margin)
            spent += np.array(result.seconds)
            attempts += result.attempts
            if result.lyapunov is not None and (best.lyapunov is None or result.gamma < best.gamma):
                best = result
            elif best.lyapunov is None and result.answer is not Answer.UNTRIED:
                best = best._replace(answer=result.answer)
            if result.lyapunov is not None or result.answer in (Answer.INFEASIBLE, Answer.UNTRIED):
                break
        return best

    for form in forms(problem, relaxation):
        if len(form.knots) in tried:
            continue
        tried.add(len(form.knots))
        best = attempt(form, best)
        if best.lyapunov is not None and not best.gamma > relaxation.accept * limit:
            break
    if form.degree and (best.lyapunov is None or best.gamma > (1 + CLOSE) * limit):
        answer, best = best.answer, attempt(constant_form(problem, relaxation), best)
        best = best if best.lyapunov is not None else best._replace(answer=answer)
    return best._replace(seconds=Seconds(*map(float, spent)), attempts=tuple(attempts))


def prove_gain(
    lpv: LPVStateSpace, rate: float, frozen: float, relaxation: Relaxation, solver: Solver
) -> tuple[Problem, Result]:
    """The least gain found and the problem in whose scale it was; `frozen` alone sets the first
    scale and says what is good enough.

    What trajectories show plays no part: a longer search for them must not change what is proven.
    """

    def found(expected: float) -> tuple[tuple[Problem, Result], float, float]:
        problem = scaled_problem(lpv, rate, expected, with_gain=True)
        result = prove(problem, relaxation, solver, frozen)
        return (problem, result), result.gamma, problem.units.channel

    tries = in_its_own_scale(found, frozen)
    problem, best = min(tries, key=lambda pair: pair[1].gamma)
    parts = [result for _, result in tries]
    if best.lyapunov is None and best.answer is not Answer.INFEASIBLE:
        # whether there is a P at all is a question with a bounded answer, which solvers handle
        # better than an infinite gain
        stable = prove(
            scaled_problem(lpv, rate, 1.0, with_gain=False), relaxation, solver, math.inf
        )
        parts.append(stable)
        best = best._replace(
            answer=Answer.INFEASIBLE if stable.answer is Answer.INFEASIBLE else best.answer
        )
    seconds = Seconds(
        *(sum(times) for times in zip(*(part.seconds for part in parts), strict=True))
    )
    return problem, best._replace(
        seconds=seconds, attempts=tuple(attempt for part in parts for attempt in part.attempts)
    )


def _attempt(
    problem: Problem, relaxation: Relaxation, solver: Solver, form: Form, margin: float
) -> Result:
    start = time.perf_counter()
    blocks = form.weighed(problem, relaxation.elevation)
    candidate, rounds = _solve_by_rounds(problem, relaxation, solver, form, blocks, margin)
    solved = time.perf_counter()
    gamma, lyapunov, conditioning = _verified(problem, candidate, form, relaxation.elevation)
    seconds = Seconds(
        solved - start - candidate.seconds, candidate.seconds, time.perf_counter() - solved
    )
    words = (
        f"{candidate.message} ({rounds} round(s)),"
        f" {'verified' if lyapunov is not None else 'not verified'}"
    )
    if problem.with_gain and lyapunov is not None:
        words += f", gamma {gamma:.6g}"
    attempt = Attempt(len(form.knots) - 1, form.degree, margin, words, gamma)
    return Result(gamma, lyapunov, conditioning, _answer(problem, candidate), seconds, (attempt,))


def _answer(problem: Problem, candidate: Candidate) -> Answer:
    """The solver's, but a largest margin of nothing, found for fewer blocks or for all of them,
    means that there is no P.
    """
    nothing = not problem.with_gain and candidate.x is not None and candidate.x[-1] <= NOTHING
    return Answer.INFEASIBLE if nothing and candidate.answer is Answer.SOLVED else candidate.answer


def _solve_by_rounds(
    problem: Problem,
    relaxation: Relaxation,
    solver: Solver,
    form: Form,
    blocks: list[Blocks],
    margin: float,
) -> tuple[Candidate, int]:
    """Solve with the blocks likely to bind, add those that came out violated, and so on: far fewer
    blocks in all.
    """
    n, m = form.size, len(problem.lpv.inputs)
    active = [np.full(len(block.constant), block.likely) for block in blocks]
    seconds, rounds = 0.0, 0
    while True:
        rounds += 1
        chosen = [
            block.keep(which) for block, which in zip(blocks, active, strict=True) if which.any()
        ]
        candidate = solve(
            assemble(chosen, n, m, form.unknowns, margin, relaxation.floor, form.null), solver
        )
        seconds += candidate.seconds
        if candidate.x is None or rounds == ROUNDS or all(which.all() for which in active):
            break
        P, level = form.coefficients(candidate.x), candidate.x[-1]
        target = (
            np.diag(np.concatenate([np.zeros(n), np.full(m, level)]))
            if problem.with_gain
            else -level * np.eye(n)
        )
        added = 0
        for block, which in zip(blocks, active, strict=True):
            if which.all():
                continue
            excess = block.values(P, n + m) - block.weight[:, None, None] * target
            new = ~which & (np.linalg.eigvalsh(excess)[:, -1] > VIOLATED)
            which |= new
            added += int(new.sum())
        if not added:
            break
    return replace(candidate, seconds=seconds), rounds


def inflated(least: float, channel: float) -> float:
    """The gain to be verified where a proof admits `least` in floating point, `channel` the unit of
    gains; NaN stays.
    """
    return least if math.isnan(least) else max(least, SMALLEST * channel) * math.sqrt(1 + INFLATION)


def _verified(
    problem: Problem, candidate: Candidate, form: Form, elevation: int
) -> tuple[float, Lyapunov | None, float]:
    """The gain that P itself admits, whatever the solver said; None where P proves nothing."""
    nothing = math.inf, None, math.inf
    if candidate.x is None:
        return nothing
    # judged as it is stored, in physical units
    P = form.lyapunov(candidate.x).in_units(
        problem.units.left, problem.units.channel**2, 1.0 / problem.units.time
    )
    evidence = problem.evidence(elevation)
    least, conditioning = evidence.least_gain(P)
    gamma = inflated(least, problem.units.channel)
    if math.isinf(least) or not evidence.floating(P, gamma):
        return nothing
    return gamma, P, conditioning
