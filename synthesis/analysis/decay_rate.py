"""Certified decay rate of an LPV model."""

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
def decay_rate(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: Search | None = THOROUGH,
) -> Certificate:
    """Certify a decay rate: the largest alpha found such that |x(t)| <= c exp(-alpha t) |x(0)| for
    every admissible p(t).

    Found by bisection, to 0.2 % of `upper` where P admits that.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model.
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
        slowest frozen mode is the upper bound.

    Returns
    -------
    Certificate
        `alpha` (1/s) is proven; no proof can exceed `upper`: the slowest frozen mode, or growth
        along a trajectory.

    Raises
    ------
    InputError
        For an option that has no meaning here, with what to do.
    SolverError
        For a solver that is not installed.

    References
    ----------
    Boyd, El Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and Control
    Theory" (1994), section 5.1.

    Examples
    --------
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = decay_rate(lag, search=None)
    >>> 0.997 < cert.alpha <= cert.upper <= 1.0
    True
    """
    return certify(question(model, rate, "decay rate", form, impose, solver, search))
