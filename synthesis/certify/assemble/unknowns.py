"""The unknowns of each form of V for one parameter, its LMI blocks, and V at a solution.

This is the fast assembly: arrays, and blocks that join the program as they are violated. The
general one for boxes (`box`) is built on polynomials that know their box, several times slower.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from symheli import LPVStateSpace, UncertainStateSpace
from symheli.lpv.bases.polynomials import lobatto_points
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.assemble.bounded_real import (
    BlockMultipliers,
    Blocks,
    continuous_blocks,
    discrete_blocks,
)
from synthesis.certify.assemble.lyapunov_blocks import (
    at_points,
    continuous_products,
    discrete_products,
)
from synthesis.certify.assemble.memory_blocks import memory_blocks
from synthesis.certify.assemble.rounded import rounded
from synthesis.certify.proof.one_parameter import IntervalEvidence
from synthesis.certify.statement.forms import HigherOrder, LaggedParameter, LyapunovForm, Spline
from synthesis.certify.statement.lag import LagRegion
from synthesis.certify.statement.norm_bounded import NormBounded
from synthesis.certify.statement.opened import open_block
from synthesis.certify.statement.scaling import block_scaling, scaling
from synthesis.certify.statement.spline import (
    Lyapunov,
    MemoryLyapunov,
    SplineLyapunov,
    graded_knots,
)
from synthesis.certify.statement.units import Scaling
from synthesis.numerics.polynomial.cells import Strip, cells, strips
from synthesis.numerics.polynomial.pieces import ModelPiece, model_pieces
from synthesis.numerics.polynomial.symmetric import extended, length, smat, svec
from synthesis.numerics.polynomial.symmetric_power import (
    generator,
    monomials,
    null_matrix,
    null_size,
)
from synthesis.numerics.program.lyapunov_program import MANY_STATES, LyapunovBlocks, Sizes

POINTS = 9
"""Least number of values of p in a segment of P at which a program of few blocks begins."""


class ScaledProblem(NamedTuple):
    """The data common to all attempts: the model in physical units for the proof, in scaled ones
    for the search.
    """

    lpv: LPVStateSpace
    rate: float
    pieces: tuple[ModelPiece, ...]
    scaled: tuple[ModelPiece, ...]
    units: Scaling
    with_gain: bool
    block: NormBounded | None = None

    @property
    def discrete(self) -> bool:
        """Whether time is counted in samples."""
        return self.lpv.dt is not None

    @property
    def scaled_rate(self) -> float:
        """Largest change of p per scaled unit of time."""
        return self.rate * self.units.time

    def evidence(self, elevation: int) -> IntervalEvidence:
        """The checks that verify a P for this problem."""
        return IntervalEvidence(self.lpv, self.pieces, self.units, self.rate, elevation, self.block)

    def sizes(self, form: Unknown) -> Sizes:
        """Return the sizes of the program for a V of this form."""
        d = 0 if self.block is None else self.block.inputs
        return Sizes(form.size, len(self.lpv.inputs) - d, form.unknowns, d, form.multipliers)

    def in_units(self, units: Scaling) -> ScaledProblem:
        """Return the same problem in other units."""
        return self._replace(units=units, scaled=units.of_pieces(self.pieces, self.block))

    def frozen(self, p: float) -> ScaledProblem:
        """Return the problem frozen at p, without a block, in the same units."""
        lpv = LPVStateSpace.constant(self.lpv.at(p), self.lpv.scheduling)
        return self._replace(lpv=lpv, rate=0.0, pieces=model_pieces(lpv)).in_units(self.units)

    @property
    def step(self) -> float:
        """Largest change of p in one sample."""
        return self.rate * (self.lpv.dt or 0.0)


def scaled_problem(
    model: LPVStateSpace | UncertainStateSpace, rate: float, gain: float, *, with_gain: bool
) -> ScaledProblem:
    """Scale the model for an expected `gain`; without channels if the problem is stability."""
    if isinstance(model, UncertainStateSpace):
        lpv, block = open_block(model, channels=with_gain)
        units = block_scaling(lpv, block, gain)
    else:
        lpv, block = model if with_gain else model.select(inputs=(), outputs=()), None
        units = scaling(lpv, gain)
    pieces = model_pieces(lpv)
    searched = units.of_pieces(rounded(lpv, pieces), block)
    return ScaledProblem(lpv, rate, pieces, searched, units, with_gain, block)


class Unknown(ABC):
    """A V with unknown coefficients, in the scaled units of a problem: `size` is that of P,
    `degree` that in p on the `knots`.
    """

    knots: Array
    degree: int
    size: int
    null: Array | None = None
    """Basis of the matrices that may be added to each block, (s, L) as vectors."""
    multipliers: int = 0
    """Number of coefficients of the multiplier of a block."""

    @property
    @abstractmethod
    def unknowns(self) -> int:
        """Number of coefficients of P."""

    @abstractmethod
    def blocks(self, problem: ScaledProblem, extra: int) -> list[Blocks]:
        """The LMIs, their Bernstein degree raised by `extra`."""

    @abstractmethod
    def lyapunov(self, x: Array) -> Lyapunov:
        """V at the solver's point x, in scaled units."""

    def weighed(self, problem: ScaledProblem, extra: int) -> list[Blocks]:
        """Return the same with states of different rates equally weighted."""
        W = extended(problem.units.weight, len(problem.lpv.inputs))
        return [block.congruent(W) for block in self.blocks(problem, extra)]

    def coefficients(self, x: Array) -> Array:
        """Coefficients of P (unknowns, size (size + 1)/2) as vectors."""
        return x[: self.unknowns * length(self.size)].reshape(self.unknowns, -1)

    def multiplier(self, x: Array) -> Array:
        """Return the coefficients of the multiplier (multipliers,), clipped at 0: negative values
        are within the solver's tolerance.
        """
        return np.maximum(x[len(x) - 1 - self.multipliers : -1], 0.0)


