"""Output strict passivity: how much of y'u is left after rho |y|^2."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.threads import with_one_thread
from synthesis.certify.lower_bounds.lower_bound import THOROUGH, LowerBoundSearch
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.certify import certify
from synthesis.certify.questions.problem import Model, pose
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Imposed
from synthesis.certify.statement.kind import Kind, Supply
from synthesis.certify.statement.rates import Rate
from synthesis.numerics.program.cone_program import Solver


def kind() -> Kind:
    """The kind "output strictness": dV/dt < 2 y'u - 2 rho |y|^2."""
    return Kind(
        "output strictness",
        sense=-1,
        fields=("index", "index_limit"),
        unit="u per y",
        meaning="the integral of y'u is at least rho times that of |y|^2, from rest, rho the index",
        supply=lambda number, _: Supply(0, number(1.0), 0),
        rise=Supply(1, 0, 0),
        level=lambda rho: -(rho + rho),
        bound=lambda g: -g / 2,
        powers=(1.0, -1.0),
    )


@with_one_thread
def output_strictness(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify the largest rho found with int y'u dt >= rho int |y|^2 dt from rest, for every p(t)
    within its range and rates; with rho > 0 the L2 gain is at most 1/rho.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model, with as many outputs as inputs: y'u pairs them in order.
    rate, impose, solver, search
        As of `l2_gain`.
    form : Spline, optional
        The form of the Lyapunov function.

    Returns
    -------
    Certificate
        `index` is proven, in units of u per unit of y; no proof exceeds `index_limit`.

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`; for another number of outputs than inputs, and without feedthrough.

    See Also
    --------
    synthesis.analysis.passivity_index : what is left after nu |u|^2

    References
    ----------
    Willems, "Dissipative dynamical systems", Archive for Rational Mechanics and Analysis 45 (1972).

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> from synthesis.analysis import output_strictness
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.25]]], p)
    >>> cert = output_strictness(lag, search=None)  # the worst is 1/G(0) = 0.8, at p = 0
    >>> print(f"{cert.index:.3f}", cert.verify(rigorous=True))
    0.800 True
    """
    problem = pose(model, rate, kind(), form, impose, solver, search)
    ends = np.array([(s.low, s.middle, s.high) for s in problem.model.parameters]).T
    D = problem.model.at(ends).D
    if np.linalg.eigvalsh(D + np.swapaxes(D, 1, 2)).min() <= 0:
        raise InputError(
            "output strictness: expected feedthrough with D + D' > 0, since no strict inequality"
            " holds at high frequencies without it; add a small one, or ask for passivity_index"
        )
    return certify(problem)
