"""From an analysis problem to a certificate: a lower bound on the gain, the search for a proof, and
its hypotheses.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from symheli import LFT, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.box import Worst, growing, unstable_at, worst_by, worst_moving
from synthesis.certify.lower_bounds.no_common import no_common
from synthesis.certify.lower_bounds.paths import search_hypothesis
from synthesis.certify.lower_bounds.perturbation import worst_perturbation
from synthesis.certify.questions.adjoint import ADJOINT, FAR_ABOVE, backwards
from synthesis.certify.questions.apart import apart
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.finer import (
    ABOVE_FROZEN,
    by_coefficients,
    finer,
    jumps_left_out,
    over_jumps,
)
from synthesis.certify.questions.general_search import General
from synthesis.certify.questions.hypotheses import VERIFIED, hypotheses
from synthesis.certify.questions.ladder import CLOSE_TO_LOWER, Found, Ladder
from synthesis.certify.questions.one_parameter_search import OneParameter
from synthesis.certify.questions.problem import BoundProblem
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Grid
from synthesis.certify.statement.kind import L2_GAIN, STABILITY
from synthesis.certify.statement.outcome import Attempt, Seconds, Status
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.numerics.polynomial.pieces import Pieces, pieces
from synthesis.numerics.program.answer import Answer

MARGINAL_DECAY = 1e-12
"""Decay rate, 1/s, that the search must exceed where the slowest frozen mode is stable or unstable
only to rounding.
"""


SLOWER = 2.0
"""Multiple of a growth that is attained by which a model is made to decay before its decay rate is
bounded.
"""


class Beaten(NamedTuple):
    """Lower bound on the gain, in the sign of the bound, and the seconds it took to find it."""

    frozen: float
    limit: float
    worst: SchedulingTrajectory | None
    seconds: float
    perturbation: Array | None = None


def certify(problem: BoundProblem) -> Certificate:
    """Search a lower bound and a proof, and write the certificate."""
    demand, search = problem.demand, problem.search
    sign = 1.0 if demand.kind.gains else -1.0
    start = time.perf_counter()
    model, frozen, delta, unstable = _worst_member(problem)
    report = Report(problem)
    if math.isinf(frozen.value) if problem.gains else frozen.value >= 0:
        at = unstable or unstable_at(model, frozen.p or ())
        if at is not None:
            p = np.array(at) if len(at) == 1 else np.array([at])
            beaten = Beaten(
                sign * frozen.value,
                sign * frozen.value,
                SchedulingTrajectory(np.zeros(1), p),
                time.perf_counter() - start,
                delta,
            )
            return _of_growth(problem, report.nothing(Status.UNSTABLE, beaten))
        # stable or not to rounding: nothing is known from below
        frozen, search = Worst(0.0 if problem.gains else -MARGINAL_DECAY, frozen.p), None
    stability = demand.kind == STABILITY
    level = math.inf if stability else frozen.value if demand.kind.indexed else abs(frozen.value)
    ladder, best, begun = route(problem), None, time.perf_counter()
    if demand.kind == L2_GAIN and search is not None and ladder.begin(level):
        best = ladder.search(level)
        # a trajectory can only be worse by what such a proof leaves
        search = None if ladder.next_to(best, level) else search
    start += time.perf_counter() - begun
    limit = frozen if stability else worst_moving(model.source, demand, frozen, search)
    beaten = Beaten(
        sign * frozen.value,
        sign * limit.value,
        limit.trajectory,
        time.perf_counter() - start,
        delta,
    )
    if math.isinf(limit.value) if problem.gains else limit.value >= 0:
        return _of_growth(problem, report.nothing(Status.GROWING, beaten))
    best = best or ladder.search(level)
    for other in (over_jumps, by_coefficients) if stability else (by_coefficients,):
        again = None if best.proof is not None else other(problem)
        if again is not None:
            first, ladder = ladder, route(again)
            report, best = Report(again), ladder.search(level)
            ladder.attempts[:0] = first.attempts
            ladder.spent += first.spent
    if best.proof is None and stability:
        start = time.perf_counter()
        worst = growing(model.source, demand, search)
        beaten = beaten._replace(seconds=beaten.seconds + time.perf_counter() - start)
        if worst is not None:
            return report.nothing(Status.GROWING, beaten._replace(worst=worst), ladder)
    if jumps_left_out(problem) and not ladder.next_to(best, level):
        ladder.attempts.append(Attempt("P on both sides of a jump", 0.0, "left out", math.inf))
        if best.answer is Answer.INFEASIBLE:  # that no constant P exists says less
            best = best._replace(answer=Answer.UNTRIED)
    cert = report.found(best, beaten, ladder)
    if cert.status is Status.INFEASIBLE and all(map(math.isinf, demand.rates)):
        witness = no_common(model) if isinstance(problem.form, Spline) else ""
        cert = cert.resting_on((witness,) if witness else ())
    if stability or demand.kind.indexed:
        return cert
    second = (
        (1 + CLOSE_TO_LOWER, over_jumps, ()),
        (ABOVE_FROZEN, finer, ()),
        (FAR_ABOVE, backwards, (ADJOINT,)),
    )
    for above, other, added in second:
        again = other(problem) if cert.gamma > above * frozen.value else None
        if again is not None:
            both = cert, _searched(again, beaten).resting_on(added)
            tried = tuple(attempt for each in both for attempt in each.attempts)
            cert = replace(min(both, key=attrgetter("gamma")), attempts=tried)
    return cert.resting_on(search_hypothesis(search and search.seconds, beaten.seconds))


def _searched(problem: BoundProblem, beaten: Beaten) -> Certificate:
    """Search a proof of a loop whose lower bound is known."""
    ladder = route(problem)
    return Report(problem).found(ladder.search(beaten.frozen), beaten, ladder)


def _of_growth(problem: BoundProblem, cert: Certificate) -> Certificate:
    """Return a certificate of growth with the best bound of it that is found: of the model whose
    state decays faster by a multiple of what is attained. Other questions stay without one.
    """
    if not problem.demand.kind.facets.decays:
        return cert
    middle = np.array([[s.middle for s in problem.model.parameters]])
    pace = float(np.abs(np.linalg.eigvals(problem.model.at(middle).A)).max())
    by = SLOWER * -cert.upper + (pace if problem.model.dt is None else 1.0 / problem.model.dt)
    model = _decaying(problem.model, by)
    if model is None:
        return cert
    ladder = route(problem._replace(model=model))
    best = ladder.search(by + cert.upper)
    attempts = tuple(ladder.attempts)
    return replace(cert, alpha=best.bound - by, attempts=attempts) if best.proof else cert


def _decaying(model: Pieces, by: float) -> Pieces | None:
    """Return the model whose states decay by so much more, 1/s; None where its basis holds no
    constant.
    """
    source, n = model.source, model.sizes[0]
    if model.dt is not None:
        return pieces(replace(source, A=source.A * math.exp(-by * model.dt)))
    try:
        one = source.basis.constant()
    except InputError:
        return None
    return pieces(replace(source, A=source.A - by * np.multiply.outer(one, np.eye(n))))


class _LoopAndWorst(NamedTuple):
    """The `model` whose trajectories give the lower bound, and its worst `frozen` model.

    Of a set the one with `perturbation`; where no basis holds it the nominal one, beside the frozen
    one with the perturbation, which is `unstable` at some p or nowhere (None).
    """

    model: Pieces
    frozen: Worst
    perturbation: Array | None = None
    unstable: tuple[float, ...] | None = None


def _worst_member(problem: BoundProblem) -> _LoopAndWorst:
    unc = problem.uncertain
    if unc is None:
        return _LoopAndWorst(problem.model, worst_by(problem.demand, problem.model))
    found = worst_perturbation(unc, gains=problem.gains)
    try:
        model = pieces(unc.perturbed(found.delta))
    except InputError:
        at = (found.p,)
        return _LoopAndWorst(
            problem.model, Worst(found.value, at), found.delta, at if found.unstable else None
        )
    return _LoopAndWorst(model, worst_by(problem.demand, model), found.delta)


def route(problem: BoundProblem) -> Ladder:
    """Return the search for a proof that suits the problem."""
    return (OneParameter if problem.one_parameter else General)(problem)


@dataclass(frozen=True, eq=False)
class Report:
    """Writer of the certificate of a problem."""

    problem: BoundProblem

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The scheduling parameters."""
        return self.problem.model.parameters

    @property
    def model(self) -> LPVStateSpace | UncertainStateSpace | LFT:
        """The model as the user gave it."""
        return self.problem.uncertain or self.problem.model.source

    def nothing(self, status: Status, beaten: Beaten, ladder: Ladder | None = None) -> Certificate:
        """Write a certificate without a proof, for this known reason."""
        return self._made(Found(math.inf), beaten, ladder, status)

    def found(self, best: Found, beaten: Beaten, ladder: Ladder) -> Certificate:
        """Write the certificate of the best proof found."""
        kind = self.problem.demand.kind
        if best.proof is None:
            growth = kind.facets.decays and math.isfinite(best.bound)
            status = Status.GROWTH if growth else Status.without_proof(best.answer)
        else:
            status = Status.UNPROVEN if isinstance(self.problem.impose, Grid) else Status.PROVEN
        return self._made(best, beaten, ladder, status)

    def _made(
        self, best: Found, beaten: Beaten, ladder: Ladder | None, status: Status
    ) -> Certificate:
        problem, kind, proven = self.problem, self.problem.demand.kind, status is Status.PROVEN
        nothing = -math.inf if kind.facets.sense < 0 else math.inf
        names = (*kind.facets.fields, "frozen") if kind.facets.fields else ()
        told = proven or status is Status.GROWTH
        values = (best.bound if told else nothing, beaten.limit, beaten.frozen)
        bounds = dict(zip(names, values, strict=False))
        spent = ladder.spent if ladder else np.zeros(3)
        return Certificate(
            kind=kind,
            **bounds,
            status=status,
            verified=proven,
            rates=problem.demand.rates,
            hypotheses=hypotheses(
                kind,
                self.parameters,
                problem.demand.rates,
                self.model,
                (*self.how(best, status, ladder), *self.distance(bounds, best, ladder)),
            ),
            method=self.method(ladder),
            solver=str(problem.solver),
            seconds=Seconds(*(float(s) for s in spent), bounds=beaten.seconds),
            conditioning=best.conditioning,
            attempts=tuple(ladder.attempts) if ladder else (),
            worst=beaten.worst,
            perturbation=beaten.perturbation,
            indicative=best.bound if status is Status.UNPROVEN else math.nan,
            proof=best.proof,
        )

    def method(self, ladder: Ladder | None) -> str:
        """Name of the relaxation and of the form of P."""
        form, how = self.problem.form, ladder or self.problem.impose
        return f"{type(form).__name__}, {how.found_by}"

    def how(self, best: Found, status: Status, ladder: Ladder | None) -> tuple[str, ...]:
        """Hypotheses of the proof, as sentences."""
        if status is Status.UNPROVEN and isinstance(self.problem.impose, Grid):
            return (
                f"the inequalities hold at {self.problem.impose.points} values of each parameter in"
                " every region: no guarantee",
            )
        if best.proof is None or ladder is None:
            return ()
        if self.problem.one_parameter:
            what, shared = (
                "every coefficient, and a grid of p",
                "pieces, cells, strips and blossoms",
            )
        else:
            what = "the whole box, halved where needed, and a grid of p"
            shared = "pieces, regions, products of polynomials and the inequalities themselves"
        return (
            f"{best.proof.lyapunov.form}; {ladder.found_by}, for every p in its range"
            " and every admissible rate",
            VERIFIED.format(what=what, shared=shared),
        )

    def distance(
        self, bounds: dict[str, float], best: Found, ladder: Ladder | None
    ) -> tuple[str, ...]:
        """Sentences on the causes of a gap between the bounds of a gain."""
        if "gamma" not in bounds or ladder is None:
            return ()
        return apart(bounds["gamma"], bounds["lower"], ladder.rounding, best.answer)
