"""The search for a proof, common to all relaxations: finer and finer P, margins in turn, a constant
P last.

A relaxation defines its units, the forms of P and one attempt; the sequence of attempts is common.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from symheli.progress import task
from synthesis.certify.questions.certificate import Proof
from synthesis.certify.questions.own_scale import in_its_own_scale
from synthesis.certify.questions.problem import BoundProblem
from synthesis.certify.statement.kind import STABILITY
from synthesis.certify.statement.outcome import Attempt
from synthesis.numerics.program.answer import Answer

INFLATION = 1e-6
"""gamma^2 is raised by this fraction above the value that P admits in floating point, to leave a
margin for the exact proof.
"""
MIN_GAIN = 1e-6
"""Least gain in scaled units: no strict inequality proves a gain of zero, so a model without
response is given this one.
"""
NO_MARGIN = 1e-6
"""A largest margin of stability (P <= I, scaled) up to this value counts as none: the solver is no
more accurate.
"""
CLOSE_TO_LOWER = 1e-3
"""A bound within this fraction of the lower bound is not improved further by a constant P."""
CLOSE_OF_MANY = 1e-2
"""The same where there are many states and form, impose and solver were left to the search."""
MAX_FROZEN_RATIO = 1.05
"""Ratio to the worst frozen gain up to which a bound by storage functions of frozen models ends the
search where there are many states.
"""
MAX_SAMPLING_ERROR = 1e-7
"""Fraction of gamma^2 that rounding may take in discrete time above which a proof in floating point
is not believed, and the exact one decides at once.
"""
DECAY_TOLERANCE = 2e-3
"""Tolerance of a decay rate, relative to the frozen one."""


class Found(NamedTuple):
    """The best verified proof (None without one), its bound (NaN for stability), and the solver's
    answer.
    """

    bound: float
    proof: Proof | None = None
    answer: Answer = Answer.UNTRIED
    conditioning: float = math.inf

    def or_better(self, other: Found, sign: float) -> Found:
        """Return the better of the two; `sign` 1: a smaller bound is better, -1: a larger one."""
        if other.proof is not None:
            better = self.proof is None or sign * other.bound < sign * self.bound
            return other if better else self
        if self.proof is None and other.answer is not Answer.UNTRIED:
            return self._replace(answer=other.answer)
        return self


class Ladder(ABC):
    """A sequence of relaxations, with the programs tried (`attempts`) and the seconds to build,
    solve and verify them (`spent`).
    """

    def __init__(self, problem: BoundProblem):
        self.problem = problem
        self.attempts: list[Attempt] = []
        self.spent = np.zeros(3)
        self.rounding = math.nan
        """By which fraction a gain of a frozen model was missed in the units of the programs, NaN
        where that was not computed.
        """
        self.unit = self.expect(1.0)
        self.frozen = -math.inf
        """Worst gain of a frozen model; of a question without a gain -inf."""
        self._begun: tuple[Found, Found | None] | None = None

    @cached_property
    def sampling_error(self) -> float:
        """Fraction of gamma^2 that rounding of A may take where it is nearly I, as of a model that
        is sampled finely: the inequality is as large as the decay in one sample; 0 in continuous
        time.
        """
        model = self.problem.model
        if model.dt is None:
            return 0.0
        low, high = np.array([(s.low, s.high) for s in model.parameters]).T
        A = model.at(low + np.linspace(0.0, 1.0, 9)[:, None] * (high - low)).A
        decay = 1.0 - float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
        return 4.0 * len(A[0]) * float(np.finfo(float).eps) / max(decay, np.finfo(float).eps)

    def believed(self, proof: Proof, bound: float) -> bool:
        """Whether floating point suffices to believe a proof that it has verified; else decide
        exactly: so where a gain is below that of a frozen model by what may be rounding. A larger
        contradiction is an error, which the certificate refuses.
        """
        rounded = (1 - CLOSE_TO_LOWER) * self.frozen < bound < self.frozen
        doubted = self.sampling_error > MAX_SAMPLING_ERROR or rounded
        return not doubted or proof.evidence.exact(proof.lyapunov, bound)

    @property
    def found_by(self) -> str:
        """Name of the relaxation used in the search."""
        return self.problem.impose.found_by

    @abstractmethod
    def expect(self, bound: float) -> float:
        """Set the units in which numbers are of order one if the bound is near this one; return the
        unit of gains.
        """

    @property
    def margins(self) -> tuple[float, ...]:
        """Margins of the programs in turn; without a gain the margin itself is maximised."""
        return self.problem.impose.tried if self.problem.gains else (0.0,)

    def proposed(self) -> Found:
        """Return a bound on the gain proven without a program."""
        return Found(math.inf)

    def simple(self) -> Any:
        """Return the form of P in one segment, None where it costs about as much as the others or
        was not asked for.
        """
        return None

    many_states = False
    """Whether there are so many states that a program takes minutes."""

    def of_frozen_models(self, limit: float) -> Found:
        """Return a bound on the gain proven by storage functions of frozen models, whose worst gain
        is `limit`.
        """
        return Found(math.inf)

    def settle(self) -> float:
        """Choose the units of the programs where several are possible; return the unit of gains."""
        return self.unit

    @abstractmethod
    def shapes(self) -> list[Any]:
        """Forms of P to try in turn, finer and finer."""

    @abstractmethod
    def constant(self) -> Any:
        """The form of a constant P, which proves the same for every rate and for jumps."""

    @abstractmethod
    def varies(self, shape: Any) -> bool:
        """Whether P depends on p."""

    @abstractmethod
    def attempt(self, shape: Any, margin: float, alpha: float = 0.0) -> Found:
        """Assemble, solve and verify a program; `alpha` is the requested decay rate, 1/s."""

    def begin(self, limit: float) -> bool:
        """Make the attempts at a gain that cost least, from whose result `search` goes on; return
        whether they prove any. `limit` is the worst frozen gain.
        """
        with task("searching a proof") as self._searching:
            self.unit, self.frozen = self.expect(limit), limit
            self._begun = self._cheapest(limit)
        return any(found and found.proof for found in self._begun)

    def search(self, limit: float) -> Found:
        """Return the best bound found. `limit`, the worst frozen value, sets the first scale and
        the level at which the search may stop.

        What trajectories show plays no part: a longer search for them must not change what is
        proven.
        """
        with task("searching a proof") as self._searching:
            return self._searched(limit)

    def _searched(self, limit: float) -> Found:
        if self.problem.demand.kind.facets.decays:
            return self._decay(limit)
        if self.problem.demand.kind.indexed:
            return self._index(limit)
        if not self.problem.gains:
            return self._least(limit)
        self.frozen = limit

        def found(expected: float) -> tuple[Found, float, float]:
            if self._begun is None:
                self.unit = self.expect(expected)
            best = self._least(limit)
            return best, best.bound, self.unit

        best = min(in_its_own_scale(found, limit), key=lambda tried: tried.bound)
        if best.proof is None and best.answer not in (Answer.INFEASIBLE, Answer.UNTRIED):
            best = best._replace(answer=self._whether_any(best.answer))
        return best

    def _whether_any(self, answer: Answer) -> Answer:
        """Decide whether any P exists. Solvers handle this bounded problem better than an infinite
        gain; not where it takes all inequalities at once of a model with many states, which fill
        gigabytes.
        """
        problem = self.problem
        if problem.by_points:
            return answer
        other = type(self)(problem._replace(demand=problem.demand._replace(kind=STABILITY)))
        stable = other.search(math.inf)
        self.attempts += other.attempts
        self.spent += other.spent
        return Answer.INFEASIBLE if stable.answer is Answer.INFEASIBLE else answer

    def _least(self, limit: float) -> Found:
        gains = self.problem.gains
        best, still = self._begun or self._cheapest(limit)
        self._begun = None
        for found in (best, still):
            if found and self.next_to(found, limit):
                return found
        shapes, near = self.shapes(), self.problem.form.near
        if gains and self.many_states:
            # before programs that take minutes
            best = best.or_better(self.of_frozen_models(limit), 1.0)
            if best.proof is not None and best.bound <= MAX_FROZEN_RATIO * limit:
                return best
        for shape in shapes:
            best = self._margins(shape, best)
            if best.proof is not None and not best.bound > near * limit:
                break
        untried = still is None or (self.many_states and still.proof is None)
        if untried and best.proof is None and any(map(self.varies, shapes)):
            still = self._margins(self.constant(), Found(math.inf if gains else math.nan))
        if gains and not self.many_states and not best.bound <= near * limit:
            best = best.or_better(self.of_frozen_models(limit), 1.0)
        if still is not None:
            # "no P exists" refers to the form requested, of which a constant P is a special case
            answer, best = best.answer, best.or_better(still, 1.0)
            best = best if best.proof is not None else best._replace(answer=answer)
        return best

    def _cheapest(self, limit: float) -> tuple[Found, Found | None]:
        """Return what is proven without a program, and by a constant P or, of many states, by one
        polynomial P (None: not tried).
        """
        if not self.problem.gains:
            return Found(math.nan), None
        best = self.proposed()
        if self.next_to(best, limit):
            return best, None
        self.unit = self.settle()
        if not any(map(self.varies, self.shapes())):
            return best, None
        if self.many_states:
            # P in one segment costs as little as a constant one, which is a case of it
            simple = self.simple()
            return best, None if simple is None else self._margins(simple, Found(math.inf))
        # cheapest, and enough where p changes little
        return best, self._margins(self.constant(), Found(math.inf))

    def next_to(self, found: Found, limit: float) -> bool:
        """Whether this gain is proven and cannot be improved to speak of."""
        long = self.many_states and self.problem.usual
        near = found.bound <= (1 + (CLOSE_OF_MANY if long else CLOSE_TO_LOWER)) * limit
        return self.problem.gains and found.proof is not None and near

    def _margins(self, shape: Any, best: Found) -> Found:
        for margin in self.margins:
            found = self._tried(shape, margin)
            best = best.or_better(found, 1.0)
            if found.proof is not None or found.answer in (Answer.INFEASIBLE, Answer.UNTRIED):
                break
        return best

    def _tried(self, shape: Any, margin: float, alpha: float = 0.0) -> Found:
        found = self.attempt(shape, margin, alpha)
        self._searching.step(str(self.attempts[-1]) if self.attempts else "")
        return found

    def _index(self, limit: float) -> Found:
        """Return the best level found of a supply rate, of any sign; `limit`, the worst frozen one,
        ends the search where it is met.
        """
        sense = float(self.problem.demand.kind.facets.sense)
        best, nothing = Found(sense * math.inf), Found(sense * math.inf)
        for shape in (self.constant(), *self.shapes()):
            found = self._margins(shape, nothing)
            best = best.or_better(found, sense)
            near = abs(best.bound - sense * limit) <= CLOSE_TO_LOWER * max(abs(limit), self.unit)
            if best.proof is not None and near:
                break
        return best

    def _decay(self, limit: float) -> Found:
        """Return the largest decay rate found, between 0 and `limit` (1/s); each P counts for the
        rate that it proves.
        """
        best, shape = Found(-math.inf), None
        tolerance = DECAY_TOLERANCE * limit
        for shape in self.shapes():
            best = self._bisected(shape, best, limit - tolerance, limit)
            if best.proof is not None and best.bound * self.problem.form.near >= limit:
                break
        if shape is not None and self.varies(shape) and best.bound < limit - 2 * tolerance:
            # a constant P is tried first
            trial = limit - tolerance if best.proof is None else best.bound + tolerance
            answer, best = best.answer, self._bisected(self.constant(), best, trial, limit)
            best = best if best.proof is not None else best._replace(answer=answer)
        return best

    def _bisected(self, shape: Any, best: Found, trial: float, limit: float) -> Found:
        tolerance = DECAY_TOLERANCE * limit
        low, high = max(best.bound, 0.0), limit
        while True:
            found = self._tried(shape, 0.0, trial)
            if found.proof is not None and not found.bound > 0:
                # growth that is bounded: no proof of decay, but a number to name
                found = Found(max(found.bound, best.bound), None, found.answer)
                best = found if best.proof is None else best
            else:
                best = best.or_better(found, -1.0)
            if found.answer is Answer.UNTRIED:
                return best
            # P proves less than requested: the lower half is skipped
            low = max(low, found.bound if found.proof is not None else 0.0)
            high = high if low >= trial else trial
            if high - low <= tolerance:
                return best
            trial = 0.5 * (low + high)


def inflated(least: float, channel: float, error: float = 0.0) -> float:
    """Return the gain to be verified where a proof admits `least` in floating point, `channel` the
    unit of gains and `error` the fraction of gamma^2 that rounding may take; NaN stays NaN.
    """
    if math.isnan(least):
        return least
    return max(least, MIN_GAIN * channel) * math.sqrt(1 + max(INFLATION, error))
