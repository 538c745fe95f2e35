"""The L2 gain by the adjoint of a model, where the inverse of P(p) is simple and P(p) is not."""

from __future__ import annotations

from typing import Any

from synthesis.certify.questions.problem import BoundProblem, pose
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.kind import L2_GAIN
from synthesis.numerics.program.cone_program import LYAPUNOV

ADJOINT = (
    "proven of the adjoint of the model, A(p)', C(p)', B(p)', D(p)': over all motions of p within"
    " its range and rates, which are the same backwards, its gain is that of the model"
)
FAR_ABOVE = 1.5
"""Ratio of a proven gain to the worst frozen one beyond which the adjoint is analysed too."""


def adjoint_options(parameters: int) -> dict[str, Any]:
    """Return the options of `l2_gain` for the adjoint of a model of so many moving parameters."""
    return (
        {"form": Spline(degree=2, segments=(1, 4)), "solver": LYAPUNOV} if parameters == 1 else {}
    )


def backwards(problem: BoundProblem) -> BoundProblem | None:
    """Return the problem of the adjoint; None where it proves the same or nothing: for options that
    the user chose, other bounds than a gain, P that cannot move, a set of models, and where the
    rate of a parameter is another one.
    """
    demand, source = problem.demand, problem.model.source
    moving = any(0 < rate < float("inf") for rate in demand.rates)
    apt = problem.usual and demand.kind == L2_GAIN and moving and problem.uncertain is None
    if not apt or demand.motion.tied:
        return None
    options = adjoint_options(len(source.parameters))
    turned = (source.adjoint(), demand.rates, demand.kind)
    return pose(
        *turned, options.get("form"), None, options.get("solver"), problem.search, problem.effort
    )
