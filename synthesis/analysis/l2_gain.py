"""Certified L2 gain and stability of an LPV model whose parameter moves at a bounded rate."""

from __future__ import annotations

import math
import time
from typing import overload

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT, LPVStateSpace
from synthesis.analysis.box import Model, box_certificate
from synthesis.analysis.fine_sampling import fine_sampling
from synthesis.analysis.hypotheses import VERIFIED, fitted
from synthesis.analysis.one_parameter import Result, prove, prove_gain
from synthesis.certificate import Certificate
from synthesis.forms import Problem, Relaxation, scaled_problem
from synthesis.lyapunov.spline import Lyapunov
from synthesis.polynomial.certificate import BoxCertificate
from synthesis.program.cone_program import Answer, Solver
from synthesis.verdict import Seconds, Status
from synthesis.worst.budget import said
from synthesis.worst.frozen import FrozenGain, frozen_gain, least_damped
from synthesis.worst.lower_bound import THOROUGH, Search, growing_trajectory, lower_bound
from synthesis.worst.rates import Rate, rates
from synthesis.worst.spectrum import surely_unstable
from synthesis.worst.trajectory import Trajectory

Array = np.ndarray


@overload
def l2_gain(
    lpv: LPVStateSpace,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> Certificate: ...
@overload
def l2_gain(
    lpv: LPVStateSpace | LFT,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> BoxCertificate: ...
def l2_gain(
    lpv: Model,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> Certificate | BoxCertificate:
    """Certified upper bound of the L2 gain of `lpv` over every p(t) in range with |dp/dt| <=
    `rate`.

    `rate` in units of p per second; default the model's own; math.inf: constant P, p may jump; 0:
    every frozen model. Bounded real lemma with P(p) a spline (see `bounded_real`), one LMI per
    Bernstein coefficient, so that it holds between grid points; the gain is recomputed from P alone
    and verified. `search` looks for the worst trajectory (None: the frozen gain is the lower
    bound). Raises `InputError`, `SolverError`; a failed solve is a certificate with gamma = inf and
    its reason in `status`.

    A model in several parameters (LFTs too; `rate` one for all, one each or by
    name), or a relaxation other than plain Bernstein coefficients, gives a `BoxCertificate`, which
    answers the same questions.
    """
    relaxation, solver = relaxation or Relaxation(), _solver(solver)
    if not isinstance(lpv, LPVStateSpace) or len(lpv.parameters) > 1 or relaxation.needs_box:
        return box_certificate(lpv, rate, "l2 gain", relaxation, solver, search)
    rate = _check(lpv, rate, relaxation, with_gain=True)
    start = time.perf_counter()
    frozen = frozen_gain(lpv)
    if math.isinf(frozen.gamma):
        p = _surely_unstable(lpv, frozen.p)
        if p is not None:
            at_rest = Trajectory(np.zeros(1), np.array([p]))
            return _certificate(
                lpv,
                rate,
                solver,
                None,
                math.inf,
                math.inf,
                Status.UNSTABLE,
                at_rest,
                time.perf_counter() - start,
            )
        # stable or not to rounding: nothing is known from below
        frozen, search = FrozenGain(0.0, frozen.p, math.nan), None
    below = lower_bound(lpv, rate, frozen=frozen, search=search)
    bounds = time.perf_counter() - start
    if math.isinf(below.gamma):
        return _certificate(
            lpv,
            rate,
            solver,
            None,
            math.inf,
            frozen.gamma,
            Status.GROWING,
            below.trajectory,
            bounds,
        )
    problem, best = prove_gain(lpv, rate, frozen.gamma, relaxation, solver)
    cert = _certificate(
        lpv,
        rate,
        solver,
        (problem, best),
        below.gamma,
        frozen.gamma,
        None,
        below.trajectory,
        bounds,
        relaxation.elevation,
    )
    return cert.resting_on(said(search and search.seconds, bounds))


@overload
def stability(
    lpv: LPVStateSpace,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> Certificate: ...
@overload
def stability(
    lpv: LPVStateSpace | LFT,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> BoxCertificate: ...
def stability(
    lpv: Model,
    rate: Rate = None,
    *,
    relaxation: Relaxation | None = None,
    solver: Solver | str = "CLARABEL",
    search: Search | None = THOROUGH,
) -> Certificate | BoxCertificate:
    """Proof that dx/dt = A(p) x (or x(k+1) = A(p) x) decays for every p(t) in range with |dp/dt| <=
    `rate`.

    As `l2_gain`, without channels: `.verified` is the answer, `.gamma`, `.lower` and `.frozen` are
    NaN. Where no proof is found, `search` looks for a trajectory along which the state grows.
    """
    relaxation, solver = relaxation or Relaxation(), _solver(solver)
    if not isinstance(lpv, LPVStateSpace) or len(lpv.parameters) > 1 or relaxation.needs_box:
        return box_certificate(lpv, rate, "stability", relaxation, solver, search)
    rate = _check(lpv, rate, relaxation, with_gain=False)
    margin, p = least_damped(lpv)
    if margin <= 0 and (unstable := _surely_unstable(lpv, p)) is not None:
        at_rest = Trajectory(np.zeros(1), np.array([unstable]))
        return _certificate(
            lpv, rate, solver, None, math.nan, math.nan, Status.UNSTABLE, at_rest, 0.0
        )
    problem = scaled_problem(lpv, rate, 1.0, with_gain=False)
    best = prove(problem, relaxation, solver, math.inf)
    start = time.perf_counter()
    worst = None if best.lyapunov is not None else growing_trajectory(lpv, rate, search)
    status = Status.GROWING if worst is not None else None
    bounds = time.perf_counter() - start
    return _certificate(
        lpv,
        rate,
        solver,
        (problem, best),
        math.nan,
        math.nan,
        status,
        worst,
        bounds,
        relaxation.elevation,
    )


def _surely_unstable(lpv: LPVStateSpace, p: float) -> float | None:
    """A p, the suspect one first, at which the frozen model is unstable beyond rounding; None where
    there is none.
    """
    s = lpv.scheduling
    every = np.append(p, np.linspace(s.low, s.high, 201))
    return next(
        (
            float(q)
            for q, A in zip(every, lpv.matrices(every).A, strict=True)
            if surely_unstable(A, lpv.dt)
        ),
        None,
    )


def _check(lpv: LPVStateSpace, rate: Rate, relaxation: Relaxation, *, with_gain: bool) -> float:
    relaxation.check(lpv.dt, with_gain=with_gain)
    (limit,) = rates((lpv.scheduling,), rate)
    if not lpv.states:
        raise InputError("the model has no states; its gain is the largest norm of D(p)")
    if with_gain and not (lpv.inputs and lpv.outputs):
        raise InputError(
            f"a gain needs inputs and outputs, got {len(lpv.inputs)} and {len(lpv.outputs)}; use"
            " stability() without channels"
        )
    return limit


def _solver(solver: Solver | str) -> Solver:
    return solver if isinstance(solver, Solver) else Solver(solver)


def _certificate(
    lpv: LPVStateSpace,
    rate: float,
    solver: Solver,
    found: tuple[Problem, Result] | None,
    lower: float,
    frozen: float,
    status: Status | None,
    worst: Trajectory | None,
    bounds: float,
    elevation: int = 0,
) -> Certificate:
    """The certificate of what was `found` (None: nothing was tried); `status` None where the search
    for P decides.
    """
    kind = "stability" if math.isnan(lower) else "l2 gain"
    best = found[1] if found else Result(math.inf, None, math.inf, Answer.UNTRIED, Seconds(), ())
    if status is None:
        status = Status.PROVEN if best.lyapunov else Status.without_proof(best.answer)
    gamma = math.nan if kind == "stability" else best.gamma
    evidence = found[0].evidence(elevation) if found else None
    return Certificate(
        kind=kind,
        gamma=gamma,
        lower=lower,
        frozen=frozen,
        status=status,
        verified=best.lyapunov is not None,
        rates=(rate,),
        hypotheses=_hypotheses(lpv, rate, best.lyapunov, kind)
        + fine_sampling(_frozen(lpv), lpv.dt, gamma, lower),
        solver=str(solver),
        seconds=best.seconds._replace(bounds=bounds),
        conditioning=best.conditioning,
        attempts=best.attempts,
        worst=worst,
        lyapunov=best.lyapunov,
        unit=lpv.scheduling.unit,
        evidence=evidence,
    )


def _frozen(lpv: LPVStateSpace) -> Array:
    return lpv.matrices(np.linspace(lpv.scheduling.low, lpv.scheduling.high, 41)).A


def _hypotheses(lpv: LPVStateSpace, rate: float, P: Lyapunov | None, kind: str) -> tuple[str, ...]:
    s = lpv.scheduling
    unit = "" if s.unit == "1" else f" {s.unit}"
    speed = (
        "arbitrarily fast"
        if math.isinf(rate)
        else "constant"
        if rate == 0
        else f"|d{s.name}/dt| <= {rate:g}{unit} per second"
    )
    out = [f"{s.name} is exogenous, in [{s.low:g}, {s.high:g}]{unit}, {speed}"]
    out += fitted(lpv)
    if lpv.trim is not None:
        out.append(
            "the drift of a moving trim, -x0'(p) dp/dt, is left out: it acts as a further"
            " disturbance"
        )
    if P is not None:
        out.append(
            f"{P.form}; one LMI per Bernstein coefficient, for every p in the interval and every"
            " admissible rate"
        )
        out.append(
            VERIFIED.format(
                what="every coefficient, and a grid of p",
                shared="pieces, cells, strips and blossoms",
            )
        )
    if kind == "l2 gain":
        out.append(
            "the gain is from zero initial state, |y|_2 < gamma |u|_2, all inputs to all outputs"
            " together"
        )
    return tuple(out)
