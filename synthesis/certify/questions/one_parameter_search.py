"""The search for models of one parameter: a fast assembly, and blocks that are added as they are
violated.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.assemble.bounded_real import assemble
from synthesis.certify.assemble.unknowns import (
    Quadratic,
    ScaledProblem,
    Unknown,
    constant,
    scaled_problem,
    unknowns,
)
from synthesis.certify.questions.certificate import Proof
from synthesis.certify.questions.frozen_storage import LEVELS, of_frozen_models
from synthesis.certify.questions.ladder import CLOSE_TO_LOWER, NO_MARGIN, Found, Ladder, inflated
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Bernstein
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.scaling import dissipative, storage_of
from synthesis.certify.statement.spline import Lyapunov, SplineLyapunov
from synthesis.numerics.linear.norm import norm, to_continuous
from synthesis.numerics.polynomial.symmetric import smat
from synthesis.numerics.program import interior_point
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import LYAPUNOV, SolverPoint, solve
from synthesis.numerics.program.lyapunov_program import (
    MANY_STATES,
    LyapunovBlocks,
    LyapunovProgram,
    Sizes,
)

MAX_VIOLATION = 1e-8
"""Largest eigenvalue (scaled) of a block outside the program above which the block is added."""
GAIN_MARGINS = (1e-6, 1e-5, 1e-4, 5e-4, 2e-3, 1e-2)
"""Fractions above the expected gain at which a storage function of a frozen model is computed."""
SHIFTS_TO_IDENTITY = (1e-3, 1e-2, 0.1, 0.5)
"""Weights of I in the convex combinations of P and I that are tried."""
FEW_BLOCKS = 256
"""Number of blocks up to which a program of products with P has all of them at once."""
POINT_TOLERANCE = 1e-3
"""Least relative gap to which a program that begins with blocks at single p is solved."""
LEVEL_TOLERANCE = 4e-3
"""Fraction above its level, a square of a gain, up to which a block outside it is not added."""
ADDED = 8
"""Number of blocks of one cell that are added in a round, about."""
MAX_ROUNDS = 12
"""Largest number of rounds in which violated blocks are added; blocks violated after the last one
only raise the recomputed gain.
"""


class OneParameter(Ladder):
    """Splines P(p), with a memory of p or of higher order in x, in scaled
    units.
    """

    def expect(self, bound: float) -> float:
        """Set the units for this expected gain; return the unit of gains."""
        model, (rate,) = (
            self.problem.uncertain or self.problem.model.source,
            self.problem.demand.rates,
        )
        self.scaled = scaled_problem(model, rate, bound, with_gain=self.problem.gains)
        self.dissipating: ScaledProblem | None = None
        self.rounding = math.nan
        lpv, units = self.scaled.lpv, self.scaled.units
        if self.problem.gains and self.scaled.block is None:
            other = dissipative(units, lpv.at(lpv.scheduling.middle), bound)
            self.dissipating = None if other is None else self.scaled.in_units(other)
        return units.channel

    def shapes(self) -> list[Unknown]:
        """Forms of V that the user requested, each number of knots once."""
        return list(
            {
                len(u.knots): u for u in reversed([*unknowns(self.scaled, self.problem.form)])
            }.values()
        )[::-1]

    def constant(self) -> Unknown:
        """A constant P of the requested form of V."""
        return constant(self.scaled, self.problem.form)

    def varies(self, shape: Unknown) -> bool:
        """Whether P depends on p."""
        return shape.degree > 0

    @property
    def elevation(self) -> int:
        """Increase of the degree of the Bernstein forms."""
        assert isinstance(self.problem.impose, Bernstein)  # noqa: S101 - see `Problem`
        return self.problem.impose.elevation

    def attempt(self, shape: Unknown, margin: float, alpha: float = 0.0) -> Found:
        """Solve and verify a program with one form of P and one margin."""
        start = time.perf_counter()
        candidate = self._solve(shape, margin)
        solved = time.perf_counter()
        found = self._judged(candidate, shape)
        self.spent += (
            solved - start - candidate.seconds,
            candidate.seconds,
            time.perf_counter() - solved,
        )
        verified = "verified" if found.proof is not None else "not verified"
        words = f"{candidate.message}, {verified}"
        if self.problem.gains and found.proof is not None:
            words += f", gamma {found.bound:.6g}"
        program = f"{len(shape.knots) - 1} segments of degree {shape.degree}"
        self.attempts.append(Attempt(program, margin, words, found.bound))
        return found

    def _solve(self, shape: Unknown, margin: float) -> SolverPoint:
        if self.problem.solver.name == LYAPUNOV:
            return self._solve_by_products(shape, margin)
        return self._solve_by_rounds(shape, margin)

    def _solve_by_products(self, form: Unknown, margin: float) -> SolverPoint:
        """Solve with the blocks kept as products with P: all where they are few; else those at
        single p, with some of every cell where one is violated added until none is.
        """
        assert isinstance(form, Quadratic)  # noqa: S101 - see `Problem`
        blocks, solver = form.products(self.scaled, self.elevation), self.problem.solver
        sizes, floor = self.scaled.sizes(form), self.problem.impose.least
        if sum(len(block.constant) for block in blocks) <= FEW_BLOCKS:
            return interior_point.minimise(LyapunovProgram(blocks, sizes, margin, floor), solver)
        active: list[Array] = [np.zeros(len(block.constant), bool) for block in blocks]
        coarse = replace(solver, tolerance=max(POINT_TOLERANCE, solver.options["tolerance"]))
        chosen, seconds, rounds = self._at_points(form), 0.0, 0
        while True:
            rounds += 1
            program = LyapunovProgram(chosen, sizes, margin, floor)
            candidate = interior_point.minimise(program, coarse)
            seconds += candidate.seconds
            if candidate.x is None or rounds == MAX_ROUNDS:
                break
            level = candidate.x[-1] * (1 + LEVEL_TOLERANCE if self.problem.gains else 1)
            P = smat(form.coefficients(candidate.x), form.size)
            multiplier = form.multiplier(candidate.x)
            added: list[LyapunovBlocks] = []
            for block, which in zip(blocks, active, strict=True):
                excess = block.linear(P) + block.constant - self._target(sizes, level)
                if block.supply is not None:
                    excess = excess + block.supply.matrices(multiplier)
                largest = np.where(which, 0.0, np.linalg.eigvalsh(excess)[:, -1])
                if largest.max() > 0.0:
                    # others beside the worst would be the next
                    apart = max(1, len(which) // ADDED)
                    new = np.arange(largest.argmax() % apart, len(which), apart)
                    new = new[~which[new]]
                    which[new] = True
                    added.append(block.keep(new))
            if not added:
                break
            chosen = (*chosen, *added)
        message = f"{candidate.message} ({rounds} round(s))"
        return replace(candidate, seconds=seconds, message=message)

    def _at_points(self, form: Quadratic) -> tuple[LyapunovBlocks, ...]:
        """Return the blocks at single p with which a program of many blocks begins."""
        scaled, models = self.scaled, []
        points = form.points(scaled)
        for at in points:
            model = scaled.units.of_matrices(scaled.lpv.matrices(at), scaled.block)
            models.append(Matrices(*to_continuous(*model)) if scaled.discrete else model)
        return form.at_points(scaled, points, models)

    def _target(self, sizes: Sizes, level: float) -> Array:
        """Return what a block of weight 1 may be at most at this level, g or -t."""
        if self.problem.gains:
            return np.diag(np.r_[np.zeros(sizes.strict), np.full(sizes.inputs, level)])
        return -level * np.eye(sizes.rows)

    def _solve_by_rounds(self, form: Unknown, margin: float) -> SolverPoint:
        """Solve with the blocks likely to be active, add the violated ones, and repeat: this needs
        far fewer blocks.
        """
        blocks = form.weighed(self.scaled, self.elevation)
        sizes = self.scaled.sizes(form)
        active = [np.full(len(block.constant), block.likely) for block in blocks]
        seconds, rounds = 0.0, 0
        while True:
            rounds += 1
            chosen = [
                block.keep(which)
                for block, which in zip(blocks, active, strict=True)
                if which.any()
            ]
            candidate = solve(
                assemble(chosen, sizes, margin, self.problem.impose.least, form.null),
                self.problem.solver,
            )
            seconds += candidate.seconds
            if candidate.x is None or rounds == MAX_ROUNDS or all(which.all() for which in active):
                break
            P, multiplier = form.coefficients(candidate.x), form.multiplier(candidate.x)
            target, added = self._target(sizes, candidate.x[-1]), 0
            for block, which in zip(blocks, active, strict=True):
                if which.all():
                    continue
                excess = block.values(P, sizes.rows, multiplier)
                excess = excess - block.weight[:, None, None] * target
                new = ~which & (np.linalg.eigvalsh(excess)[:, -1] > MAX_VIOLATION)
                which |= new
                added += int(new.sum())
            if not added:
                break
        message = f"{candidate.message} ({rounds} round(s))"
        return replace(candidate, seconds=seconds, message=message)

    def proposed(self) -> Found:
        """Return the gain proven by a constant P, a storage function of the model at mid-range."""
        start, scaled, best = time.perf_counter(), self.dissipating, Found(math.inf)
        if scaled is not None:
            knots, middle = self.constant().knots, scaled.lpv.at(scaled.lpv.scheduling.middle)
            for above in GAIN_MARGINS:
                P = storage_of(scaled.units, middle, above)
                if P is None:
                    continue
                lyapunov = SplineLyapunov(knots, 0, P[None])
                best = self._proven(scaled, lyapunov, Answer.UNTRIED)
                if best.proof is not None:
                    word = f"verified, gamma {best.bound:.6g}"
                    self.attempts.append(Attempt("a Riccati equation", 0.0, word, best.bound))
                    self.unit = scaled.units.channel
                    break
        self.spent[2] += time.perf_counter() - start
        return best

    @property
    def many_states(self) -> bool:  # type: ignore[override]
        """Whether there are so many states that a program takes minutes."""
        return len(self.scaled.lpv.states) > MANY_STATES

    def simple(self) -> Unknown | None:
        """Return P in one segment, of many states where the user left the segments open."""
        tried = self.problem.form.segments_tried(1)
        if not self.many_states or (tried and len(tried) == 1):
            return None
        return next(unknowns(self.scaled, replace(self.problem.form, segments=1)))

    def of_frozen_models(self, limit: float) -> Found:
        """Return the gain proven by P linear between storage functions of frozen models; nothing
        around a block, and where the user set the form of P.
        """
        form, scaled, best = self.problem.form, self.dissipating, Found(math.inf)
        tried = form.segments_tried(1)
        given = not isinstance(form, Spline) or form.degree == 0 or (tried and len(tried) == 1)
        if given or scaled is None or math.isinf(scaled.rate):
            return best
        start = time.perf_counter()
        for level in LEVELS:
            P = of_frozen_models(scaled, level * limit / scaled.units.channel)
            best = best if P is None else self._proven(scaled, P, Answer.SOLVED)
            if P is not None and best.proof is not None:
                words = f"storage functions of frozen models, verified, gamma {best.bound:.6g}"
                program = f"{P.segments} segments of degree {P.degree}"
                self.attempts.append(Attempt(program, 0.0, words, best.bound))
                self.unit = scaled.units.channel
                break
        self.spent[1] += time.perf_counter() - start
        return best

    def settle(self) -> float:
        """Choose the first units in which the gain of the model frozen at mid-range is found
        accurately: this shows whether rounding limits a bound.
        """
        start, shape, p = time.perf_counter(), self.constant(), self.scaled.lpv.scheduling.middle
        if self.dissipating is not None and isinstance(shape, Quadratic):
            gain = norm(*self.scaled.lpv.matrices(p), self.scaled.lpv.dt)[0]
            for scaled in (self.scaled, self.dissipating):
                excess = self._frozen_gain(scaled, shape, p) / gain - 1 if gain > 0 else 0.0
                if not excess >= self.rounding:
                    self.scaled, self.rounding = scaled, excess
                if excess <= CLOSE_TO_LOWER:
                    break
        self.spent[1] += time.perf_counter() - start
        return self.scaled.units.channel

    def _frozen_gain(self, scaled: ScaledProblem, shape: Quadratic, p: float) -> float:
        """Return the gain of the model frozen at p that a program in these units proves."""
        whole, self.scaled = self.scaled, scaled.frozen(p)
        margin = self.problem.impose.tried[0]
        found = self._judged(self._solve(shape, margin), shape)
        self.scaled = whole
        return found.bound

    def _judged(self, candidate: SolverPoint, shape: Unknown) -> Found:
        """Compute the gain that P itself admits, whatever status the solver reported."""
        answer = candidate.answer
        if candidate.x is None:
            return Found(math.inf, None, answer)
        # the largest margin is zero, for some blocks or for all of them: there is no P
        if not self.problem.gains and candidate.x[-1] <= NO_MARGIN and answer is Answer.SOLVED:
            answer = Answer.INFEASIBLE
        P = shape.lyapunov(candidate.x)
        found = self._proven(self.scaled, P, answer)
        if self.scaled is self.dissipating:
            # P = I has margins of one: a convex combination regains what rounding took
            for share in SHIFTS_TO_IDENTITY:
                if found.proof is not None:
                    break
                inner = (1 - share) * P.coefficients + share * np.eye(P.coefficients.shape[-1])
                found = self._proven(self.scaled, replace(P, coefficients=inner), answer)
        return found

    def _proven(self, scaled: ScaledProblem, P: Lyapunov, answer: Answer) -> Found:
        """Verify P, given in scaled units, in physical units as it is stored; with its coordinates
        where rounding to those units takes too much.
        """
        units, evidence = scaled.units, scaled.evidence(self.elevation)
        own, P = P, P.in_units(units.left, units.channel**2, 1.0 / units.time, units.multiplier)
        least, conditioning = evidence.least_gain(P)
        if isinstance(own, SplineLyapunov) and own.order == 1 and own.multiplier is None:
            kept = own.kept_in(units.left, units.channel**2)
            unrounded, condition = evidence.least_gain(kept)
            if unrounded * (1 + CLOSE_TO_LOWER) < least:
                P, least, conditioning = kept, unrounded, condition
        gamma, proof = inflated(least, units.channel, self.sampling_error), Proof(evidence, P)
        if math.isinf(least) or not evidence.floating(P, gamma):
            return Found(math.inf, None, answer)
        if not (self.believed(proof, gamma) if P.coordinates is None else proof.exact(gamma)):
            return Found(math.inf, None, answer)
        return Found(gamma, proof, answer, conditioning)
