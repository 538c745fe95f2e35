"""Output feedback of the least variance over p: state feedback on a filter, an inequality each.

Let P(p) = Y^-1 satisfy the Riccati inequality of control with dP/dt, S(p) = X^-1 that of the
filter with -dS/dt, and let F and L be their gains. Then u = F x^ with

    dx^/dt = A x^ + B2 u + L (C2 x^ + D22 u - y)

knows p alone, and along every admissible p(t) white noise of unit intensity gives the performance a
mean power of at most

    max over p of  tr B1'P B1 + tr R F S F',  R = D12'D12,

by completing the square in x'P x, whose control error is F times the error of the estimate, of
covariance at most S. Each is a convex program: first Y, then, for its F, X. Of a frozen model the
sum is tr L V L'P + tr C1 S C1', V = D21 D21', too: Y is found for the least of the first term, with
the frozen filters, since every Y may serve, and this the best.

Reference: Wu, "Control of Linear Parameter Varying Systems", Ph.D. thesis, Berkeley (1995), the
stochastic LPV bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np

from symheli.lpv.bases import FunctionSpace
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.lower_bounds.box import of_gramian
from synthesis.certify.statement.kind import H2_GAIN
from synthesis.certify.statement.outcome import Attempt
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.elimination import Half, controlled, observed
from synthesis.design.lpv.existence import MATRIX_BOUNDS, Existence, Solution
from synthesis.design.lpv.fitted import Fitted, fits, in_plant_units
from synthesis.design.lpv.frozen_stability import frozen_stability
from synthesis.design.lpv.recovery import Gains
from synthesis.design.lpv.scaled_plant import ScaledPlant, depends, scaled_plant_of
from synthesis.design.lpv.search import (
    ACCURACY,
    CLOSE_TO_OPTIMUM,
    LEVEL_TOLERANCE,
    MIN_IMPROVEMENT,
    check_points,
    closed,
)
from synthesis.design.lti.linear_quadratic import control_gains, given_direct_way
from synthesis.design.plant.diagnosis import unpriced
from synthesis.design.plant.generalized import Generalized
from synthesis.design.plant.plant import Plant
from synthesis.design.plant.refusals import conditions, failed
from synthesis.numerics.program.bases import DEGREES, Bases, Dependence, dependence
from synthesis.numerics.program.cone_program import LYAPUNOV, Solver
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks
from synthesis.numerics.program.unknown import BlockTerms, UnknownFunction, selector

Cost = Callable[[Array], tuple[Array, Array]]
"""Columns (K, n, k) whose variances by the inverse of the unknown are summed, and a known part (K,)
of the sum, at p (K, m).
"""

USUAL = Solver(LYAPUNOV, tolerance=1e-7, iterations=100)
CONTROL_SHARE = 0.1
"""Share of the back-off that is the control's: it counts in both terms of the sum."""
PARTS = {1: 4}
"""In how many parts the range of one parameter is cut where points are laid (more: 1)."""


class Variance(Existence):
    """The program of one of the two inequalities: minimise g >= the known part + tr B' Z^-1 B at
    every p, Z = Y of the control, or X of the filter.
    """

    def __init__(
        self, plant: ScaledPlant, basis: FunctionSpace, control: bool, cost: Cost, p: Array
    ):
        bases = (None, basis) if control else (basis, None)
        super().__init__(plant, *bases, PARTS.get(len(p), 1), MATRIX_BOUNDS[0], p)
        # X or Y is large where nothing drives or shows a state: no violation can be told from
        # rounding there
        self.fixed, self.control, self.cost = True, control, cost

    @property
    def unknown(self) -> UnknownFunction:
        """Y, or X."""
        found = self.Y if self.control else self.X
        assert found is not None  # noqa: S101 - it is the one that was asked for
        return found

    def _halves_at(self, p: Array, gamma: float | None, margin: float) -> list[LyapunovBlocks]:
        half, sign = _half(self.plant.at(p), self.control), -1.0 if self.control else 1.0
        blocks = self._half(p, half, self.unknown, self.unknown, sign, None, margin)
        columns, known = self.cost(p)
        K, n, k = columns.shape
        size = 1 + n * k
        variance, values = BlockTerms(size, K), self.unknown.values(p)
        for j in range(k):
            own = selector(n, 1 + n * j, size)
            variance.add(self.unknown, values, own, -0.5 * own)
        constant, level = np.zeros((K, size, size)), np.zeros((K, size, size))
        constant[:, 0, 1:] = constant[:, 1:, 0] = np.swapaxes(columns, 1, 2).reshape(K, -1)
        constant[:, 0, 0], level[:, 0, 0] = known, 1.0
        if gamma is not None:
            constant, level = constant - gamma * level, 0.0 * level
        return [*blocks, variance.finished(constant, level)]

    def inverse(self, found: Solution, p: Array) -> Array:
        """Return Z^-1 (K, n, n) at p (K, m)."""
        return np.linalg.inv(self.unknown.at(found.coefficients, p))

    def worst(self, found: Solution, p: Array) -> float:
        """Return the largest sum over these p (K, m)."""
        columns, known = self.cost(p)
        each = np.einsum("kni,knm,kmi->k", columns, self.inverse(found, p), columns)
        return float((known + each).max())


