"""The L2 gain with P in functions of one's own, on a grid: what LPVTools' `lpvnorm(P, Xb)` does."""

from __future__ import annotations

import math
import time

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT, FunctionSpace, LPVStateSpace
from synthesis.analysis.hypotheses import hypotheses
from synthesis.analysis.problem import Model
from synthesis.certificate import Attempt, Certificate, Seconds, Status
from synthesis.impose import Grid, Imposed
from synthesis.lpv.bases import functions, limited
from synthesis.lpv.existence import FINE_TOLERANCE, Existence
from synthesis.lpv.scaled_plant import ScaledPlant
from synthesis.plant.generalized import Generalized
from synthesis.program.cone_program import LYAPUNOV, Solver
from synthesis.worst.frozen import norm
from synthesis.worst.rates import Rate, limits

Array = np.ndarray


def gain_on_grid(
    model: Model, rate: Rate, form: FunctionSpace, impose: Imposed | None
) -> Certificate:
    """Return the least gain for which P in these functions meets the inequalities of the bounded
    real lemma at the points of a grid, as `indicative` of a certificate that proves nothing.

    Raises `InputError` without a `Grid`, for a sampled model whose p moves, and for functions of a
    parameter that may jump.
    """
    if not isinstance(impose, Grid):
        raise InputError(
            "P in functions of one's own is imposed on a grid, and proves nothing: impose=Grid(n);"
            " for a proof take form=Spline(...)"
        )
    if not isinstance(model, LPVStateSpace | LFT):
        raise InputError(f"expected an LPVStateSpace or an LFT, got {type(model).__name__}")
    moving = limits(model.parameters, rate)
    basis = limited(functions(form, moving, "form"), moving, "form")
    if model.dt is not None and any(s.rate != 0 for s in moving):
        raise InputError("P in one's own functions is for continuous time: take form=Spline(...)")
    start = time.perf_counter()
    points = Existence(_plant(model, moving, basis, 1.0), basis, None, impose).points
    frozen_at = zip(*_matrices(model, points), strict=True)
    gains = [norm(A, B, C, D, model.dt)[0] for A, B, C, D in frozen_at]
    frozen, found, attempts = max(gains), math.inf, ()
    if math.isfinite(frozen):
        channel = frozen or 1.0
        existence = Existence(_plant(model, moving, basis, channel), basis, None, impose)
        answer = existence.least_gamma(Solver(LYAPUNOV, tolerance=FINE_TOLERANCE))
        found = channel * answer.gamma
        attempts = (Attempt(f"P in {basis.size} functions", 0.0, answer.message, found),)
    known = Status.UNPROVEN if math.isfinite(found) else Status.INFEASIBLE
    status = known if math.isfinite(frozen) else Status.UNSTABLE
    rates = tuple(math.nan if isinstance(s.rate, str) else s.rate for s in moving)
    hypothesis = f"the inequalities hold at {impose.points} values of each parameter: no guarantee"
    return Certificate(
        kind="l2 gain",
        gamma=math.inf,
        lower=frozen,
        frozen=frozen,
        status=status,
        verified=False,
        rates=rates,
        hypotheses=hypotheses("l2 gain", moving, rates, model, (hypothesis,)),
        method=f"{type(form).__name__}, {impose.found_by}",
        solver=LYAPUNOV,
        seconds=Seconds(solve=time.perf_counter() - start),
        attempts=attempts,
        indicative=found if status is Status.UNPROVEN else math.nan,
    )


def _matrices(model: LPVStateSpace | LFT, p: Array) -> tuple[Array, ...]:
    return tuple(model.matrices(p[:, 0] if len(model.parameters) == 1 else p))


def _plant(
    model: LPVStateSpace | LFT, moving: tuple, basis: FunctionSpace, channel: float
) -> ScaledPlant:
    """The model as a plant that nothing controls and nothing measures."""

    def matrices(p: Array) -> Generalized:
        A, B, C, D = _matrices(model, p)
        (K, n, nw), nz = B.shape, C.shape[1]
        empty = (np.zeros((K, *shape)) for shape in ((n, 0), (0, n), (nz, 0), (0, nw), (0, 0)))
        B2, C2, D12, D21, D22 = empty
        return Generalized(A, B, B2, C, C2, D, D12, D21, D22)

    return ScaledPlant.of(matrices, moving, basis, model.dt, channel)
