"""The forms of V that a proof can take: what is unknown in each, its LMI blocks, and the V they
lead to.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.lpv import LPVStateSpace
from synthesis.assemble.bounded_real import Blocks, continuous_blocks, discrete_blocks
from synthesis.assemble.memory_blocks import memory_blocks
from synthesis.lyapunov.lag import LagRegion
from synthesis.lyapunov.spline import Lyapunov, MemoryLyapunov, SplineLyapunov, graded_knots
from synthesis.polynomial.cells import cells, strips
from synthesis.polynomial.pieces import ModelPiece, model_pieces
from synthesis.polynomial.symmetric import extended, length, smat, svec
from synthesis.polynomial.symmetric_power import generator, monomials, null_matrix, null_size
from synthesis.program.scaling import Scaling, scaling
from synthesis.proof.one_parameter import Evidence

Array = np.ndarray

KINDS = ("bernstein", "sos", "vertices", "grid")


@dataclass(frozen=True)
class Relaxation:
    """The form of P(p) and of the LMIs.

    `kind` is how an LMI is imposed for every p: "bernstein", "sos" (sums of squares), "vertices" or
    "grid" (proves nothing); docs/relaxations.md says what each promises.

    P is a continuous spline of `degree` (None: 3 in continuous, 2 in discrete time) on K segments,
    K from `segments` (None: 16, 32 in continuous, 8, 16 in discrete time) in turn until the bound
    is proven and gamma <= `accept` times the lower bound. Knots low + (high - low)(k/K)^`grading`.
    A constant P has no knots, but its LMIs are cut there (None: 8). `elevation` raises the
    Bernstein degree of the LMIs, or that of the sums of squares; `subdivision` halves every range
    that often before the Bernstein coefficients are taken; `points` a parameter in every region for
    the grid. Several parameters: degree None is 2 in continuous and 1 in discrete time, segments
    (1,), `total_degree` limits the sum of the degrees. `margins`: state blocks are held below
    -margin I in scaled coordinates, tried in turn. `floor`: P >= floor I.

    `order` m > 1: V of degree 2m in the states, for `stability` in continuous time; costs grow with
    the sixth power of the number of monomials of degree m. `memory`: V = x' P(p, p - q) x with q
    the lag of p of so many seconds (about the time in which the worst p turns round), in continuous
    time; across, P has `memory_degree` on `memory_segments` segments. Either way P has the degree
    and segments above in p (None: 2 on 4, then 8 with an order; 3 on 12 with a memory).
    """

    degree: int | None = None
    segments: tuple[int, ...] | None = None
    grading: float = 2.0
    elevation: int = 0
    margins: tuple[float, ...] = (1e-6, 1e-4)
    floor: float = 1e-6
    accept: float = 2.0
    order: int = 1
    memory: float | None = None
    memory_segments: int = 3
    memory_degree: int = 2
    kind: Literal["bernstein", "sos", "vertices", "grid"] = "bernstein"
    subdivision: int = 0
    points: int = 11
    total_degree: int | None = None

    def __post_init__(self) -> None:
        if self.degree is not None and self.degree not in (0, 1, 2, 3, 4):
            raise InputError(f"degree of P must be 0 .. 4, got {self.degree}")
        if self.segments is not None and (not self.segments or min(self.segments) < 1):
            raise InputError(f"segments must be a tuple of integers >= 1, got {self.segments}")
        if (
            self.grading < 1
            or self.elevation < 0
            or self.floor < 0
            or not self.margins
            or min(self.margins) < 0
            or self.accept < 1
        ):
            raise InputError(
                "expected grading >= 1, elevation >= 0, floor >= 0, margins >= 0 and accept >= 1"
            )
        if self.order not in (1, 2, 3) or (self.order > 1 and self.memory is not None):
            raise InputError(
                f"expected order 1, 2 or 3, and no memory beside an order > 1, got {self.order} and"
                f" memory {self.memory}"
            )
        if self.memory is not None and not (
            self.memory > 0 and self.memory_segments >= 1 and self.memory_degree in (1, 2, 3, 4)
        ):
            raise InputError("expected memory > 0 s, memory_segments >= 1 and memory_degree 1 .. 4")
        if self.kind not in KINDS:
            raise UnknownNameError("relaxation", self.kind, KINDS)
        if (
            self.subdivision < 0
            or self.points < 2
            or (self.total_degree is not None and self.total_degree < 0)
        ):
            raise InputError("expected subdivision >= 0, points >= 2 and total_degree >= 0 or None")
        if self.needs_box and (self.order > 1 or self.memory is not None):
            raise InputError(
                "order and memory go with plain Bernstein coefficients: leave kind, subdivision and"
                " total_degree alone"
            )

    @property
    def needs_box(self) -> bool:
        """Whether this is more than plain Bernstein coefficients for one parameter: see
        `synthesis.polynomial`.
        """
        return self.kind != "bernstein" or self.subdivision > 0 or self.total_degree is not None

    def check(self, dt: float | None, *, with_gain: bool) -> None:
        """Raises `InputError` where the form of V does not suit the question."""
        if dt is not None and (self.order > 1 or self.memory is not None):
            name, value = ("order", self.order) if self.order > 1 else ("memory", self.memory)
            raise InputError(
                "an order > 1 or a memory is for continuous time; this model is sampled every"
                f" {dt:g} s: leave {name}={value} out, or analyse the model before discretize(), as"
                " one in continuous time"
            )
        if with_gain and self.order > 1:
            raise InputError(
                "an order > 1 proves stability only: a V of that degree does not balance energies;"
                " for a gain use a memory"
            )


class Problem(NamedTuple):
    """What every attempt shares: the model in physical and in scaled units."""

    lpv: LPVStateSpace
    rate: float
    pieces: tuple[ModelPiece, ...]
    scaled: tuple[ModelPiece, ...]
    units: Scaling
    with_gain: bool

    @property
    def scaled_rate(self) -> float:
        """Largest change of p per scaled unit of time."""
        return self.rate * self.units.time

    def evidence(self, elevation: int) -> Evidence:
        """What verifies a P for this problem."""
        return Evidence(self.lpv, self.pieces, self.units, self.rate, elevation)

    @property
    def step(self) -> float:
        """Largest change of p in one sample."""
        return self.rate * (self.lpv.dt or 0.0)


def scaled_problem(lpv: LPVStateSpace, rate: float, gain: float, *, with_gain: bool) -> Problem:
    """The model scaled for an expected `gain`; without channels where only stability is asked."""
    if not with_gain:
        lpv = replace(
            lpv,
            B=lpv.B[:, :, :0],
            C=lpv.C[:, :0],
            D=lpv.D[:, :0, :0],
            inputs=(),
            outputs=(),
            trim=None,
            residuals=None,
        )
    units, pieces = scaling(lpv, gain), model_pieces(lpv)
    scaled = tuple(
        piece.scaled(units.left, units.right, units.channel, units.time) for piece in pieces
    )
    return Problem(lpv, rate, pieces, scaled, units, with_gain)


class Form(ABC):
    """A V with unknown coefficients, in the scaled units of a problem: `size` is that of P,
    `degree` that in p on the `knots`.
    """

    knots: Array
    degree: int
    size: int
    null: Array | None = None
    """What may be added to each block, (s, L) as vectors."""

    @property
    @abstractmethod
    def unknowns(self) -> int:
        """Number of coefficients of P."""

    @abstractmethod
    def blocks(self, problem: Problem, extra: int) -> list[Blocks]:
        """The LMIs, their Bernstein degree raised by `extra`."""

    @abstractmethod
    def lyapunov(self, x: Array) -> Lyapunov:
        """V at the solver's point x, in scaled units."""

    def weighed(self, problem: Problem, extra: int) -> list[Blocks]:
        """The same in coordinates in which slow and fast states count alike."""
        W = extended(problem.units.weight, len(problem.lpv.inputs))
        return [block.congruent(W) for block in self.blocks(problem, extra)]

    def coefficients(self, x: Array) -> Array:
        """Coefficients of P (unknowns, size (size + 1)/2) as vectors."""
        return x[: self.unknowns * length(self.size)].reshape(self.unknowns, -1)