def _half(plant: Generalized, control: bool) -> Half:
    """Return the inequality of Y without disturbances, or of X without performance: nothing in it
    depends on g.
    """
    if control:
        B1, D11, D21 = (M[..., :0] for M in (plant.B1, plant.D11, plant.D21))
        half = controlled(plant._replace(B1=B1, D11=D11, D21=D21))
    else:
        C1, D11, D12 = (M[..., :0, :] for M in (plant.C1, plant.D11, plant.D12))
        half = observed(plant._replace(C1=C1, D11=D11, D12=D12))
    return half._replace(constant=half.constant - half.level, level=0.0 * half.level)


def separable(plant: Plant) -> bool:
    """Whether the plant is continuous, every control costs, every measurement is disturbed and no
    performance feels a disturbance directly.
    """
    at, names = plant.matrices(conditions(plant)[0]), plant.channels
    noise = np.swapaxes(at.D21, 1, 2)
    return plant.dt is None and not (
        np.any(at.D11)
        or unpriced(at.D12, names.controls)
        or unpriced(noise, names.measurements, dual=True)
    )


def least_variance(
    plant: Plant, X: Dependence | None, Y: Dependence | None, factors: Sequence[float]
) -> Controller:
    """Design for the least H2 norm of a `separable` plant; `factors`: multiples of the least at
    which Y and X are settled, tried in turn.

    Raises `SynthesisError` where there is no such controller, or none was found.
    """
    attempts: list[Attempt] = []
    points = check_points(plant.parameters)
    first = scaled_plant_of(plant, 1.0)
    worst = _worst_frozen(first, points)
    if worst is None:
        raise failed(plant, attempts)
    scaled = scaled_plant_of(plant, math.sqrt(worst.variance) or 1.0)
    worst = _worst_frozen(scaled, points) or worst
    search = _Search(plant, scaled, points, worst, attempts)
    for made in search.controllers(X, Y, factors):
        if frozen_stability(made.closed()).stable is not False:
            return replace(made, attempts=tuple(attempts))
    raise failed(plant, attempts)


