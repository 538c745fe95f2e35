"""Certified L2 gain and stability of an LFT whose parameters are arbitrarily fast."""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

from symheli import LFT, Scheduling
from symheli.errors import InputError
from symheli.values.arrays import Array
from synthesis.certify.lft.classes import check_scaling, multiplier_class
from synthesis.certify.lft.coordinates import coordinates, scaled
from synthesis.certify.lft.multipliers import Multiplier
from synthesis.certify.lft.program import (
    gain_program,
    inequality,
    margin_program,
    unpack,
    with_state_channels,
)
from synthesis.certify.lft.proof import LFTEvidence, QuadraticStorage
from synthesis.certify.lower_bounds.lines import (
    BoxGain,
    box_growing_trajectory,
    box_lower_bound,
    frozen_box_gain,
)
from synthesis.certify.lower_bounds.lower_bound import THOROUGH, LowerBoundSearch
from synthesis.certify.lower_bounds.paths import search_hypothesis
from synthesis.certify.questions.certificate import Certificate, Proof
from synthesis.certify.questions.certify import Beaten, Report
from synthesis.certify.questions.hypotheses import VERIFIED
from synthesis.certify.questions.ladder import NO_MARGIN, Found, Ladder, inflated
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Bernstein
from synthesis.certify.statement.kind import L2_GAIN, STABILITY, Kind
from synthesis.certify.statement.outcome import Attempt, Status
from synthesis.certify.statement.trajectory import SchedulingTrajectory
from synthesis.numerics.linear.norm import surely_unstable
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.program.answer import Answer
from synthesis.numerics.program.cone_program import Solver, general_solver, solve

MARGINS = (1e-7, 1e-6, 1e-5, 1e-3)
"""The (x, w) block is held below -margin I in scaled coordinates, tried in turn until the answer is
verified.
"""


