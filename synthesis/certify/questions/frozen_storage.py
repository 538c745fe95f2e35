"""P(p) linear between storage functions of the frozen models, for a parameter that rests or moves
slowly: no program over the whole range is solved, so that many states and many knots cost little.

Each is the analytic centre of all storage functions of its frozen model at one level of the gain.
The centre changes smoothly with p and is as far inside as the level allows, so that P holds between
knots that are near enough. Knots are added where it does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy import linalg

from symheli.lpv.tools import Matrices
from symheli.progress import task
from symheli.values.arrays import Array
from synthesis.certify.assemble.unknowns import ScaledProblem
from synthesis.certify.proof.inequalities import Statement, lmi_polynomials
from synthesis.certify.statement.scaling import of_model
from synthesis.certify.statement.spline import SplineLyapunov
from synthesis.numerics.polynomial.pieces import joined
from synthesis.numerics.polynomial.symmetric import basis, smat, svec
from synthesis.numerics.program.storage import strict_storage

LEVELS = (1.02, 1.05)
"""Multiples of the worst frozen gain at which the storage functions are computed, in turn until the
gain is proven: the closer to it, the more knots are needed.
"""
MIN_SEGMENTS, MAX_SEGMENTS = 8, 1024
"""Least number of segments to begin with, and largest number."""
MAX_STATES = 40
"""Number of states up to which the centres take less time than a program over the range."""
MIN_FRACTION = 1e-4
"""Least width of a segment, as a fraction of the range."""
MAX_SIZE = 10.0
"""P is kept below this multiple of the largest of the first storage functions: states that no input
reaches have no largest storage function.
"""
NEWTON_STEPS = 100
"""Largest number of Newton steps to a centre; without a start nearby some thirty are usual."""
MIN_STEP = 1e-3
"""Least share of a Newton step: below it, rounding limits the search."""
CENTRED = 1e-4
"""Newton decrement, squared, at which a point counts as the centre; any point inside serves."""


def of_frozen_models(problem: ScaledProblem, level: float) -> SplineLyapunov | None:
    """Return P, in the scaled units, of storage functions at this level of the gain in the unit of
    the channel; None where a frozen model has none, p moves too fast, or states or knots are too
    many.
    """
    if len(problem.lpv.states) > MAX_STATES:
        return None
    ends = [problem.pieces[0].low, *(piece.high for piece in problem.pieces)]
    parts = -(-MIN_SEGMENTS // (len(ends) - 1))
    knots = np.interp(
        np.arange(parts * (len(ends) - 1) + 1) / parts, np.arange(len(ends)), np.array(ends)
    )
    with task("storage functions of the frozen models") as progress:
        first = []
        for p in knots:
            P = _any(_frozen(problem, p), level, problem.discrete)
            if P is None:
                return None
            first.append(P)
        bound = MAX_SIZE * max(float(linalg.eigvalsh(P)[-1]) for P in first)
        if _too_fast(problem, level, bound, knots, first):
            return None
        found: dict[float, Array] = {}
        starts: dict[float, list[Array]] = {
            float(p): [P] for p, P in zip(knots, first, strict=True)
        }
        for round_ in range(math.ceil(-math.log2(MIN_FRACTION))):
            for p, own in starts.items():
                centre = _central(problem, p, level, bound, own)
                if centre is None:
                    return None
                found[p] = centre
                progress.step(f"{len(found)} values of p")
            knots = np.array(sorted(found))
            P = SplineLyapunov(knots, 1, np.array([found[p] for p in knots.tolist()]))
            at_knots, between = _violated(problem, P, level)
            if not between:
                return P
            # the value at a knot holds for a p at rest, whatever lies between
            if (at_knots and round_ > 0) or len(knots) + len(between) > MAX_SEGMENTS:
                return None
            starts = {
                0.5 * float(knots[j] + knots[j + 1]): [P.at(0.5 * (knots[j] + knots[j + 1])), *ends]
                for j in between
                for ends in [P.coefficients[j : j + 2]]
            }
    return None


def _too_fast(
    problem: ScaledProblem, level: float, bound: float, knots: Array, starts: list[Array]
) -> bool:
    """Whether p moves too fast between two knots in the middle: a look before the whole range."""
    if problem.rate == 0:
        return False
    k = len(knots) // 2 - 1
    ends = [_central(problem, float(knots[j]), level, bound, [starts[j]]) for j in (k, k + 1)]
    if ends[0] is None or ends[1] is None:
        return True
    fastest = problem.step if problem.discrete else problem.scaled_rate
    drift = fastest * (ends[1] - ends[0]) / (knots[k + 1] - knots[k])
    for p, P in zip(knots[k : k + 2], (ends[0], ends[1]), strict=True):
        model = _frozen(problem, float(p))
        moving = (_dissipation(model, P, level, problem.discrete, nu) for nu in (-drift, drift))
        if not all(map(_definite, moving)):
            return True
    return False


def _frozen(problem: ScaledProblem, p: float) -> Matrices:
    return of_model(problem.units, problem.lpv.at(min(p, problem.lpv.scheduling.high)))


def _any(model: Matrices, level: float, discrete: bool = False) -> Array | None:
    """Return a storage function of a frozen model, None where rounding leaves none."""
    storage = strict_storage(*model, level, discrete=discrete)
    if storage is None:
        return None
    back = linalg.inv(storage.T)
    return back.T @ back


def central_dissipation(model: Matrices, level: float) -> Array:
    """Return what the analytic centre of the storage functions of a frozen model dissipates, a
    quadratic form (n + m, n + m) of state and input; zero where rounding leaves none.
    """
    n, m = model.B.shape
    P = _any(model, level)
    if P is not None:
        P = analytic_centre(model, level, MAX_SIZE * float(linalg.eigvalsh(P)[-1]), P)
    return np.zeros((n + m, n + m)) if P is None else _dissipation(model, P, level)


def _dissipation(
    model: Matrices, P: Array, level: float, discrete: bool = False, drift: Array | None = None
) -> Array:
    """Return the quadratic form of state and input that is dissipated while P changes by `drift`
    per unit of time or sample.
    """
    out = np.hstack([model.C, model.D])
    n, m = model.B.shape
    supply = np.diag(np.r_[np.zeros(n), np.full(m, level**2)]) - out.T @ out
    return supply - _change(model, P, discrete, drift)


def _change(model: Matrices, P: Array, discrete: bool, drift: Array | None = None) -> Array:
    """Return the change of V = x'Px per unit of time or sample as a quadratic form of state and
    input, for one P or several (..., n, n) which change by `drift`.
    """
    n, m = model.B.shape
    drift = np.zeros((n, n)) if drift is None else drift
    now, into = np.eye(n, n + m), np.hstack([model.A, model.B])
    if discrete:
        return into.T @ (P + drift) @ into - now.T @ P @ now
    half = now.T @ P @ into
    return half + np.swapaxes(half, -1, -2) + now.T @ drift @ now


def _central(
    problem: ScaledProblem, p: float, level: float, bound: float, starts: Iterable[Array]
) -> Array | None:
    """Return the centre at p from the first of the `starts` that is a storage function here."""
    model = _frozen(problem, p)
    for start in starts:
        P = analytic_centre(model, level, bound, start, problem.discrete)
        if P is not None:
            return P
    start = _any(model, level, problem.discrete)
    return None if start is None else analytic_centre(model, level, bound, start, problem.discrete)


def analytic_centre(
    model: Matrices, level: float, bound: float, start: Array, discrete: bool = False
) -> Array | None:
    """Return the analytic centre of the P > 0 below `bound` that satisfy the bounded real lemma at
    this level; None where `start` is not inside.

    It maximises the sum of log det of the three matrices by Newton's method with a line search
    (Boyd and Vandenberghe, "Convex Optimization", 2004, section 9.6).
    """
    n = len(model.A)
    E = basis(n)
    supply = _dissipation(model, np.zeros((n, n)), level)
    terms = (
        (supply, -_change(model, E, discrete)),
        (np.zeros((n, n)), E),
        (bound * np.eye(n), -E),
    )

    def roots(x: Array) -> list[Array] | None:
        try:
            return [np.linalg.cholesky(M + np.tensordot(x, own, axes=1)) for M, own in terms]
        except np.linalg.LinAlgError:
            return None

    def barrier(factors: list[Array] | None) -> float:
        if factors is None:
            return math.inf
        return -2.0 * sum(float(np.log(np.diag(root)).sum()) for root in factors)

    x = svec(start)
    factors = roots(x)
    if factors is None:
        return None
    for _ in range(NEWTON_STEPS):
        gradient, hessian = np.zeros(len(x)), np.zeros((len(x), len(x)))
        for root, (_, linear) in zip(factors, terms, strict=True):
            back = np.linalg.inv(root)
            whitened = back @ linear @ back.T
            gradient -= np.trace(whitened, axis1=1, axis2=2)
            flat = whitened.reshape(len(x), -1)
            hessian += flat @ flat.T
        try:
            step = -np.linalg.solve(hessian, gradient)
        except np.linalg.LinAlgError:
            break
        decrement, value, share = float(-gradient @ step), barrier(factors), 1.0
        if not decrement > CENTRED:
            break
        while share > MIN_STEP:
            tried = roots(x + share * step)
            if barrier(tried) <= value - 0.1 * share * decrement:
                break
            share *= 0.5
        else:
            break
        assert tried is not None  # noqa: S101 - its barrier is finite
        x, factors = x + share * step, tried
    return smat(x, n)


def _violated(problem: ScaledProblem, P: SplineLyapunov, level: float) -> tuple[bool, list[int]]:
    """Return whether an inequality is violated at a knot, and the segments on which one is."""
    model = joined(problem.lpv, problem.units.of_pieces(problem.pieces, problem.block))
    statement = Statement(model, P, problem.scaled_rate)
    n, at_knots, segments = P.coefficients.shape[-1], False, set()
    for form in lmi_polynomials(statement, float):
        F = form.block.coefficients.copy()
        F[..., range(n, F.shape[-1]), range(n, F.shape[-1])] -= level**2
        if not _definite(-F):
            low, high = form.block.box[0]
            segments.add(int(np.searchsorted(P.knots, 0.5 * (low + high))) - 1)
            at = [F[end] for p, end in ((low, 0), (high, -1)) if p in P.knots]
            at_knots |= not all(_definite(-corner) for corner in at)
    return at_knots, sorted(segments)


def _definite(M: Array) -> bool:
    try:
        np.linalg.cholesky(M)
    except np.linalg.LinAlgError:
        return False
    return True
