"""Certified energy-to-peak gain (generalised H2 norm) of an LPV model."""

from __future__ import annotations

from symheli.threads import with_one_thread
from synthesis.analysis.certify import certify
from synthesis.analysis.question import Model, question
from synthesis.certificate import Certificate
from synthesis.forms import Spline
from synthesis.impose import Imposed
from synthesis.program.cone_program import Solver
from synthesis.worst.lower_bound import THOROUGH, Search
from synthesis.worst.rates import Rate


@with_one_thread
def generalized_h2(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: Search | None = THOROUGH,
) -> Certificate:
    """Certify an upper bound on max_t |y(t)| / |u|_2, from rest, over every admissible p(t).

    A gust of known energy then moves the outputs by at most gamma times its root.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model, without feedthrough in continuous time.
    rate : float, sequence or mapping, optional
        Largest |dp/dt| in units of p per second: one for all parameters, one each, or by name; by
        default the model's own. math.inf: p may jump, and P is constant; 0: every frozen model.
    form : Spline, optional
        The form of the Lyapunov function.
    impose : Bernstein, SumOfSquares, Vertices or Grid, optional
        How the inequalities are imposed for every p; Bernstein coefficients by default.
    solver : Solver or str, optional
        Which solver, and when it stops; by default Clarabel.
    search : Search or None
        How hard to look for bad trajectories; with None the
        worst frozen gain is the lower bound.

    Returns
    -------
    Certificate
        `gamma` bounds the gain, in units of y per unit of u and root second (root sample).

    Raises
    ------
    InputError
        For an option that has no meaning here, with what to do.
    SolverError
        For a solver that is not installed.

    References
    ----------
    Rotea, "The generalized H2 control problem", Automatica 29 (1993).

    Examples
    --------
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = generalized_h2(lag, search=None)  # exactly sqrt(1/2)
    >>> print(f"{cert.gamma:.3f}")
    0.707
    """
    return certify(question(model, rate, "energy-to-peak gain", form, impose, solver, search))