def lft_gain(
    lft: LFT,
    scaling: str = "DG",
    *,
    solver: Solver | str = "CLARABEL",
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify an upper bound on the L2 gain of an LFT for arbitrarily fast p(t) in its box.

    Parameters
    ----------
    lft : LFT
        The model. Reduce it first: superfluous copies of a parameter cost time.
    scaling : str
        "small gain", "D", "DG" or "full block", from the most conservative to the least.
    solver : Solver or str
        Which solver, and when it stops.
    search : LowerBoundSearch or None
        How hard to look for bad trajectories; None: not at all.

    Returns
    -------
    Certificate
        `gamma` bounds the gain; it is recomputed from P and the multiplier alone and verified. A
        failed solve is a certificate with gamma = inf and its reason in `status`.

    Raises
    ------
    InputError
        For a model that is no LFT or has no channels.
    UnknownNameError
        For a scaling of another name.
    SolverError
        For a solver that is not installed.

    See Also
    --------
    synthesis.l2_gain : worst-case gain while p moves
    synthesis.analysis.lft_stability : stability of an LFT
    synthesis.designs.lft_feedback : controllers for parameters that may jump

    References
    ----------
    Fan, Tits and Doyle, IEEE Trans. Automatic Control 36 (1991), D and G scalings; Scherer, "LPV
    control and full block multipliers", Automatica 37 (2001), full blocks.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = lft_gain(lag.to_lft().reduce(), search=None)
    >>> print(f"{cert.gamma:.3f}")
    1.000
    """
    return _certified(_checked(lft, scaling, L2_GAIN, solver, search))


def lft_stability(
    lft: LFT,
    scaling: str = "DG",
    *,
    solver: Solver | str = "CLARABEL",
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify that the state of an LFT decays for arbitrarily fast p(t) in its box.

    Parameters
    ----------
    lft : LFT
        The model; its channels play no part. Reduce it first: superfluous copies of a parameter
        cost time.
    scaling : str
        "small gain", "D", "DG" or "full block", from the most conservative to the least.
    solver : Solver or str
        Which solver, and when it stops.
    search : LowerBoundSearch or None
        How hard to look for bad trajectories; None: not at all.

    Returns
    -------
    Certificate
        `verified` is the answer; `gamma`, `lower` and `frozen` are NaN.

    Raises
    ------
    InputError
        For a model that is no LFT.
    UnknownNameError
        For a scaling of another name.
    SolverError
        For a solver that is not installed.

    References
    ----------
    Fan, Tits and Doyle, IEEE Trans. Automatic Control 36 (1991), D and G scalings; Scherer, "LPV
    control and full block multipliers", Automatica 37 (2001), full blocks.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> lft_stability(lag.to_lft().reduce()).verified
    True
    """
    return _certified(_checked(lft, scaling, STABILITY, solver, search))


class LFTProblem(NamedTuple):
    """An LFT, without channels where stability is to be shown, and the class of multipliers."""

    lft: LFT
    scaling: str
    demand: Demand
    solver: Solver
    search: LowerBoundSearch | None
    form = Spline(degree=0)
    impose = Bernstein(margins=MARGINS)

    @property
    def gains(self) -> bool:
        """Whether the bound is a gain."""
        return self.demand.kind == L2_GAIN


def _checked(
    lft: LFT, scaling: str, kind: Kind, solver: Solver | str, search: LowerBoundSearch | None
) -> LFTProblem:
    if not isinstance(lft, LFT):
        raise InputError(
            f"expected an LFT, got {type(lft).__name__}; a polynomial LPVStateSpace becomes one"
            " with .to_lft().reduce()"
        )
    check_scaling(scaling, lft.sizes)
    if not lft.states:
        raise InputError(
            "the LFT has no states; its gain is the largest norm of its matrix over the box"
        )
    solver = general_solver(solver)
    if kind == STABILITY:
        lft = lft.select(inputs=(), outputs=())
    elif not (lft.inputs and lft.outputs):
        raise InputError(
            f"a gain needs inputs and outputs, got {len(lft.inputs)} and {len(lft.outputs)}; see"
            " lft_stability"
        )
    every, m = lft.parameters, len(lft.parameters)
    box = tuple((float(s.low), float(s.high)) for s in every)
    demand = Demand(kind, Motion(box, (math.inf,) * m, (None,) * m))
    return LFTProblem(lft, scaling, demand, solver, search)


def _certified(problem: LFTProblem) -> Certificate:
    """Search a lower bound and a proof, and write the certificate."""
    lft, _, _, _, search = problem
    start, report, worst = time.perf_counter(), LFTReport(problem), None  # type: ignore[arg-type]
    frozen = frozen_box_gain(lft)
    if math.isinf(frozen.gain) and surely_unstable(lft.at(*frozen.p).A, lft.dt):
        p = np.array([frozen.p])
        worst = SchedulingTrajectory(np.zeros(1), p[:, 0] if p.shape[1] == 1 else p)
        beaten = Beaten(math.inf, math.inf, worst, time.perf_counter() - start)
        return report.nothing(Status.UNSTABLE, beaten)
    ladder = MultiplierSearch(problem)  # type: ignore[arg-type]
    if not problem.gains:
        best, start = ladder.search(math.inf), time.perf_counter()
        worst = None if best.proof is not None else box_growing_trajectory(lft, search)
        beaten = Beaten(math.nan, math.nan, worst, time.perf_counter() - start)
        if worst is not None:
            return report.nothing(Status.GROWING, beaten, ladder)
        return report.found(best, beaten, ladder)
    if math.isinf(frozen.gain):
        # stability is decided by rounding: there is no lower bound
        frozen, search = BoxGain(0.0, frozen.p, math.nan), None
    below = box_lower_bound(lft, frozen, search)
    seconds = time.perf_counter() - start
    beaten = Beaten(frozen.gain, below.gain, below.trajectory, seconds)
    best = ladder.search(frozen.gain)
    growing = best.proof is None and math.isinf(below.gain)
    cert = (
        report.nothing(Status.GROWING, beaten, ladder)
        if growing
        else report.found(best, beaten, ladder)
    )
    return cert.resting_on(search_hypothesis(search and search.seconds, seconds))


class MultiplierSearch(Ladder):
    """A constant P with the multipliers of one class, in the coordinates of the `evidence`."""

    problem: LFTProblem  # type: ignore[assignment]
    margins = MARGINS  # type: ignore[assignment]

    def expect(self, bound: float) -> float:
        """Set the coordinates for this expected gain; return the unit of gains."""
        lft, scaling, *_ = self.problem
        # a small gain means one thing only in the coordinates the LFT has, up to a number
        self.evidence = LFTEvidence(lft, coordinates(lft, bound, one=scaling == "small gain"))
        self.multipliers = multiplier_class(scaling, lft.sizes)
        loop = scaled(lft, self.evidence.coordinates)
        if not self.problem.gains:
            loop = with_state_channels(loop)
        self.inputs = loop.Bu.shape[1]
        units = self.evidence.coordinates.units
        self.linear = inequality(loop, self.multipliers, lft.dt is None).congruent(units.weight)
        return units.channel

    def shapes(self) -> list[str]:
        """The class of multipliers, the only form to try."""
        return [self.problem.scaling]

    def constant(self) -> str:
        """The same class: P is constant."""
        return self.problem.scaling

    def varies(self, shape: str) -> bool:
        """Whether P depends on p; always False."""
        return False

    def _margins(self, shape: str, best: Found) -> Found:
        """Search the least gain; where none can be verified, the largest margin of stability."""
        best = super()._margins(shape, best)
        return best if best.proof is not None else best.or_better(self._tried(shape, 0.0), 1.0)

    def _whether_any(self, answer: Answer) -> Answer:
        return answer

    def attempt(self, shape: str, margin: float, alpha: float = 0.0) -> Found:
        """Solve and verify with one margin; 0: the largest margin, from which multiples of P may
        prove a gain.
        """
        start, x = time.perf_counter(), len(self.problem.lft.states)
        program = (
            gain_program(self.linear, self.multipliers, x, self.inputs, margin)
            if margin
            else margin_program(self.linear, self.multipliers, x, self.inputs)
        )
        name, weights = ("gain", np.ones(1)) if margin else ("margin", 10.0 ** np.arange(-2, 10))
        built = time.perf_counter()
        candidate = solve(program, self.problem.solver)
        solved, answer = time.perf_counter(), candidate.answer
        if not margin:
            margin = math.nan if candidate.x is None else float(candidate.x[-1])
            none = Answer.INFEASIBLE if margin <= NO_MARGIN else Answer.FAILED
            # a program that is not solved does not change the answer
            answer = none if answer is Answer.SOLVED else Answer.UNTRIED
        found = Found(math.inf, None, answer)
        for weight in weights:
            if candidate.x is None:
                break
            found = found.or_better(self._proven(float(weight) * candidate.x, answer), 1.0)
            if found.proof is not None and not self.problem.gains:
                break  # one multiple is as good as another
        self.spent += (built - start, solved - built, time.perf_counter() - solved)
        words = "not verified" if found.proof is None else "verified"
        self.attempts.append(Attempt(name, margin, f"{candidate.message}, {words}", found.bound))
        return found

    def _proven(self, x: Array, answer: Answer) -> Found:
        """Verify P and the multiplier at the solver's point, in physical units."""
        lft, (units, left, _) = self.problem.lft, self.evidence.coordinates
        P, Q, S, R = unpack(x, self.multipliers, len(lft.states))
        multiplier = Multiplier(self.problem.scaling, lft.sizes, Q, S, R)
        proof = QuadraticStorage(
            units.to_physical(P), multiplier.transformed(left, units.channel**2)
        )
        least, conditioning = self.evidence.least_gain(proof)
        gamma = inflated(least, units.channel)
        if math.isinf(gamma) or not self.evidence.floating(proof, gamma):
            return Found(math.inf, None, answer)
        return Found(gamma, Proof(self.evidence, proof), answer, conditioning)


class LFTReport(Report):
    """Writer of the certificate of an LFT."""

    problem: LFTProblem  # type: ignore[assignment]

    @property
    def parameters(self) -> tuple[Scheduling, ...]:
        """The scheduling parameters."""
        return self.problem.lft.parameters

    @property
    def model(self) -> LFT:
        """The LFT."""
        return self.problem.lft

    def method(self, ladder: Ladder | None) -> str:
        """Name of the class of multipliers."""
        return f"LFT test with {self.problem.scaling}, p arbitrarily fast"

    def how(self, best: Found, status: Status, ladder: Ladder | None) -> tuple[str, ...]:
        """Hypotheses of the proof, as sentences."""
        own = ("a limit on the rate is not used", f"constant P; {_CLASS[self.problem.scaling]}")
        what, shared = "finitely many matrices", "only the matrices of the LFT"
        verified = () if best.proof is None else (VERIFIED.format(what=what, shared=shared),)
        return (*own, *verified)

    def distance(
        self, bounds: dict[str, float], best: Found, ladder: Ladder | None
    ) -> tuple[str, ...]:
        """No sentences: the causes of a gap are not analysed for an LFT."""
        return ()


_CLASS = {
    "small gain": (
        "the parameters together as one full block of norm one, complex and dynamic ones included,"
        " in the LFT's own coordinates"
    ),
    "D": (
        "scalings D that commute with the parameters: these may be complex, or operators of"
        " norm one"
    ),
    "DG": "scalings D and G: the parameters are real and may jump",
    "full block": (
        "a full block multiplier, concave in each parameter, positive at the corners of the box"
    ),
}
