"""Gains, decay and stability over a box of parameters: search for P, verify, and compare with what
no proof can beat.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv import LFT, LinearModel, LPVStateSpace
from synthesis.analysis.fine_sampling import fine_sampling
from synthesis.analysis.hypotheses import VERIFIED, fitted
from synthesis.analysis.one_parameter import CLOSE, NOTHING
from synthesis.assemble.box import Shape, affine_inequalities, assemble
from synthesis.certificate import Attempt
from synthesis.forms import Relaxation
from synthesis.lyapunov.box import BoxLyapunov
from synthesis.lyapunov.spline import graded_knots
from synthesis.polynomial.certificate import BoxCertificate
from synthesis.polynomial.pieces import Pieces, pieces
from synthesis.polynomial.symmetric import length, smat
from synthesis.program.cone_program import Answer, Candidate, Solver, solve
from synthesis.program.scaling import in_its_own_scale, model_scaling
from synthesis.proof.box import Evidence, Units
from synthesis.proof.inequalities import Demand
from synthesis.verdict import Kind, Seconds, Status
from synthesis.worst.box import (
    Worst,
    growing,
    measure,
    unstable_at,
    worst_frozen,
    worst_moving,
)
from synthesis.worst.budget import said
from synthesis.worst.lower_bound import Search
from synthesis.worst.rates import Rate, rates
from synthesis.worst.trajectory import Trajectory

Array = np.ndarray
Model = LPVStateSpace | LFT

DECAY_TOLERANCE = 2e-3
"""The decay rate is found to this fraction of the frozen one."""

ROUNDED = 1e-12
"""What is looked for where the slowest frozen mode is stable or not to rounding, 1/s."""

SAMPLES = {1: 17, 2: 7}
"""Values of each parameter in a region at which the bound of a P is first computed (more
parameters: 3).
"""


def box_certificate(
    model: Model,
    rate: Rate,
    kind: Kind,
    relaxation: Relaxation,
    solver: Solver,
    search: Search | None,
) -> BoxCertificate:
    """The certificate of that kind; see `l2_gain`, `stability`, `generalized_h2` and
    `decay_rate`.
    """
    model = _accepted(model)
    if relaxation.order > 1 or relaxation.memory is not None:
        raise InputError(
            "order and memory of V are for l2_gain and stability of one parameter; here V = x'P(p)x"
        )
    piece = pieces(model)
    demand = Demand(kind, rates(piece.parameters, rate))
    _check_channels(piece, kind)
    start = time.perf_counter()
    frozen = worst_frozen(piece, measure(demand, piece.dt))
    sign = 1.0 if kind.endswith("gain") else -1.0
    report = _Report(piece, demand, relaxation, solver, sign * frozen.value)
    unstable = math.isinf(frozen.value) if sign > 0 else frozen.value >= 0
    if unstable and (at := unstable_at(piece, frozen.p or ())) is not None:
        frozen = Worst(frozen.value, at)
    elif unstable:  # stable or not to rounding: nothing is known from below
        frozen, search, unstable = Worst(0.0 if sign > 0 else -ROUNDED, frozen.p), None, False
        report = _Report(piece, demand, relaxation, solver, sign * frozen.value)
    if unstable:
        at_rest = Trajectory(np.zeros(1), _alone(np.array([frozen.p])))
        return report.nothing(Status.UNSTABLE, frozen, at_rest, time.perf_counter() - start)
    limit = frozen if kind == "stability" else worst_moving(model, demand, frozen, search)
    bounds = time.perf_counter() - start
    if math.isinf(limit.value) if sign > 0 else limit.value >= 0:
        return report.nothing(Status.GROWING, limit, limit.trajectory, bounds)
    hunt = _Hunt(piece, demand, relaxation, solver)
    best = hunt.decay(sign * frozen.value) if kind == "decay rate" else hunt.gain(frozen.value)
    if best.lyapunov is None and kind == "stability":
        start = time.perf_counter()
        worst = growing(model, demand, search)
        bounds += time.perf_counter() - start
        if worst is not None:
            return report.nothing(Status.GROWING, frozen, worst, bounds, hunt)
    cert = report.found(best, sign * limit.value, limit.trajectory, bounds, hunt)
    return cert if kind == "stability" else cert.resting_on(said(search and search.seconds, bounds))


class Found(NamedTuple):
    """The best P verified (or computed, on a grid) and the bound it gives."""

    lyapunov: BoxLyapunov | None
    bound: float
    answer: Answer = Answer.UNTRIED


class _Hunt:
    """Cone programs of finer and finer P."""

    def __init__(
        self,
        model: Pieces,
        demand: Demand,
        relaxation: Relaxation,
        solver: Solver,
        expected: float = 1.0,
    ):
        self.model, self.demand, self.relaxation, self.solver = model, demand, relaxation, solver
        self.attempts: list[Attempt] = []
        self.spent = np.zeros(3)
        self.expect(expected)

    def expect(self, bound: float) -> None:
        """Set the units in which numbers are of order one where the bound is near this one."""
        self.evidence = Evidence(
            self.model, _units(self.model, self.demand.kind, bound), self.demand
        )
        self.scaled, self.scaled_demand = self.evidence.scaled

    def gain(self, limit: float) -> Found:
        """The least gain, or any P for stability; `limit` sets the first scale and says what is
        good enough.
        """
        if self.demand.kind == "stability":
            return self._least(limit)

        def found(expected: float) -> tuple[tuple[Found, Evidence], float, float]:
            self.expect(expected)
            best = self._least(limit)
            return (best, self.evidence), best.bound, 1.0 / self.evidence.in_units(1.0)

        best, self.evidence = min(in_its_own_scale(found, limit), key=lambda pair: pair[0].bound)
        return best

    def _least(self, limit: float) -> Found:
        nothing = Found(None, math.nan if self.demand.kind == "stability" else math.inf)
        best = nothing

        def attempt(shape: Shape, best: Found) -> Found:
            for margin in self.relaxation.margins:
                found = self._attempt(shape, margin, 0.0)
                if found.lyapunov is None and best.lyapunov is None:
                    best = nothing._replace(
                        answer=best.answer if found.answer is Answer.UNTRIED else found.answer
                    )
                elif found.lyapunov is not None and (
                    best.lyapunov is None or found.bound < best.bound
                ):
                    best = found
                if found.lyapunov is not None or found.answer in (
                    Answer.INFEASIBLE,
                    Answer.UNTRIED,
                ):
                    break
            return best

        for shape in self._shapes():
            best = attempt(shape, best)
            if best.lyapunov is not None and not best.bound > self.relaxation.accept * limit:
                break
        if any(shape.degrees) and (best.lyapunov is None or best.bound > (1 + CLOSE) * limit):
            # a constant P proves for every rate what it proves for jumps
            answer, best = best.answer, attempt(self._constant(), best)
            best = best if best.lyapunov is not None else best._replace(answer=answer)
        return best

    def decay(self, limit: float) -> Found:
        """The largest decay rate, between 0 and `limit` (1/s); each P counts for all that it
        proves.
        """
        best = Found(None, -math.inf)
        tolerance = DECAY_TOLERANCE * limit
        for shape in self._shapes():
            best = self._bisected(shape, best, limit - tolerance, limit)
            if best.lyapunov is not None and best.bound * self.relaxation.accept >= limit:
                break
        if any(shape.degrees) and best.bound < limit - 2 * tolerance:
            # a constant P proves for every rate what it proves for jumps: asked first whether it
            # proves more
            answer, trial = (
                best.answer,
                limit - tolerance if best.lyapunov is None else best.bound + tolerance,
            )
            best = self._bisected(self._constant(), best, trial, limit)
            best = best if best.lyapunov is not None else best._replace(answer=answer)
        return best

    def _bisected(self, shape: Shape, best: Found, trial: float, limit: float) -> Found:
        tolerance = DECAY_TOLERANCE * limit
        low, high = max(best.bound, 0.0), limit
        while True:
            found = self._attempt(shape, 0.0, trial)
            if found.lyapunov is not None and found.bound > max(best.bound, 0.0):
                best = found
            elif best.lyapunov is None and found.answer is not Answer.UNTRIED:
                best = best._replace(answer=found.answer)
            if found.answer is Answer.UNTRIED:
                return best
            # a P that proves less than was asked for: the half below is left, whatever it would
            # have allowed
            low = max(low, found.bound if found.lyapunov is not None else 0.0)
            high = high if low >= trial else trial
            if high - low <= tolerance:
                return best
            trial = 0.5 * (low + high)

    def _constant(self) -> Shape:
        return Shape(
            tuple(np.array([s.low, s.high]) for s in self.model.parameters),
            (0,) * len(self.model.parameters),
        )

    def _shapes(self) -> list[Shape]:
        """The forms of P to be tried in turn."""
        model, relaxation, m = self.model, self.relaxation, len(self.model.parameters)
        default = (3 if m == 1 else 2) if model.dt is None else (2 if m == 1 else 1)
        degree = default if relaxation.degree is None else relaxation.degree
        degrees = tuple(
            0 if model.dt is None and math.isinf(rate) else degree for rate in self.demand.rates
        )
        steps = self.demand.steps(model.dt, degrees)
        out: list[Shape] = []
        for segments in relaxation.segments or ((4, 8) if m == 1 else (1,)):
            knots = []
            for s, breaks, d, step in zip(
                model.parameters, model.breaks, degrees, steps, strict=True
            ):
                if d == 0 or 2.5 * step >= s.high - s.low:
                    knots.append(np.array([s.low, s.high]))
                else:
                    grading = relaxation.grading if m == 1 else 1.0
                    knots.append(
                        graded_knots(
                            s.low, s.high, segments, grading, breaks[1:-1], shortest=2.5 * step
                        )
                    )
            shape = Shape(tuple(knots), degrees, relaxation.total_degree)
            if not out or shape.counts != out[-1].counts:
                out.append(shape)
        return out

    def _attempt(self, shape: Shape, margin: float, alpha: float) -> Found:
        start = time.perf_counter()
        kind, n = self.demand.kind, self.model.sizes[0]
        gains = kind.endswith("gain")
        demand = self.scaled_demand._replace(shift=self.evidence.in_units(alpha) if alpha else 0.0)
        inequalities = affine_inequalities(
            self.scaled, demand, shape, margin, self.relaxation.floor, self.evidence.units.weight
        )
        program = assemble(inequalities, shape, n, self.relaxation, maximise=not gains)
        built = time.perf_counter()
        candidate = solve(program, self.solver)
        solved = time.perf_counter()
        found = self._judged(candidate, shape)
        self.spent += np.array([built - start, solved - built, time.perf_counter() - solved])
        words = (
            f"{candidate.message},"
            f" {'no P' if found.lyapunov is None else f'bound {found.bound:.6g}'}"
        )
        segments = math.prod(len(k) - 1 for k in shape.knots)
        self.attempts.append(Attempt(segments, max(shape.degrees), margin, words, found.bound))
        return found

    def _judged(self, candidate: Candidate, shape: Shape) -> Found:
        """What P itself gives, whatever the solver said."""
        if candidate.x is None:
            return Found(None, math.inf, candidate.answer)
        n, free = self.model.sizes[0], shape.free
        # a margin of nothing is an answer; a larger one that cannot be verified, or a gain that
        # cannot, is the solver's trouble
        margin = (
            1.0 if self.demand.kind.endswith("gain") else candidate.x[free.shape[1] * length(n)]
        )
        solved = candidate.answer is Answer.SOLVED
        nothing = Found(
            None, math.inf, Answer.INFEASIBLE if solved and margin <= NOTHING else Answer.FAILED
        )
        values = smat(candidate.x[: free.shape[1] * length(n)].reshape(free.shape[1], -1), n)
        tensor = np.tensordot(free, values, axes=1).reshape(*shape.counts, n, n)
        # judged as it is stored, in physical units
        P = BoxLyapunov(shape.knots, shape.degrees, self.evidence.units.to_physical(tensor))
        if self.relaxation.kind == "grid":
            P, bound = self.evidence.sampled(P, self.relaxation.points)
            return nothing if math.isinf(bound) else Found(P, bound, candidate.answer)
        least = self.evidence.least(P, SAMPLES.get(len(shape.knots), 3))
        return nothing if least is None else Found(*least, candidate.answer)


@dataclass(frozen=True, eq=False)
class _Report:
    """How a certificate is written down."""

    model: Pieces
    demand: Demand
    relaxation: Relaxation
    solver: Solver
    frozen: float

    def nothing(
        self,
        status: Status,
        limit: Worst,
        worst: Trajectory | None,
        bounds: float,
        hunt: _Hunt | None = None,
    ) -> BoxCertificate:
        """Nothing is proven, and it is known why."""
        sign = 1.0 if self.demand.kind.endswith("gain") else -1.0
        return self._made(Found(None, math.inf), sign * limit.value, worst, bounds, hunt, status)

    def found(
        self, best: Found, limit: float, worst: Trajectory | None, bounds: float, hunt: _Hunt
    ) -> BoxCertificate:
        """What the hunt brought."""
        if best.lyapunov is None:
            status = Status.without_proof(best.answer)
        else:
            status = Status.UNPROVEN if self.relaxation.kind == "grid" else Status.PROVEN
        return self._made(best, limit, worst, bounds, hunt, status)

    def _made(
        self,
        best: Found,
        limit: float,
        worst: Trajectory | None,
        bounds: float,
        hunt: _Hunt | None,
        status: Status,
    ) -> BoxCertificate:
        kind, proven = self.demand.kind, status is Status.PROVEN
        nothing = -math.inf if kind == "decay rate" else math.inf
        names = {"stability": (), "decay rate": ("alpha", "upper", "frozen")}.get(
            kind, ("gamma", "lower", "frozen")
        )
        bounds_by_name = dict(
            zip(names, (best.bound if proven else nothing, limit, self.frozen), strict=False)
        )
        P, evidence = best.lyapunov, hunt.evidence if hunt else None
        return BoxCertificate(
            kind=kind,
            **bounds_by_name,
            status=status,
            verified=proven,
            rates=self.demand.rates,
            hypotheses=self._hypotheses(P, status) + self._sampling(bounds_by_name),
            solver=str(self.solver),
            seconds=Seconds(*(float(s) for s in (*(hunt.spent if hunt else np.zeros(3)), bounds))),
            conditioning=evidence.conditioning(P) if P and evidence else math.inf,
            attempts=tuple(hunt.attempts) if hunt else (),
            worst=worst,
            relaxation=self.relaxation.kind,
            lyapunov=P,
            indicative=best.bound if status is Status.UNPROVEN else math.nan,
            evidence=evidence,
        )

    def _sampling(self, bounds: Mapping[str, float]) -> tuple[str, ...]:
        if "gamma" not in bounds:
            return ()
        corners = np.array(
            list(product(*((s.low, s.middle, s.high) for s in self.model.parameters)))
        )
        return fine_sampling(
            self.model.at(corners)[0], self.model.dt, bounds["gamma"], bounds["lower"]
        )

    def _hypotheses(self, P: BoxLyapunov | None, status: Status) -> tuple[str, ...]:
        out = []
        for s, rate in zip(self.model.parameters, self.demand.rates, strict=True):
            unit = "" if s.unit == "1" else f" {s.unit}"
            speed = (
                "arbitrarily fast"
                if math.isinf(rate)
                else "constant"
                if rate == 0
                else f"|d{s.name}/dt| <= {rate:g}{unit} per second"
            )
            out.append(f"{s.name} is exogenous, in [{s.low:g}, {s.high:g}]{unit}, {speed}")
        out += fitted(self.model.source)
        if P is not None and status is Status.PROVEN:
            out.append(f"{P.form}, found by {_FOUND[self.relaxation.kind]}")
            shared = "pieces, regions, products of polynomials and the inequalities themselves"
            out.append(
                VERIFIED.format(
                    what="the whole box, halved where needed, and a grid of p", shared=shared
                )
            )
        if status is Status.UNPROVEN:
            out.append(
                f"the inequalities hold at {self.relaxation.points} values of each parameter in"
                " every region: no guarantee"
            )
        out += _MEANING.get(self.demand.kind, ())
        return tuple(out)


_FOUND = {
    "bernstein": "one LMI per Bernstein coefficient",
    "sos": "matrix sums of squares",
    "vertices": "LMIs at the vertices with convexity along every axis",
}
_MEANING = {
    "l2 gain": (
        (
            "the gain is from zero initial state, |y|_2 < gamma |u|_2, all inputs to all outputs"
            " together"
        ),
    ),
    "energy-to-peak gain": (
        (
            "the gain is from zero initial state, max_t |y(t)| < gamma |u|_2, the Euclidean norm of"
            " all outputs"
        ),
    ),
    "decay rate": ("|x(t)| <= c exp(-alpha t) |x(0)| for some c, along every admissible p(t)",),
}


def _accepted(model: Model) -> LPVStateSpace:
    if isinstance(model, LPVStateSpace):
        return model
    if not isinstance(model, LFT):
        raise InputError(
            f"expected an LPVStateSpace or an LFT, got {type(model).__name__}; make one with"
            " LPVStateSpace.polynomial(...) or LinearFamily.interpolate()"
        )
    try:
        return model.to_lpv()
    except InputError as error:
        raise InputError(
            "the LFT depends on its parameters as a rational function, not a polynomial; use"
            " lft_gain, or fit a polynomial: to_lpv(degree=...)"
        ) from error


def _check_channels(model: Pieces, kind: Kind) -> None:
    nx, nu, ny = model.sizes
    if nx == 0:
        raise InputError("the model has no states; its gain is the largest norm of D(p)")
    if kind.endswith("gain") and not (nu and ny):
        raise InputError(
            f"a gain needs inputs and outputs, got {nu} and {ny}; use stability() without channels"
        )
    if kind == "energy-to-peak gain" and model.passes_peaks:
        raise InputError(
            "the energy-to-peak gain of a continuous model needs D = 0: feedthrough passes peaks of"
            " any height"
        )


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


def _alone(p: Array) -> Array:
    return p[:, 0] if p.shape[1] == 1 else p
