"""Second searches where the first found nothing, or a bound far above the frozen one."""

from __future__ import annotations

import math
from dataclasses import replace

from synthesis.certify.questions.problem import BoundProblem
from synthesis.certify.statement.impose import Bernstein, SumOfSquares, Vertices
from synthesis.numerics.program.cone_program import LYAPUNOV, Solver
from synthesis.numerics.program.lyapunov_program import MANY_STATES, MAX_STATES_GENERAL

ABOVE_FROZEN = 1.05
"""Ratio of a proven gain to the worst frozen one beyond which P of a higher degree is tried."""
DEGREE = 4
"""Degree of that P in each parameter."""
MAX_ROWS = 6
"""Number of states and inputs up to which sums of squares in two parameters take seconds."""


def finer(problem: BoundProblem) -> BoundProblem | None:
    """Return the same problem with P of degree `DEGREE`: by sums of squares where they are small,
    else by points; None for options that the user chose, many states, one parameter, other bounds
    than a gain, in discrete time, and where p may jump.
    """
    states, inputs, _ = problem.model.sizes
    moving = any(math.isfinite(rate) for rate in problem.demand.rates)
    apt = problem.usual and problem.points_serve and moving and states <= MAX_STATES_GENERAL
    if not apt:
        return None
    form = replace(problem.form, degree=DEGREE)
    if states + inputs <= MAX_ROWS and len(problem.model.parameters) == 2:
        return problem._replace(form=form, impose=SumOfSquares())
    return problem._replace(form=form, solver=Solver(LYAPUNOV))


def over_jumps(problem: BoundProblem) -> BoundProblem | None:
    """Return the problem of a sampled model with P(p) on both sides of a jump of p, as the general
    search has it; None where p does not jump, that was asked already, or it is left out.
    """
    return problem._replace(general=True) if problem.jumps and not jumps_left_out(problem) else None


def jumps_left_out(problem: BoundProblem) -> bool:
    """Whether P(p) on both sides of a jump is left out: for a gain of many states its programs take
    minutes to hours.
    """
    return problem.jumps and problem.gains and problem.model.sizes[0] > MANY_STATES


def by_coefficients(problem: BoundProblem) -> BoundProblem | None:
    """Return the problem of `Vertices` with one inequality per Bernstein coefficient, which asks
    for no convexity; None for other relaxations.
    """
    if not isinstance(problem.impose, Vertices):
        return None
    given = problem.impose
    return problem._replace(
        impose=Bernstein(margins=given.margins, floor=given.floor), general=True
    )
