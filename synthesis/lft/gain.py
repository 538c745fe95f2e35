"""Certified L2 gain and stability of an LFT whose parameters are as fast as they like."""

from __future__ import annotations

import math
import time

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT
from synthesis.analysis.hypotheses import VERIFIED, hypotheses
from synthesis.analysis.ladder import NOTHING, inflated
from synthesis.certificate import Attempt, Certificate, Kind, Proof, Seconds, Status
from synthesis.lft.coordinates import coordinates, scaled
from synthesis.lft.multipliers import Class, Multiplier, check_scaling, multiplier_class
from synthesis.lft.program import (
    gain_program,
    inequality,
    margin_program,
    unpack,
    with_state_channels,
)
from synthesis.lft.proof import Evidence, Quadratic
from synthesis.program.cone_program import (
    Answer,
    Candidate,
    ConeProgram,
    Solver,
    general_solver,
    solve,
)
from synthesis.program.scaling import in_its_own_scale
from synthesis.worst.budget import said
from synthesis.worst.lft import BoxGain, box_growing_trajectory, box_lower_bound, frozen_box_gain
from synthesis.worst.lower_bound import THOROUGH, LowerBound, Search
from synthesis.worst.spectrum import surely_unstable
from synthesis.worst.trajectory import SchedulingTrajectory

Array = np.ndarray

MARGINS = (1e-7, 1e-6, 1e-5, 1e-3)
"""The (x, w) block is held below -margin I in scaled coordinates, tried in turn until the answer is
verified.
"""


