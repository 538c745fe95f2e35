"""The problems of one LPV model whose parameters move at bounded rates: L2 gain, stability, decay
rate, energy-to-peak gain (generalised H2 norm) and H2 norm.
"""

from __future__ import annotations

from symheli.lpv.bases import FunctionSpace
from symheli.threads import with_one_thread
from synthesis.certify.lower_bounds.lower_bound import THOROUGH, LowerBoundSearch
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.certify import certify
from synthesis.certify.questions.on_grid import gain_on_grid
from synthesis.certify.questions.problem import Model, pose
from synthesis.certify.statement.forms import LyapunovForm, Spline
from synthesis.certify.statement.impose import Imposed
from synthesis.certify.statement.rates import Rate
from synthesis.numerics.program.cone_program import Solver
from synthesis.numerics.program.effort import Effort

EFFORT = 30.0
"""Usual effort of a gain, s of one common core."""


@with_one_thread
def l2_gain(
    model: Model,
    rate: Rate = None,
    *,
    form: LyapunovForm | FunctionSpace | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
    effort: float | Effort = EFFORT,
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
    form : Spline, LaggedParameter, HigherOrder or FunctionSpace, optional
        The form of the Lyapunov function. Functions of one's own, a `FunctionSpace`, are for
        `impose=Grid(n)` in continuous time, where nothing is proven.
    impose : Bernstein, SumOfSquares, Vertices or Grid, optional
        How the inequalities are imposed for every p; Bernstein coefficients by default.
    solver : Solver or str, optional
        Which solver, and when it stops; by default Clarabel, for a `Spline` in one parameter and
        more than 9 states this package's own, "LYAPUNOV".
    search : LowerBoundSearch or None
        How hard to look for bad trajectories; with None the
        worst frozen gain is the lower bound.
    effort : float or Effort
        Work of the programs over several parameters, counted in seconds of one common core. Once
        a bound is proven, no program begins that exceeds it; the certificate names what was left
        untried and the effort that tries it. math.inf: everything is tried. With
        `synthesis.numerics.program.effort.Effort(30, enough=2)` only a bound of at most 2 ends it.

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

    See Also
    --------
    synthesis.lower_bound : the worst trajectory of p found
    synthesis.analysis.gain_against_rate : the gain over permitted rates
    synthesis.lft_gain : gains for parameters that may jump

    References
    ----------
    Wu, Yang, Packard and Becker, "Induced L2-norm control for LPV systems with bounded parameter
    variation rates", Int. J. Robust and Nonlinear Control 6 (1996), theorem 3.1.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = l2_gain(lag, search=None)
    >>> print(f"{cert.frozen:.3f} <= gain <= {cert.gamma:.3f}")
    1.000 <= gain <= 1.000
    """
    if isinstance(form, FunctionSpace):
        return gain_on_grid(model, rate, form, impose)
    work = Effort.of(effort)
    return certify(pose(model, rate, "l2 gain", form, impose, solver, search, work))


@with_one_thread
def stability(
    model: Model,
    rate: Rate = None,
    *,
    form: LyapunovForm | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify that the free state decays for every p(t) within its range and rates.

    As `l2_gain`, without channels. Where no proof is found, a trajectory is looked for along which
    the state grows.

    Parameters
    ----------
    model : LPVStateSpace, UncertainStateSpace or LFT
        The model. An uncertain one is stable where every model of the set is, with its perturbation
        constant or moving.
    rate, form, impose, solver, search
        As of `l2_gain`; with `search` None no growing trajectory is looked for.

    Returns
    -------
    Certificate
        `verified` is the answer; `gamma`, `lower` and `frozen` are NaN.

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`.

    See Also
    --------
    synthesis.decay_rate : how fast the free state decays
    synthesis.analysis.lft_stability : stability of an LFT

    References
    ----------
    Boyd, El Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and Control
    Theory" (1994), section 5.1.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> stability(lag).verified
    True
    """
    return certify(pose(model, rate, "stability", form, impose, solver, search))


@with_one_thread
def decay_rate(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify a decay rate: the largest alpha found such that |x(t)| <= c exp(-alpha t) |x(0)| for
    every admissible p(t).

    Found by bisection, to 0.2 % of `upper` where P admits that.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model.
    rate, impose, solver, search
        As of `l2_gain`; with `search` None the slowest frozen mode is the upper bound.
    form : Spline, optional
        The form of the Lyapunov function.

    Returns
    -------
    Certificate
        `alpha` (1/s) is proven; no proof can exceed `upper`: the slowest frozen mode, or growth
        along a trajectory. Where the state grows, `alpha` < 0 is a bound of growth, computed.

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`.

    See Also
    --------
    synthesis.stability : whether the free state decays
    synthesis.l2_gain : worst-case gain while p moves

    References
    ----------
    Boyd, El Ghaoui, Feron and Balakrishnan, "Linear Matrix Inequalities in System and Control
    Theory" (1994), section 5.1.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = decay_rate(lag, search=None)
    >>> 0.997 < cert.alpha <= cert.upper <= 1.0
    True
    """
    return certify(pose(model, rate, "decay rate", form, impose, solver, search))


@with_one_thread
def energy_to_peak(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify an upper bound on max_t |y(t)| / |u|_2, from rest, over every admissible p(t).

    A gust of known energy then moves the outputs by at most gamma times its root.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model, without feedthrough in continuous time.
    rate, impose, solver, search
        As of `l2_gain`.
    form : Spline, optional
        The form of the Lyapunov function.

    Returns
    -------
    Certificate
        `gamma` bounds the gain, in units of y per unit of u and root second (root sample).

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`.

    References
    ----------
    Rotea, "The generalized H2 control problem", Automatica 29 (1993).

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = energy_to_peak(lag, search=None)  # exactly sqrt(1/2)
    >>> print(f"{cert.gamma:.3f}")
    0.707
    """
    return certify(pose(model, rate, "energy-to-peak gain", form, impose, solver, search))


@with_one_thread
def h2_gain(
    model: Model,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify an upper bound on the root of the variance of the outputs in white noise, over every
    admissible p(t): of a frozen model the H2 norm.

    P(p)^-1 bounds the variance of the state, from zero at the start; gamma^2 that of all outputs
    together at every time, and so their mean power. Of one output it is `energy_to_peak`.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model, without feedthrough in continuous time.
    rate, impose, solver, search
        As of `l2_gain`.
    form : Spline, optional
        The form of the Lyapunov function.

    Returns
    -------
    Certificate
        `gamma` bounds the root of E|y|^2, in units of y, for white noise of unit intensity
        (sampled: of unit variance) at each input, independent of the others.

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`.

    See Also
    --------
    synthesis.l2_gain : worst-case gain while p moves
    synthesis.analysis.energy_to_peak : peaks by the energy of the input

    References
    ----------
    Wu, "Control of Linear Parameter Varying Systems", Ph.D. thesis, Berkeley (1995): the stochastic
    LPV bound, `lpvnorm(P, 'LQG')` of LPVTools.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial(
    ...     [[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0], [1.0]]], [[[0.0], [0.0]]], p)
    >>> cert = h2_gain(lag, search=None)  # two outputs of variance 1/2 each at p = 0
    >>> print(f"{cert.gamma:.3f}")
    1.000
    """
    return certify(pose(model, rate, "h2 gain", form, impose, solver, search))