@dataclass(frozen=True, eq=False)
class Quadratic(Unknown):
    """V = x' P(p) x, P a spline; around a block with its multipliers `by`, None without."""

    knots: Array
    degree: int
    size: int
    by: BlockMultipliers | None = None

    @property
    def unknowns(self) -> int:
        """Number of coefficients of P."""
        return (len(self.knots) - 1) * self.degree + 1

    @property
    def multipliers(self) -> int:  # type: ignore[override]
        """Number of coefficients of the multipliers."""
        return 0 if self.by is None else sum(self.by.sizes(len(self.knots) - 1))

    def blocks(self, problem: ScaledProblem, extra: int) -> list[Blocks]:
        """One block per Bernstein coefficient, cell or strip, and sign of the rate."""
        if not problem.discrete:
            rate = problem.scaled_rate if self.degree else 0.0
            regions = cells(problem.scaled, self.knots)
            return list(continuous_blocks(regions, self.knots, self.degree, rate, extra, self.by))
        return list(discrete_blocks(self._strips(problem), self.knots, self.degree, extra, self.by))

    def products(self, problem: ScaledProblem, extra: int) -> tuple[LyapunovBlocks, ...]:
        """Return the same blocks as products with P, with states of different rates equally
        weighted.
        """
        if not problem.discrete:
            rate = problem.scaled_rate if self.degree else 0.0
            regions = cells(problem.scaled, self.knots)
            every = continuous_products(regions, self.knots, self.degree, rate, extra, self.by)
        else:
            across = self._strips(problem)
            every = discrete_products(across, self.knots, self.degree, extra, self.by)
        W = extended(problem.units.weight, len(problem.lpv.inputs))
        return tuple(block.congruent(W) for block in every)

    def points(self, problem: ScaledProblem) -> list[Array]:
        """Return single values of p in every segment: `POINTS`, and the breaks of the model."""
        breaks, out = np.array([piece.low for piece in problem.pieces]), []
        for ends in pairwise(self.knots.tolist()):
            inside = breaks[(breaks > ends[0]) & (breaks < ends[1])]
            out.append(np.union1d(lobatto_points(POINTS, (ends,)).ravel(), inside))
        return out

    def at_points(
        self, problem: ScaledProblem, points: Sequence[Array], models: Sequence[Matrices]
    ) -> tuple[LyapunovBlocks, ...]:
        """Return blocks at the points of every segment, where the model, of a sampled one its
        bilinear image, has these matrices.
        """
        pace = 0.5 * problem.step if problem.discrete else problem.scaled_rate
        W = extended(problem.units.weight, len(problem.lpv.inputs))
        return tuple(
            at_points(model, at, self.knots, j, self.degree, pace, self.by).congruent(W)
            for j, (at, model) in enumerate(zip(points, models, strict=True))
        )

    def _strips(self, problem: ScaledProblem) -> tuple[Strip, ...]:
        step = problem.step if self.degree else 0.0
        return strips(problem.scaled, self.knots, (-step, step))

    def lyapunov(self, x: Array) -> SplineLyapunov:
        """V at the solver's point x, with the multiplier."""
        return SplineLyapunov(
            self.knots,
            self.degree,
            smat(self.coefficients(x), self.size),
            multiplier=self._spread(self.multiplier(x)),
        )

    def _spread(self, values: Array) -> Array | None:
        """Return the coefficients (K e + 1,) of the multiplier, or (K e + 1, parts)."""
        if self.by is None:
            return None
        sizes = self.by.sizes(len(self.knots) - 1)
        count = (len(self.knots) - 1) * self.by.degree + 1
        each = np.split(values, np.cumsum(sizes)[:-1])
        whole = np.stack([np.broadcast_to(own, count) for own in each], axis=1)
        return whole if self.by.block.parts else whole[:, 0]


