"""Proof that an LPV model decays while its parameters move at bounded rates."""

from __future__ import annotations

from symheli.threads import with_one_thread
from synthesis.analysis.certify import certify
from synthesis.analysis.question import Model, question
from synthesis.certificate import Certificate
from synthesis.forms import LyapunovForm
from synthesis.impose import Imposed
from synthesis.program.cone_program import Solver
from synthesis.worst.lower_bound import THOROUGH, Search
from synthesis.worst.rates import Rate


@with_one_thread
def stability(
    model: Model,
    rate: Rate = None,
    *,
    form: LyapunovForm | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: Search | None = THOROUGH,
) -> Certificate:
    """Certify that the free state decays for every p(t) within its range and rates.

    As `l2_gain`, without channels. Where no proof is found, a trajectory is looked for along which
    the state grows.

    Parameters
    ----------
    model : LPVStateSpace, UncertainStateSpace or LFT
        The model. An uncertain one is stable where every model of the set is, with its perturbation
        constant or moving.
    rate : float, sequence or mapping, optional
        Largest |dp/dt| in units of p per second: one for all parameters, one each, or by name; by
        default the model's own. math.inf: p may jump, and P is constant; 0: every frozen model.
    form : Spline, Memory or HigherOrder, optional
        The form of the Lyapunov function.
    impose : Bernstein, SumOfSquares, Vertices or Grid, optional
        How the inequalities are imposed for every p; Bernstein coefficients by default.
    solver : Solver or str, optional
        Which solver, and when it stops; by default Clarabel, for a `Spline` in one parameter and
        more than 9 states this package's own, "LYAPUNOV".
    search : Search or None
        How hard to look for bad trajectories; None: not at all.

    Returns
    -------
    Certificate
        `verified` is the answer; `gamma`, `lower` and `frozen` are NaN.

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
    >>> stability(lag).verified
    True
    """
    return certify(question(model, rate, "stability", form, impose, solver, search))
