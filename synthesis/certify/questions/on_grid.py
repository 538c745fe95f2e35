"""The L2 gain with P in functions of one's own, on a grid: what LPVTools' `lpvnorm(P, Xb)` does."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.function_space import tensor_grid
from symheli.lpv.bases.polynomials import polynomials
from symheli.lpv.tools import Matrices
from symheli.values.arrays import Array
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.hypotheses import hypotheses
from synthesis.certify.questions.problem import Model
from synthesis.certify.statement.impose import Grid, Imposed
from synthesis.certify.statement.kind import L2_GAIN
from synthesis.certify.statement.outcome import Attempt, Seconds, Status
from synthesis.certify.statement.rates import Rate, limits
from synthesis.certify.statement.scaling import dissipative, model_scaling
from synthesis.numerics.linear.norm import norm
from synthesis.numerics.program.affine_program import AffineProgram, BernsteinCell, from_lower
from synthesis.numerics.program.bases import extreme_motions, functions, limited, used
from synthesis.numerics.program.cone_program import Solver, SolverPoint

SOLVER = Solver(tolerance=1e-7)
"""Solver of the program; the tolerance is that of g, the squared gain."""


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
    ends = ((s.low, s.high) for s in moving)
    points = tensor_grid([np.linspace(*pair, impose.points) for pair in ends])
    every = _matrices(model, points)
    gains = [norm(*each, model.dt)[0] for each in zip(*every, strict=True)]
    frozen, found, attempts = max(gains), math.inf, ()
    if math.isfinite(frozen):
        middle = model.at(*(s.middle for s in model.parameters))
        units = model_scaling(middle, frozen or 1.0, every)
        units = dissipative(units, middle, frozen) or units
        answer = _least(units.of_matrices(every), model.dt, points, moving, basis, units.time)
        if answer.x is not None:
            found = units.channel * math.sqrt(max(float(answer.x[-1]), 0.0))
        attempts = (Attempt(f"P in {basis.size} functions", 0.0, answer.message, found),)
    known = Status.UNPROVEN if math.isfinite(found) else Status.INFEASIBLE
    status = known if math.isfinite(frozen) else Status.UNSTABLE
    rates = tuple(math.nan if isinstance(s.rate, str) else s.rate for s in moving)
    hypothesis = f"the inequalities hold at {impose.points} values of each parameter: no guarantee"
    return Certificate(
        kind=L2_GAIN,
        gamma=math.inf,
        lower=frozen,
        frozen=frozen,
        status=status,
        verified=False,
        rates=rates,
        hypotheses=hypotheses(L2_GAIN, moving, rates, model, (hypothesis,)),
        method=f"{type(form).__name__}, {impose.found_by}",
        solver=SOLVER.name,
        seconds=Seconds(solve=time.perf_counter() - start),
        attempts=attempts,
        indicative=found if status is Status.UNPROVEN else math.nan,
    )


def _matrices(model: LPVStateSpace | LFT, p: Array) -> Matrices:
    return Matrices(*model.matrices(p[:, 0] if len(model.parameters) == 1 else p))


@dataclass(frozen=True)
class _Orthonormal(FunctionSpace):
    """Combinations of functions that are orthonormal on samples of the whole range.

    Not on the grid: of few points, combinations that vanish there still have slopes.

    The inequalities do not depend on the choice, but their numbers do: P in 1, p, p^2, 1/p and
    sqrt(p) loses a thousandth of the gain to rounding.
    """

    basis: FunctionSpace

    @cached_property
    def _mixing(self) -> Array:
        values = self.basis(self.basis.samples())
        _, sizes, right = np.linalg.svd(values / math.sqrt(len(values)), full_matrices=False)
        kept = sizes > 1e-12 * sizes[0]
        return right[kept].T / sizes[kept]

    @property
    def size(self) -> int:
        return self._mixing.shape[1]

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        return self.basis.ranges

    @property
    def distinct_values(self) -> int:
        return self.basis.distinct_values

    def samples(self, ranges: Sequence[tuple[float, float]] | None = None) -> Array:
        return self.basis.samples(ranges)

    def _values(self, p: Array, derivative: Any) -> Array:
        return self.basis(p, derivative) @ self._mixing


def _least(
    model: Matrices,
    dt: float | None,
    points: Array,
    moving: Sequence[Scheduling],
    basis: FunctionSpace,
    time: float,
) -> SolverPoint:
    """Minimise g, the last variable, subject to P > 0 and the bounded real lemma at the points.

    `model` (K, ...) in units of time of `time` seconds.
    """
    program = AffineProgram()
    n, inputs = model.B.shape[1:]
    P = program.symmetric(n, _Orthonormal(basis))
    constant = polynomials([0] * len(moving), [(s.low, s.high) for s in moving])
    g = program.variable(np.ones((1, 1, 1)), constant)
    p, level = program.value(P), program.value(g) * np.eye(inputs)
    for k, point in enumerate(points):
        cell = BernsteinCell(point[None], np.eye(1))
        A, B, C, D = (M[k : k + 1] for M in model)
        into, gone = A.mT @ p, B.mT @ p
        program.positive(cell, p)
        for motion in extreme_motions(moving, cell.nodes, used(basis), time):
            if dt is None:
                flow = into + into.mT + program.slope(P)
                cross, supply = gone, program.known(D.mT @ D)
            else:
                flow, cross = into @ A - p, gone @ A
                supply = gone @ B + program.known(D.mT @ D)
            F = from_lower(
                [
                    [flow + program.known(C.mT @ C)],
                    [cross + program.known(D.mT @ C), supply - level],
                ]
            )
            program.positive(cell, -F, motion)
    cost = np.zeros(program.count)
    cost[g.columns] = 1.0
    return program.minimise(cost, SOLVER)