@dataclass(frozen=True, eq=False)
class Quadratic(Form):
    """V = x' P(p) x, P a spline."""

    knots: Array
    degree: int
    size: int

    @property
    def unknowns(self) -> int:
        """Number of coefficients of P."""
        return (len(self.knots) - 1) * self.degree + 1

    def blocks(self, problem: Problem, extra: int) -> list[Blocks]:
        """One block per Bernstein coefficient, cell or strip, and sign of the rate."""
        if problem.lpv.dt is None:
            rate = problem.scaled_rate if self.degree else 0.0
            return list(
                continuous_blocks(
                    cells(problem.scaled, self.knots), self.knots, self.degree, rate, extra
                )
            )
        regions = strips(problem.scaled, self.knots, problem.step if self.degree else 0.0)
        return list(discrete_blocks(regions, self.knots, self.degree, extra))

    def lyapunov(self, x: Array) -> SplineLyapunov:
        """V at the solver's point x."""
        return SplineLyapunov(self.knots, self.degree, smat(self.coefficients(x), self.size))


class HigherOrder(Quadratic):
    """V = z' P(p) z with the monomials z of degree `order` in the states: a sum-of-squares proof
    for each coefficient.
    """

    states: int
    order: int

    def __init__(self, knots: Array, degree: int, states: int, order: int):
        super().__init__(knots, degree, len(monomials(states, order)))
        matrices = null_matrix(np.eye(null_size(states, order)), states, order)
        for name, value in {"states": states, "order": order, "null": svec(matrices)}.items():
            object.__setattr__(self, name, value)

    def blocks(self, problem: Problem, extra: int) -> list[Blocks]:
        """As for a quadratic V, of the linear system that the monomials follow."""
        N = self.size
        lifted = tuple(
            q._replace(
                A=generator(q.A, self.order),
                B=np.zeros((1, N, 0)),
                C=np.zeros((1, 0, N)),
                D=np.zeros((1, 0, 0)),
            )
            for q in problem.scaled
        )
        return super().blocks(problem._replace(scaled=lifted), extra)

    def weighed(self, problem: Problem, extra: int) -> list[Blocks]:
        """The blocks as they are: what is added to them is in the coordinates of P."""
        return self.blocks(problem, extra)

    def lyapunov(self, x: Array) -> SplineLyapunov:
        """V at the solver's point x, with the slack of every block."""
        size = null_size(self.states, self.order)
        # of one state there is one monomial, and nothing to add
        slack = x[self.unknowns * length(self.size) : -1].reshape(-1, size) if size else None
        return SplineLyapunov(
            self.knots, self.degree, smat(self.coefficients(x), self.size), self.order, slack
        )