@dataclass(frozen=True, eq=False)
class _Search:
    """The two programs one after the other; no scheduled controller beats the `worst` frozen
    optimum.
    """

    plant: Plant
    scaled: ScaledPlant
    points: Array
    worst: _FrozenBounds
    attempts: list[Attempt]

    @property
    def unit(self) -> float:
        """Unit of an H2 norm of the scaled plant: energies are per unit of time."""
        return self.scaled.channel / math.sqrt(self.scaled.time)

    def controllers(
        self, X: Dependence | None, Y: Dependence | None, factors: Sequence[float]
    ) -> Iterator[Controller]:
        """Yield controllers whose frozen loops keep what is promised."""

        def innovations(p: Array) -> tuple[Array, Array]:
            each = zip(*self.scaled.at(p), strict=True)
            return np.stack([_innovations(Generalized(*at)) for at in each]), np.zeros(len(p))

        control, lowest = self._least(True, Y, innovations, self.worst.control)
        feedback = self._feedback(control, lowest)
        filtering, best = self._least(False, X, feedback, self.worst.variance)
        optimum = self.unit * math.sqrt(best.gamma)
        for factor in tracked("backing off", factors):
            # of all Y of nearly the least g the largest: its gains are smooth
            near = (1 + CONTROL_SHARE * (factor - 1)) ** 2
            for chosen in islice(control.widest(near * lowest.gamma, USUAL), 1):
                own = self._variance(
                    filtering.unknown.basis, False, self._feedback(control, chosen)
                )
                for settled in own.widest(factor**2 * own.least_gamma(USUAL).gamma, USUAL):
                    made = self._controller(control, chosen, own, settled)
                    if made is not None:
                        yield replace(made, optimum=min(optimum, made.promised))

    def _feedback(self, control: Variance, chosen: Solution) -> Cost:
        """Return the cost of the error of an estimate under the gains of this Y."""

        def feedback(p: Array) -> tuple[Array, Array]:
            at, P = self.scaled.at(p), control.inverse(chosen, p)
            root = np.linalg.cholesky(at.D12.mT @ at.D12)
            return _gains(at, P).mT @ root, np.einsum("kni,knm,kmi->k", at.B1, P, at.B1)

        return feedback

    def _variance(self, basis: FunctionSpace, control: bool, cost: Cost) -> Variance:
        return Variance(self.scaled, basis, control, cost, self.worst.p)

    def _controller(
        self, control: Variance, chosen: Solution, filtering: Variance, settled: Solution
    ) -> Controller | None:
        """Return the controller of these Y and X; None where no functions of p keep its level."""

        def gains(p: Array) -> Array:
            at = self.scaled.at(p)
            F = _gains(at, control.inverse(chosen, p))
            L = _gains(at.dual, filtering.inverse(settled, p)).mT
            nothing = np.zeros((len(p), F.shape[-2], L.shape[-1]))
            A = at.A + at.B2 @ F + L @ at.C2
            return Gains(*given_direct_way(at.D22, A, -L, F, nothing)).packed

        level = math.sqrt(filtering.worst(settled, self.points))
        fit = self._kept(gains, level)
        outcome = "no functions of p keep it" if fit is None else f"within {fit.misfit:.1e}"
        self.attempts.append(Attempt("settled", 0.0, outcome, self.unit * level))
        if fit is None:
            return None
        method = f"H2 output feedback, {Bases(filtering.unknown.basis, control.unknown.basis)}"
        return in_plant_units(self.plant, self.scaled, fit, self.unit * level, method)

    def _least(
        self, control: bool, given: Dependence | None, cost: Cost, floor: float
    ) -> tuple[Variance, Solution]:
        """Return the program of the degree beyond which g hardly falls, and its solution; nothing
        reaches the `floor`. Raises `SynthesisError` where there is none.
        """
        parameters, name = self.plant.parameters, "Y" if control else "X"
        matters = depends(self.plant)
        best: tuple[Variance, Solution] | None = None
        for degree in DEGREES.get(len(parameters), (2,)):
            basis = dependence(given, parameters, name, matters, degree)
            if best is not None and basis.size == best[0].unknown.basis.size:
                break
            program = self._variance(basis, control, cost)
            found = program.least_gamma(USUAL)
            bound = self.unit * math.sqrt(max(found.gamma, 0.0))
            shape = Bases(*(None, basis) if control else (basis, None))
            self.attempts.append(Attempt(f"least variance, {shape}", 0.0, found.message, bound))
            before = math.inf if best is None else best[1].gamma
            if found.gamma < before:
                best = program, found
            close = best is not None and best[1].gamma <= CLOSE_TO_OPTIMUM**2 * floor
            if found.gamma > MIN_IMPROVEMENT**2 * before or close:
                break
        if best is None:
            raise failed(self.plant, self.attempts)
        return best

    def _kept(self, gains: Callable[[Array], Array], level: float) -> Fitted | None:
        """Return the first functions of p whose frozen loops keep the level; None without any."""
        limit = level * (1 + LEVEL_TOLERANCE)
        for fit in fits(gains, self.scaled.parameters):
            A, B, C, D = closed(self.scaled, fit, self.points)
            if fit.misfit <= ACCURACY and all(
                of_gramian(A[k], B[k], C[k], D[k], None, H2_GAIN) <= limit for k in range(len(A))
            ):
                return fit
        return None


def _gains(plant: Generalized, P: Array) -> Array:
    """Return F (K, nu, n) = -R^-1 (B2'P + D12'C1)."""
    return -np.linalg.solve(plant.D12.mT @ plant.D12, plant.B2.mT @ P + plant.D12.mT @ plant.C1)


class _FrozenBounds(NamedTuple):
    """Largest least variance of the models frozen at some p, scaled, with that p (m,); and the
    largest least g of the program of Y at any.
    """

    variance: float
    p: Array
    control: float


def _worst_frozen(scaled: ScaledPlant, points: Array) -> _FrozenBounds | None:
    """Return the worst over these p (K, m); None where one model has no controller."""
    parts = []
    for each in zip(*scaled.at(points), strict=True):
        P = Generalized(*each)
        control, filtering = control_gains(P, None), control_gains(P.dual, None)
        if control is None or filtering is None:
            return None
        seen, driven = P.C1 @ filtering.X @ P.C1.T, _innovations(P)
        parts.append((np.sum((control.X @ driven) * driven), np.trace(seen)))
    known, total = np.array(parts)[:, 0], np.sum(parts, axis=1)
    k = int(np.argmax(total))
    return _FrozenBounds(max(float(total[k]), 0.0), points[k], float(known.max()))


def _innovations(plant: Generalized) -> Array:
    """Return L V^1/2 (n, ny), by which the frozen filter of one model is driven."""
    found = control_gains(plant.dual, None)
    assert found is not None  # noqa: S101 - `_worst_frozen` was asked before
    return found.F.T @ np.linalg.cholesky(found.R)
