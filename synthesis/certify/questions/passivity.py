"""Input strict passivity: how much of y'u is left after nu |u|^2."""

from __future__ import annotations

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
    """The kind "passivity index": dV/dt < 2 y'u - 2 nu |u|^2."""
    return Kind(
        "passivity index",
        sense=-1,
        fields=("index", "index_limit"),
        unit="y per u",
        meaning="the integral of y'u is at least nu times that of |u|^2, from rest, nu the index",
        supply=lambda number, _: Supply(0, number(1.0), 0),
        level=lambda nu: -(nu + nu),
        bound=lambda g: -g / 2,
        powers=(1.0, 1.0),
    )


@with_one_thread
def passivity_index(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify the largest nu found with int y'u dt >= nu int |u|^2 dt from rest, for every p(t)
    within its range and rates; nu >= 0 is passivity.

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
        `index` is proven, in units of y per unit of u; no proof exceeds `index_limit`.

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`; for another number of outputs than inputs.

    See Also
    --------
    synthesis.analysis.output_strictness : what is left after rho |y|^2

    References
    ----------
    Willems, "Dissipative dynamical systems", Archive for Rational Mechanics and Analysis 45 (1972).

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> from synthesis.analysis import passivity_index
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.3]]], p)
    >>> cert = passivity_index(lag, search=None)
    >>> print(f"{cert.index:.3f}", cert.verify(rigorous=True))
    0.300 True
    """
    return certify(pose(model, rate, kind(), form, impose, solver, search))