@dataclass(frozen=True, eq=False)
class Remembering(Form):
    """V = x' P(p, p - q) x, q a lag of p; `region` in scaled units of time."""

    region: LagRegion
    degree: int
    lead_knots: Array
    lead_degree: int
    size: int

    @property
    def knots(self) -> Array:  # type: ignore[override]
        """Knots in p."""
        return self.region.knots

    @property
    def _across(self) -> int:
        return (len(self.lead_knots) - 1) * self.lead_degree + 1

    @property
    def unknowns(self) -> int:
        """Number of coefficients of P."""
        return ((len(self.knots) - 1) * self.degree + 1) * self._across

    def blocks(self, problem: Problem, extra: int) -> list[Blocks]:
        """One block per Bernstein coefficient in p and across, patch, and sign of the rate."""
        regions = cells(problem.scaled, self.knots)
        return list(
            memory_blocks(
                regions,
                self.region,
                self.lead_knots,
                self.degree,
                self.lead_degree,
                problem.scaled_rate,
                extra,
            )
        )

    def lyapunov(self, x: Array) -> MemoryLyapunov:
        """V at the solver's point x."""
        P = smat(self.coefficients(x), self.size).reshape(-1, self._across, self.size, self.size)
        return MemoryLyapunov(self.region, self.degree, self.lead_knots, self.lead_degree, P)


def forms(problem: Problem, relaxation: Relaxation) -> Iterator[Form]:
    """The forms to try in turn."""
    n, sampled = len(problem.lpv.states), problem.lpv.dt is not None
    remembers = relaxation.memory is not None and 0 < problem.rate < math.inf
    constant = math.isinf(problem.rate) or relaxation.degree == 0
    usual = 2 if relaxation.order > 1 or sampled else 3
    degree = 0 if constant and not remembers else (relaxation.degree or usual)
    default = (
        (8,)
        if not degree
        else (
            (12,)
            if remembers
            else (4, 8)
            if relaxation.order > 1
            else (8, 16)
            if sampled
            else (16, 32)
        )
    )
    for segments in relaxation.segments or default:
        knots = _knots(problem, relaxation, segments, degree)
        if remembers:
            region = LagRegion.reached(knots, problem.rate, float(relaxation.memory))  # type: ignore[arg-type]
            region = replace(region, time=region.time / problem.units.time)
            across = np.linspace(0.0, 1.0, relaxation.memory_segments + 1)
            yield Remembering(region, degree, across, relaxation.memory_degree, n)
        elif relaxation.order > 1:
            yield HigherOrder(knots, degree, n, relaxation.order)
        else:
            yield Quadratic(knots, degree, n)


def constant_form(problem: Problem, relaxation: Relaxation) -> Form:
    """A constant P, which proves for every rate what it proves for jumps."""
    n, knots = len(problem.lpv.states), _knots(problem, relaxation, 8, 0)
    return (
        HigherOrder(knots, 0, n, relaxation.order)
        if relaxation.order > 1
        else Quadratic(knots, 0, n)
    )


def _knots(problem: Problem, relaxation: Relaxation, segments: int, degree: int) -> Array:
    low, high = problem.pieces[0].low, problem.pieces[-1].high
    breaks = [piece.low for piece in problem.pieces[1:]]
    if degree and 2.5 * problem.step >= high - low:
        return np.array([low, high])
    return graded_knots(
        low,
        high,
        segments,
        relaxation.grading,
        breaks,
        shortest=2.5 * problem.step if degree else 0.0,
    )