def lft_gain(
    lft: LFT,
    scaling: str = "DG",
    *,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
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
    search : Search or None
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

    References
    ----------
    Fan, Tits and Doyle, IEEE Trans. Automatic Control 36 (1991), D and G scalings; Scherer, "LPV
    control and full block multipliers", Automatica 37 (2001), full blocks.

    Examples
    --------
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = lft_gain(lag.to_lft().reduce(), search=None)
    >>> print(f"{cert.gamma:.3f}")
    1.000
    """
    solver = _checked(lft, scaling, solver)
    if not (lft.inputs and lft.outputs):
        raise InputError(
            f"a gain needs inputs and outputs, got {len(lft.inputs)} and {len(lft.outputs)}; see"
            " lft_stability"
        )
    start = time.perf_counter()
    frozen = frozen_box_gain(lft)
    if math.isinf(frozen.gain):
        if surely_unstable(lft.at(*frozen.p).A, lft.dt):
            return _certificate(
                lft,
                scaling,
                solver,
                None,
                LowerBound(math.inf, _at_rest(frozen)),
                math.inf,
                time.perf_counter() - start,
            )
        # stable or not to rounding: nothing is known from below
        frozen, search = BoxGain(0.0, frozen.p, math.nan), None
    below = box_lower_bound(lft, frozen, search)
    bounds = time.perf_counter() - start

    def found(expected: float) -> tuple[_Attempt, float, float]:
        attempt = _Attempt(lft, scaling, solver, expected).run()
        return attempt, attempt.gamma, attempt.evidence.coordinates.units.channel

    tries = in_its_own_scale(found, frozen.gain)
    best = min(tries, key=lambda attempt: attempt.gamma)
    for other in tries:
        if other is not best:
            best.add(other)
    return _certificate(lft, scaling, solver, best, below, frozen.gain, bounds).resting_on(
        said(search and search.seconds, bounds)
    )


def lft_stability(
    lft: LFT,
    scaling: str = "DG",
    *,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
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
    search : Search or None
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
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> lft_stability(lag.to_lft().reduce()).verified
    True
    """
    solver = _checked(lft, scaling, solver)
    frozen = frozen_box_gain(lft.select(inputs=(), outputs=()))
    if math.isinf(frozen.gain) and surely_unstable(lft.at(*frozen.p).A, lft.dt):
        return _certificate(
            lft, scaling, solver, None, LowerBound(math.nan, _at_rest(frozen)), math.nan, 0.0
        )
    found = _Attempt(lft.select(inputs=(), outputs=()), scaling, solver, 1.0).run()
    start = time.perf_counter()
    worst = None if found.proof is not None else box_growing_trajectory(lft, search)
    return _certificate(
        lft,
        scaling,
        solver,
        found,
        LowerBound(math.nan, worst),
        math.nan,
        time.perf_counter() - start,
    )


class _Attempt:
    """The cone programs of one LFT and one class of multipliers; what was found and what was
    tried.
    """

    def __init__(self, lft: LFT, scaling: str, solver: Solver, gain: float):
        self.begin = time.perf_counter()
        self.lft, self.scaling, self.solver = lft, scaling, solver
        self.sizes = lft.sizes
        # a small gain means one thing only in the coordinates the LFT has, up to a number
        self.evidence = Evidence(lft, coordinates(lft, gain, one=scaling == "small gain"))
        self.multipliers: Class = multiplier_class(scaling, self.sizes)
        loop = scaled(lft, self.evidence.coordinates)
        if not lft.inputs:
            loop = with_state_channels(loop)
        self.inputs = loop.Bu.shape[1]
        self.linear = inequality(loop, self.multipliers, lft.dt is None).congruent(
            self.evidence.coordinates.units.weight
        )
        self.proof: Proof | None = None
        self.gamma, self.conditioning, self.answer = math.inf, math.inf, Answer.FAILED
        self.attempts: list[Attempt] = []
        self.solving = self.verifying = 0.0

    @property
    def seconds(self) -> tuple[float, float, float]:
        """Build, solve and verify, s."""
        return self.ended - self.begin - self.solving - self.verifying, self.solving, self.verifying

    def run(self) -> _Attempt:
        """Minimise the gain; where no answer can be verified, ask for the largest margin of
        stability.
        """
        x = len(self.lft.states)
        for margin in MARGINS:
            candidate = self._solve(
                gain_program(self.linear, self.multipliers, x, self.inputs, margin)
            )
            self._judge("gain", margin, candidate, (1.0,))
            self.answer = candidate.answer
            if self.proof is not None or candidate.answer in (Answer.INFEASIBLE, Answer.UNTRIED):
                break
        if self.proof is None:
            candidate = self._solve(margin_program(self.linear, self.multipliers, x, self.inputs))
            margin = math.nan if candidate.x is None else float(candidate.x[-1])
            self._judge("margin", margin, candidate, 10.0 ** np.arange(-2, 10))
            if candidate.answer is Answer.SOLVED:
                self.answer = Answer.INFEASIBLE if margin <= NOTHING else Answer.FAILED
        self.ended = time.perf_counter()
        return self

    def add(self, other: _Attempt) -> None:
        """The programs and the time of another attempt at the same gain."""
        self.attempts = other.attempts + self.attempts
        self.solving, self.verifying = (
            self.solving + other.solving,
            self.verifying + other.verifying,
        )
        self.begin -= other.ended - other.begin

    def _solve(self, program: ConeProgram) -> Candidate:
        candidate = solve(program, self.solver)
        self.solving += candidate.seconds
        return candidate

    def _judge(
        self, program: str, margin: float, candidate: Candidate, weights: Array | tuple[float, ...]
    ) -> None:
        """Keep the best multiple of the candidate that can be verified, whatever the solver said of
        it.
        """
        start = time.perf_counter()
        best = math.inf
        for weight in weights if candidate.x is not None else ():
            proof = self._physical(float(weight) * np.asarray(candidate.x))
            least, conditioning = self.evidence.least_gain(proof)
            gamma = inflated(least, self.evidence.coordinates.units.channel)
            if gamma >= best or not self.evidence.floating(proof, gamma):
                continue
            self.proof = Proof(self.evidence, proof)
            self.gamma, self.conditioning, best = gamma, conditioning, gamma
            if math.isnan(gamma):  # stability alone: one multiple is as good as another
                break
        self.verifying += time.perf_counter() - start
        words = f"{candidate.message}, {'not verified' if self.proof is None else 'verified'}"
        self.attempts.append(Attempt(program, margin, words, best))

    def _physical(self, x: Array) -> Quadratic:
        P, Q, S, R = unpack(x, self.multipliers, len(self.lft.states))
        units, left, _ = self.evidence.coordinates
        multiplier = Multiplier(self.scaling, self.sizes, Q, S, R)
        return Quadratic(units.to_physical(P), multiplier.transformed(left, units.channel**2))


def _checked(lft: LFT, scaling: str, solver: Solver | str) -> Solver:
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
    return general_solver(solver)


def _at_rest(frozen: BoxGain) -> SchedulingTrajectory:
    p = np.array([frozen.p])
    return SchedulingTrajectory(np.zeros(1), p[:, 0] if p.shape[1] == 1 else p)


def _certificate(
    lft: LFT,
    scaling: str,
    solver: Solver,
    found: _Attempt | None,
    below: LowerBound,
    frozen: float,
    bounds: float,
) -> Certificate:
    """The certificate of what was `found`; None: a frozen model is unstable and nothing was
    tried.
    """
    kind: Kind = "stability" if math.isnan(below.gain) else "l2 gain"
    proof = found.proof if found else None
    growing = math.isinf(below.gain) if kind == "l2 gain" else below.trajectory is not None
    if proof is not None:
        status = Status.PROVEN
    elif found is None:
        status = Status.UNSTABLE
    elif growing:
        status = Status.GROWING
    else:
        status = Status.without_proof(found.answer)
    rates = (math.inf,) * len(lft.parameters)
    how = ["a limit on the rate is not used", f"constant P; {_CLASS[scaling]}"]
    if proof is not None:
        how.append(
            VERIFIED.format(what="finitely many matrices", shared="only the matrices of the LFT")
        )
    return Certificate(
        kind=kind,
        gamma=math.nan if kind == "stability" else found.gamma if found else math.inf,
        lower=below.gain,
        frozen=frozen,
        status=status,
        verified=proof is not None,
        rates=rates,
        hypotheses=hypotheses(kind, lft.parameters, rates, lft, how),
        method=f"LFT test with {scaling}, p arbitrarily fast",
        solver=str(solver),
        seconds=Seconds(*(found.seconds if found else (0.0, 0.0, 0.0)), bounds),
        conditioning=found.conditioning if found else math.inf,
        attempts=tuple(found.attempts) if found else (),
        worst=below.trajectory,
        proof=proof,
    )


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