class OfMonomials(Quadratic):
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

    def blocks(self, problem: ScaledProblem, extra: int) -> list[Blocks]:
        """Return the blocks of a quadratic V for the linear system of the monomials."""
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

    def weighed(self, problem: ScaledProblem, extra: int) -> list[Blocks]:
        """Return the blocks unchanged: the added matrices are in the coordinates of P."""
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
class Remembering(Unknown):
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

    def blocks(self, problem: ScaledProblem, extra: int) -> list[Blocks]:
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


def unknowns(problem: ScaledProblem, form: LyapunovForm) -> Iterator[Unknown]:
    """Yield the forms of V to try in turn, finer and finer."""
    n, sampled = len(problem.lpv.states), problem.discrete
    many = isinstance(form, Spline) and n > MANY_STATES
    higher = isinstance(form, HigherOrder)
    remembers = isinstance(form, LaggedParameter) and 0 < problem.rate < math.inf
    (own,) = form.degrees(1)
    constant = math.isinf(problem.rate) or own == 0
    usual_degree = (1 if sampled else 2) if many else (2 if higher or sampled else 3)
    degree = 0 if constant and not remembers else (own or usual_degree)
    if not degree:
        usual = (8,)
    elif remembers:
        usual = (12,)
    else:
        usual = (4, 8) if higher or many else (8, 16) if sampled else (16, 32)
    for (segments,) in form.segments_tried(1) or [[k] for k in usual]:
        knots = _knots(problem, form, segments, degree)
        if isinstance(form, LaggedParameter) and remembers:
            region = LagRegion.reached(knots, problem.rate, float(form.seconds))
            region = replace(region, time=region.time / problem.units.time)
            across = np.linspace(0.0, 1.0, form.across_segments + 1)
            yield Remembering(region, degree, across, form.across_degree, n)
        elif isinstance(form, HigherOrder):
            yield OfMonomials(knots, degree, n, form.order)
        else:
            yield Quadratic(knots, degree, n, _multiplier(problem, degree))


def _multiplier(problem: ScaledProblem, degree: int) -> BlockMultipliers | None:
    """Return the multipliers, of the degree of P, which sets the degree of the LMIs, and at least
    1, because a constant P does not show where the block matters most.
    """
    return None if problem.block is None else BlockMultipliers(problem.block, max(degree, 1))


def constant(problem: ScaledProblem, form: LyapunovForm) -> Unknown:
    """Return the form of a constant P, which proves the same for every rate and for jumps."""
    n, knots = len(problem.lpv.states), _knots(problem, form, 8, 0)
    if isinstance(form, HigherOrder):
        return OfMonomials(knots, 0, n, form.order)
    return Quadratic(knots, 0, n, _multiplier(problem, 0))


def _knots(problem: ScaledProblem, form: LyapunovForm, segments: int, degree: int) -> Array:
    low, high = problem.pieces[0].low, problem.pieces[-1].high
    breaks = [piece.low for piece in problem.pieces[1:]]
    if degree and 2.5 * problem.step >= high - low:
        return np.array([low, high])
    return graded_knots(
        low,
        high,
        segments,
        2.0 if form.grading is None else form.grading,
        breaks,
        shortest=2.5 * problem.step if degree else 0.0,
    )
