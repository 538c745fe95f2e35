"""The general route: any number of parameters, kind of bound and way to impose it."""

from __future__ import annotations

import math
import time

import numpy as np

from symheli.lpv import LinearModel
from synthesis.analysis.ladder import NOTHING, Found, Ladder
from synthesis.assemble.box import Shape, affine_inequalities, assemble
from synthesis.certificate import Attempt, Kind, Proof
from synthesis.forms import Spline
from synthesis.impose import Grid
from synthesis.lyapunov.box import BoxLyapunov
from synthesis.lyapunov.spline import graded_knots
from synthesis.polynomial.pieces import Pieces
from synthesis.polynomial.symmetric import length, smat
from synthesis.program.cone_program import Answer, Candidate, solve
from synthesis.program.scaling import model_scaling
from synthesis.proof.box import Evidence, Units

Array = np.ndarray

SAMPLES = {1: 17, 2: 7}
"""Values of each parameter in a region at which the bound of a P is first computed (more
parameters: 3).
"""


class General(Ladder):
    """Splines P(p) over a box, in the scaled units of the `evidence`."""

    def expect(self, bound: float) -> float:
        """Set the units; the unit of gains."""
        model, demand = self.asked.model, self.asked.demand
        self.evidence = Evidence(model, _units(model, demand.kind, bound), demand)
        searched = self.evidence._replace(model=model.rounded)
        self.scaled, self.scaled_demand = searched.scaled
        return 1.0 / self.evidence.in_units(1.0)

    def constant(self) -> Shape:
        """One matrix for the whole box."""
        parameters = self.asked.model.parameters
        ends = tuple(np.array([s.low, s.high]) for s in parameters)
        return Shape(ends, (0,) * len(parameters))

    def varies(self, shape: Shape) -> bool:
        """Whether P depends on p."""
        return any(shape.degrees)

    def shapes(self) -> list[Shape]:
        """The P of the form that was asked for."""
        model, form, m = self.asked.model, self.asked.form, len(self.asked.model.parameters)
        motion = self.asked.demand.motion
        # a parameter whose rate is another is one of its own, graded towards its lower end
        alone = [m == 1 or tie is not None for tie in motion.ties]
        usual = [(3 if a else 2) if model.dt is None else (2 if a else 1) for a in alone]
        degrees = tuple(
            0 if model.dt is None and math.isinf(rate) else d if own is None else own
            for rate, own, d in zip(motion.rates, form.degrees(m), usual, strict=True)
        )
        steps = self.asked.demand.steps(model.dt, degrees)
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
        """One P and one margin, or one decay rate."""
        start = time.perf_counter()
        asked, n = self.asked, self.asked.model.sizes[0]
        demand = self.scaled_demand._replace(shift=self.evidence.in_units(alpha) if alpha else 0.0)
        inequalities = affine_inequalities(
            self.scaled, demand, shape, margin, asked.impose.least, self.evidence.units.weight
        )
        program = assemble(inequalities, shape, n, asked.impose, maximise=not asked.gains)
        built = time.perf_counter()
        candidate = solve(program, asked.solver)
        solved = time.perf_counter()
        found = self._judged(candidate, shape)
        self.spent += (built - start, solved - built, time.perf_counter() - solved)
        words = "no P" if found.proof is None else f"bound {found.bound:.6g}"
        segments = math.prod(len(k) - 1 for k in shape.knots)
        name = f"{segments} segments of degree {max(shape.degrees)}"
        self.attempts.append(Attempt(name, margin, f"{candidate.message}, {words}", found.bound))
        return found

    def _judged(self, candidate: Candidate, shape: Shape) -> Found:
        """What P itself gives, whatever the solver said."""
        if candidate.x is None:
            return Found(math.inf, None, candidate.answer)
        n, free, gains = self.asked.model.sizes[0], shape.free, self.asked.gains
        # a margin of nothing is an answer; a larger one that cannot be verified, or a gain that
        # cannot, is the solver's trouble
        margin = 1.0 if gains else candidate.x[free.shape[1] * length(n)]
        none = candidate.answer is Answer.SOLVED and margin <= NOTHING
        nothing = Found(math.inf, None, Answer.INFEASIBLE if none else Answer.FAILED)
        values = smat(candidate.x[: free.shape[1] * length(n)].reshape(free.shape[1], -1), n)
        tensor = np.tensordot(free, values, axes=1).reshape(*shape.counts, n, n)
        # judged as it is stored, in physical units
        P = BoxLyapunov(shape.knots, shape.degrees, self.evidence.units.to_physical(tensor))
        if isinstance(self.asked.impose, Grid):
            P, bound = self.evidence.sampled(P, self.asked.impose.points)
            if math.isinf(bound):
                return nothing
        else:
            least = self.evidence.least(P, SAMPLES.get(len(shape.knots), 3))
            if least is None:
                return nothing
            P, bound = least
        proof = Proof(self.evidence, P)
        return Found(bound, proof, candidate.answer, self.evidence.conditioning(P))


def _units(model: Pieces, kind: Kind, expected: float) -> Units:
    middle = np.array([[s.middle for s in model.parameters]])
    A, B, C, D = (M[0] for M in model.at(middle))
    names = [
        tuple(f"{letter}{i}" for i in range(n))
        for letter, n in zip("xuy", model.sizes, strict=True)
    ]
    low, high = np.array([(s.low, s.high) for s in model.parameters]).T
    every = model.at(low + np.linspace(0.0, 1.0, 9)[:, None] * (high - low))
    frozen = LinearModel(A, B, C, D, *names, dt=model.dt)  # type: ignore[arg-type]
    scale = model_scaling(frozen, expected if kind.endswith("gain") else 1.0, every)
    root = math.sqrt(scale.time)
    if kind == "energy-to-peak gain":
        # outputs are peaks, not energies
        return Units(
            scale.left, scale.right, 1 / root, scale.channel, scale.time, 1.0, scale.weight
        )
    return Units(
        scale.left,
        scale.right,
        1 / root,
        scale.channel / root,
        scale.time,
        scale.channel**2,
        scale.weight,
    )
