"""The general search: any number of parameters, kind of bound and relaxation."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from symheli import LinearModel
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.assemble.box import Shape, affine_inequalities, assemble
from synthesis.certify.assemble.points import at_points, points_of
from synthesis.certify.assemble.rounded import rounded_pieces
from synthesis.certify.proof.box import BoxEvidence
from synthesis.certify.questions import admitted_bound
from synthesis.certify.questions.certificate import Proof
from synthesis.certify.questions.frozen_storage import central_dissipation
from synthesis.certify.questions.ladder import CLOSE_TO_LOWER, NO_MARGIN, Found, Ladder
from synthesis.certify.questions.problem import BoundProblem
from synthesis.certify.statement.box import BoxLyapunov
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Grid
from synthesis.certify.statement.kind import L2_GAIN, Kind
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.scaling import dissipative, gramian_units, model_scaling
from synthesis.certify.statement.spline import graded_knots
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.polynomial.matrix import PolynomialMatrix
from synthesis.numerics.polynomial.pieces import Pieces
from synthesis.numerics.polynomial.regions import model_on, regions
from synthesis.numerics.polynomial.symmetric import extended, length, smat
from synthesis.numerics.program import interior_point
from synthesis.numerics.program.answer import LEFT, Answer
from synthesis.numerics.program.cone_program import LYAPUNOV, SolverPoint, general_solver, solve
from synthesis.numerics.program.effort import work
from synthesis.numerics.program.interior_point import Minimum
from synthesis.numerics.program.lyapunov_program import LyapunovBlocks, LyapunovProgram, Sizes

SAMPLES_PER_REGION = {1: 17, 2: 13}
"""Samples of each parameter in a region at which the bound that P admits is first computed (more
parameters: 3).
"""


CANDIDATE_POINTS, INITIAL_POINTS = {1: 81, 2: 25}, {1: 9, 2: 7}
"""Points of each parameter in a region at which inequalities may be added to a program (more
parameters: 5), and those in the first program (more parameters: 2).
"""
MAX_ROUNDS = 8
"""Largest number of rounds in which violated inequalities are added."""
MAX_ADDED = 24
"""Largest number of points added per region and round."""
BOUND_TOLERANCE = 3e-3
"""Relative difference of the proven bound from the level of its program below which no further
points are added.
"""
MIN_POINT_TOLERANCE = 2e-3
"""Least relative gap to which a program of points is solved: its P is proven by other means, and a
P well inside the constraints holds between the points too.
"""
ANNOUNCED = 5.0
"""Seconds of work from which on a program is announced."""
CENTRAL_LEVEL = 1.05
"""Multiple of the expected gain at which frozen models have the central storage functions whose
dissipation is the measure of how far inside the inequalities a P that varies with p is kept.
"""
CENTRAL_SHARE = 0.1
"""That distance as a share of this dissipation. By convexity it costs a parameter at rest this
share of what the level is above the worst frozen gain, and P holds between the points as well.
"""


class _AtPoints(NamedTuple):
    """The inequalities of a region at single p: the `system` there, the `blocks`, a block for each
    and extreme motion of p, and the dissipations found so far by the number of the point.
    """

    system: Matrices
    blocks: LyapunovBlocks
    found: dict[int, Array]

    def inside(self, which: Array, share: float, level: float, weight: Array) -> LyapunovBlocks:
        """Return the blocks `which`, held below zero by this share of the dissipation of the
        central storage functions of the frozen models at a level of the gain.
        """
        blocks = self.blocks.keep(which)
        if share == 0.0:
            return blocks
        W = extended(weight, self.system.B.shape[2])
        places = np.flatnonzero(which) % len(self.system.A)
        for k in set(places.tolist()) - set(self.found):
            model = Matrices(*(M[k] for M in self.system))
            self.found[k] = W.T @ central_dissipation(model, level) @ W
        back_off = share * np.array([self.found[k] for k in places.tolist()])
        return blocks._replace(constant=blocks.constant + back_off)


class General(Ladder):
    """Splines P(p) over a box, in the scaled units of the `evidence`."""

    def __init__(self, problem: BoundProblem):
        if problem.solver.name == LYAPUNOV and not problem.by_points:  # of stability, for a gain
            problem = problem._replace(solver=general_solver("CLARABEL"))
        super().__init__(problem)

    def expect(self, bound: float) -> float:
        """Set the units for this expected gain; return the unit of gains."""
        model, kind = self.problem.model, self.problem.demand.kind
        self.expected = bound
        frozen, scale = _scaling(model, kind, bound)
        of_gramian = self.problem.demand.of_gramian
        self.choices = [gramian_units(scale, frozen) if of_gramian else scale]
        other = dissipative(scale, frozen, bound) if kind == L2_GAIN else None
        if other is not None:
            self.choices.insert(0, other)
        self.rounding = math.nan
        return self._in_units(self.choices[-1])

    def settle(self) -> float:
        """Choose the first units in which the gain of the model frozen at mid-range is found
        accurately; return the unit of gains.
        """
        if self.problem.demand.kind != L2_GAIN or len(self.choices) == 1:
            return self.unit
        start, found = time.perf_counter(), []
        gain = norm(*_frozen(self.problem.model), self.problem.model.dt)[0]
        for units in self.choices:
            self._in_units(units)
            found.append(self._frozen_gain() / gain - 1 if gain > 0 else 0.0)
            if found[-1] <= CLOSE_TO_LOWER:
                break
        best = int(np.argmin(np.nan_to_num(found, nan=math.inf)))
        self.rounding = found[best]
        self.spent[1] += time.perf_counter() - start
        return self._in_units(self.choices[best])

    def _in_units(self, units: Scaling) -> float:
        self.evidence = BoxEvidence(self.problem.model, units, self.problem.demand)
        searched = self.evidence._replace(model=rounded_pieces(self.problem.model))
        self.scaled, self.scaled_demand = searched.scaled
        return abs(1.0 / self.evidence.in_units(1.0))

    def _frozen_gain(self) -> float:
        """Return the gain of the model frozen at mid-range as a program in these units finds it."""
        whole, scaled = self.evidence, self.scaled
        box = tuple((s.low, s.high) for s in self.problem.model.parameters)
        still = {
            (0,) * len(box): tuple(
                PolynomialMatrix.constant(M, box) for M in _frozen(self.problem.model)
            )
        }
        model = self.problem.model._replace(breaks=box, models=still)
        self.evidence = whole._replace(model=model)
        self.scaled = self.evidence.scaled[0]
        shape, margin = self.constant(), self.problem.impose.tried[0]
        candidate = self._solve(shape, margin)
        P = candidate.x is not None and self._lyapunov(candidate.x, shape)
        bound = admitted_bound.sampled(self.evidence, P, 2)[1] if P else math.inf
        self.evidence, self.scaled = whole, scaled
        return bound

    @property
    def found_by(self) -> str:
        """Name of the relaxation used in the search."""
        if self.problem.by_points:
            return "LMIs at single p, added where they were violated"
        return super().found_by

    def constant(self) -> Shape:
        """The form of a constant P over the whole box."""
        parameters = self.problem.model.parameters
        ends = tuple(np.array([s.low, s.high]) for s in parameters)
        return Shape(ends, (0,) * len(parameters))

    def varies(self, shape: Shape) -> bool:
        """Whether P depends on p."""
        return any(shape.degrees)

    def shapes(self) -> list[Shape]:
        """Forms of P that the user requested, in turn."""
        model, form, m = self.problem.model, self.problem.form, len(self.problem.model.parameters)
        motion = self.problem.demand.motion
        # a parameter whose rate is another is one of its own, graded towards its lower end
        alone = [m == 1 or tie is not None for tie in motion.ties]
        usual = [(3 if a else 2) if model.dt is None else (2 if a else 1) for a in alone]
        degrees = tuple(
            0 if model.dt is None and math.isinf(rate) else d if own is None else own
            for rate, own, d in zip(motion.rates, form.degrees(m), usual, strict=True)
        )
        steps = self.problem.demand.steps(model.dt, degrees)
        total = form.total_degree if isinstance(form, Spline) else None
        out: list[Shape] = []
        coarse = (4, 8) if any(alone) else (1,)
        tried = form.segments_tried(m) or [[k if a else 1 for a in alone] for k in coarse]
        for wanted in tried:
            knots = []
            for s, breaks, d, step, a, segments in zip(
                model.parameters,
                model.breaks,
                degrees,
                steps,
                alone,
                wanted,
                strict=True,
            ):
                if d == 0 or 2.5 * step >= s.high - s.low:
                    knots.append(np.array([s.low, s.high]))
                else:
                    grading = form.grading or (2.0 if a else 1.0)
                    knots.append(
                        graded_knots(
                            s.low, s.high, segments, grading, breaks[1:-1], shortest=2.5 * step
                        )
                    )
            shape = Shape(tuple(knots), degrees, total)
            if not out or shape.counts != out[-1].counts:
                out.append(shape)
        return out

    def attempt(self, shape: Shape, margin: float, alpha: float = 0.0) -> Found:
        """Solve and verify a program with one form of P and one margin, or one decay rate."""
        problem = self.problem
        demand = self.scaled_demand
        shift = self.evidence.in_units(alpha) if alpha else 0.0
        self.scaled_demand = demand._replace(shift=shift)
        if problem.by_points:
            found, message = self._by_points(shape, margin)
        else:
            candidate = self._solve(shape, margin)
            found, message = self._verified(candidate, shape), candidate.message
        self.scaled_demand = demand
        if found.proof is not None and not found.bound > problem.effort.enough:
            problem.effort.proven = True
        words = "no P" if found.proof is None else f"bound {found.bound:.6g}"
        segments = math.prod(len(k) - 1 for k in shape.knots)
        name = f"{segments} segments of degree {max(shape.degrees)}"
        answer = message if message.startswith(LEFT) else f"{message}, {words}"
        self.attempts.append(Attempt(name, margin, answer, found.bound))
        return found

    def _solve(self, shape: Shape, margin: float) -> SolverPoint:
        """Solve the program of all inequalities."""
        problem, start = self.problem, time.perf_counter()
        if problem.by_points:
            every = self._inequalities(shape)
            whole = [np.ones(len(at.blocks.constant), bool) for at in every]
            return self._of_points(every, whole, shape, margin)
        inequalities = affine_inequalities(
            self.scaled,
            self.scaled_demand,
            shape,
            margin,
            problem.impose.least,
            self.evidence.units.weight,
        )
        n = problem.model.sizes[0]
        program = assemble(inequalities, shape, n, problem.impose, maximise=not problem.gains)
        built = time.perf_counter()
        refused = self._refused(work(program))
        candidate = refused or solve(program, problem.solver)
        self.spent += (built - start, time.perf_counter() - built, 0.0)
        return candidate

    def _refused(self, seconds: float) -> Minimum | None:
        """Return the answer to a program of so much work that it is left out, None to others; long
        ones are announced.
        """
        words = self.problem.effort.refused(seconds)
        if words:
            return Minimum(Answer.UNTRIED, None, 0.0, words)
        if seconds > ANNOUNCED:
            self._searching.to(len(self.attempts), f"a program of about {seconds:.0f} s")
        return None

    def _by_points(self, shape: Shape, margin: float) -> tuple[Found, str]:
        """Solve programs of few inequalities, adding the violated ones, until the bound proven on
        the whole box is near their level; return it with the outcome in words.
        """
        best, n, nu = Found(math.inf), *self.problem.model.sizes[:2]
        every, rounds = self._inequalities(shape), 0
        active = [self._first(shape, at.blocks) for at in every]
        while True:
            rounds += 1
            candidate = self._of_points(every, active, shape, margin)
            best = best.or_better(self._verified(candidate, shape), 1.0)
            if candidate.x is None or rounds == MAX_ROUNDS:
                break
            g = candidate.x[-1]
            if best.bound * self.evidence.in_units(1.0) <= (1 + BOUND_TOLERANCE) * math.sqrt(
                max(g, 0.0)
            ):
                break
            P = smat(candidate.x[:-1].reshape(-1, length(n)), n)
            level, added = np.diag(np.r_[np.zeros(n), np.full(nu, g)]), 0
            for at, which in zip(every, active, strict=True):
                values = at.blocks.linear(P) + at.blocks.constant
                # of a point with all motions
                excess = np.linalg.eigvalsh(values - level)[:, -1]
                excess = excess.reshape(-1, at.blocks.places).max(axis=0)
                places = which.reshape(-1, at.blocks.places)
                excess[places[0]] = 0.0
                worst = np.argsort(excess)[-MAX_ADDED:]
                worst = worst[excess[worst] > 0]
                places[:, worst] = True
                added += len(worst)
            if not added:
                break
        return best, f"{candidate.message} ({rounds} round(s))"

    def _inequalities(self, shape: Shape) -> list[_AtPoints]:
        """Return the inequalities that may be added, one object a region."""
        start, demand = time.perf_counter(), self.scaled_demand
        count = CANDIDATE_POINTS.get(len(shape.knots), 5)
        moving = demand.moving(shape.degrees)
        every = []
        for region in regions(self.scaled, shape.knots, demand.motion, moving):
            points = points_of(region, count)
            system = Matrices(*(M(points) for M in model_on(self.scaled, region, float)))
            blocks = at_points(system, demand, shape, region, points, self.weight)
            every.append(_AtPoints(system, blocks, {}))
        self.spent[0] += time.perf_counter() - start
        return every

    def _first(self, shape: Shape, block: LyapunovBlocks) -> Array:
        """Mark the inequalities of a region in the first program: some points, with every
        motion.
        """
        m = len(shape.knots)
        count = CANDIDATE_POINTS.get(m, 5)
        chosen = np.zeros(count, dtype=bool)
        chosen[np.linspace(0, count - 1, INITIAL_POINTS.get(m, 2)).round().astype(int)] = True
        grid = reduce(np.logical_and.outer, [chosen] * m)
        return np.resize(grid.ravel(), len(block.constant))

    def _of_points(
        self,
        every: list[_AtPoints],
        active: list[Array],
        shape: Shape,
        margin: float,
    ) -> Minimum:
        """Solve the program of the active inequalities.

        P > 0 follows where the frozen models are stable and P falls both ways p may move: it is
        imposed on all coefficients, which is much more, only where p moves one way.
        """
        n, nu, _ = self.problem.model.sizes
        start, level = time.perf_counter(), CENTRAL_LEVEL * self.evidence.in_units(self.expected)
        share = CENTRAL_SHARE if self.varies(shape) else 0.0
        chosen = [
            at.inside(which, share, level, self.weight)
            for at, which in zip(every, active, strict=True)
            if which.any()
        ]
        self.spent[0] += time.perf_counter() - start
        unknowns = 1 + max(int(at.blocks.columns.max()) for at in every)
        tied = self.varies(shape) and self.scaled_demand.motion.tied
        floor = self.problem.impose.least if tied or not self.varies(shape) else None
        program = LyapunovProgram(tuple(chosen), Sizes(n, nu, unknowns), margin, floor)
        refused = self._refused(work(program))
        if refused:
            return refused
        given = self.problem.solver
        coarse = max(MIN_POINT_TOLERANCE, given.options["tolerance"])
        candidate = interior_point.minimise(program, replace(given, tolerance=coarse))
        self.spent[1] += candidate.seconds
        return candidate

    @property
    def weight(self) -> Array:
        """Weight of the state blocks; see `Scaling`."""
        return self.evidence.units.weight

    def _lyapunov(self, x: Array, shape: Shape) -> BoxLyapunov:
        """Return P at the solver's point x in physical units, as it is stored."""
        n, free = self.problem.model.sizes[0], shape.free
        values = smat(x[: free.shape[1] * length(n)].reshape(free.shape[1], -1), n)
        tensor = np.tensordot(free, values, axes=1).reshape(*shape.counts, n, n)
        return BoxLyapunov(shape.knots, shape.degrees, self.evidence.to_physical(tensor))

    def _verified(self, candidate: SolverPoint, shape: Shape) -> Found:
        start = time.perf_counter()
        found = self._judged(candidate, shape)
        self.spent[2] += time.perf_counter() - start
        return found

    def _judged(self, candidate: SolverPoint, shape: Shape) -> Found:
        """Compute the bound that P itself admits, whatever status the solver reported."""
        if candidate.x is None:
            return Found(math.inf, None, candidate.answer)
        n, free, gains = self.problem.model.sizes[0], shape.free, self.problem.gains
        # a margin of nothing is an answer; a larger one that cannot be verified, or a gain that
        # cannot, is the solver's trouble
        margin = 1.0 if gains else candidate.x[free.shape[1] * length(n)]
        none = candidate.answer is Answer.SOLVED and margin <= NO_MARGIN
        nothing = Found(math.inf, None, Answer.INFEASIBLE if none else Answer.FAILED)
        P = self._lyapunov(candidate.x, shape)
        if isinstance(self.problem.impose, Grid):
            P, bound = admitted_bound.sampled(self.evidence, P, self.problem.impose.points)
            if math.isinf(bound):
                return nothing
        else:
            least = admitted_bound.least(
                self.evidence, P, SAMPLES_PER_REGION.get(len(shape.knots), 3)
            )
            if least is None:
                return nothing
            P, bound = least
            if gains and not self.problem.demand.kind.indexed:
                bound *= math.sqrt(1 + self.sampling_error)
            if not self.believed(Proof(self.evidence, P), bound):
                return nothing
        proof = Proof(self.evidence, P)
        return Found(bound, proof, candidate.answer, admitted_bound.conditioning(self.evidence, P))


def _frozen(model: Pieces) -> Matrices:
    """The model at mid-range."""
    middle = np.array([[s.middle for s in model.parameters]])
    return Matrices(*(M[0] for M in model.at(middle)))


def _scaling(model: Pieces, kind: Kind, expected: float) -> tuple[LinearModel, Scaling]:
    """The model at mid-range, and its units."""
    names = [
        tuple(f"{letter}{i}" for i in range(n))
        for letter, n in zip("xuy", model.sizes, strict=True)
    ]
    low, high = np.array([(s.low, s.high) for s in model.parameters]).T
    every = model.at(low + np.linspace(0.0, 1.0, 9)[:, None] * (high - low))
    frozen = LinearModel(*_frozen(model), *names, dt=model.dt)  # type: ignore[arg-type]
    if kind.indexed:  # no level says how large the outputs are
        size = norm(frozen.A, frozen.B, frozen.C, frozen.D, model.dt)[0]
        expected = size if 0 < size < math.inf else 1.0
    return frozen, model_scaling(frozen, expected if kind.driven else 1.0, every)
