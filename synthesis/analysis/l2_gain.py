"""Certified L2 gain of an LPV model whose parameters move at bounded rates."""

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
def l2_gain(
    model: Model,
    rate: Rate = None,
    *,
    form: LyapunovForm | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: Search | None = THOROUGH,
) -> Certificate:
    """Certify an upper bound on the L2 gain over every p(t) within its range and rates.

    The bounded real lemma with P(p), imposed between grid points too; the gain is recomputed from P
    alone and verified. Gain and stability of one parameter by plain Bernstein coefficients take a
    route of their own, which is many times faster than the general one.

    Parameters
    ----------
    model : LPVStateSpace, UncertainStateSpace or LFT
        The model. Of an uncertain one the gain is that of every model of the set, with its
        perturbation constant or moving.
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
        How hard to look for bad trajectories; with None the
        worst frozen gain is the lower bound.

    Returns
    -------
    Certificate
        `gamma` bounds the gain, in units of y per unit of u; `lower` is a lower bound, which for
        an uncertain model is attained by the model with `perturbation`. A failed solve is a
        certificate with gamma = inf and its reason in `status`.

    Raises
    ------
    InputError
        For an option that has no meaning here, with what to do.
    SolverError
        For a solver that is not installed.

    References
    ----------
    Wu, Yang, Packard and Becker, "Induced L2-norm control for LPV systems with bounded parameter
    variation rates", Int. J. Robust and Nonlinear Control 6 (1996), theorem 3.1.

    Examples
    --------
    >>> from symheli.lpv import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = l2_gain(lag, search=None)
    >>> print(f"{cert.frozen:.3f} <= gain <= {cert.gamma:.3f}")
    1.000 <= gain <= 1.000
    """
    return certify(question(model, rate, "l2 gain", form, impose, solver, search))
