"""The analysis problem: a model, the kind of bound and the options, checked for consistency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from symheli import LFT, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from synthesis.certify.lower_bounds.lower_bound import LowerBoundSearch
from synthesis.certify.statement.demand import Demand
from synthesis.certify.statement.forms import HigherOrder, LaggedParameter, LyapunovForm, Spline
from synthesis.certify.statement.impose import Bernstein, Grid, Imposed, SumOfSquares, Vertices
from synthesis.certify.statement.kind import L2_GAIN, STABILITY, Kind
from synthesis.certify.statement.rates import Rate, limits
from synthesis.numerics.polynomial.motion import Motion
from synthesis.numerics.polynomial.pieces import Pieces, pieces
from synthesis.numerics.program.cone_program import LYAPUNOV, Solver, general_solver
from synthesis.numerics.program.effort import Effort
from synthesis.numerics.program.lyapunov_program import MAX_STATES_GENERAL

Model = LPVStateSpace | LFT | UncertainStateSpace


class BoundProblem(NamedTuple):
    """A model in polynomial pieces, the kind of bound and the options; `uncertain`: the set of
    models for which the bound must hold, with `model` as its nominal one; `usual`: whether form,
    impose and solver were left out; `general`: whether the general search is asked for; `effort`:
    the work of all its searches together.
    """

    model: Pieces
    demand: Demand
    form: LyapunovForm
    impose: Imposed
    solver: Solver
    search: LowerBoundSearch | None
    effort: Effort
    uncertain: UncertainStateSpace | None = None
    usual: bool = False
    general: bool = False

    @property
    def one_parameter(self) -> bool:
        """Whether the fast search for one parameter applies: gain and stability by plain Bernstein
        coefficients.
        """
        return (
            len(self.model.parameters) == 1
            and self.demand.kind in (L2_GAIN, STABILITY)
            and isinstance(self.impose, Bernstein)
            and self.impose.subdivision == 0
            and not (isinstance(self.form, Spline) and self.form.total_degree is not None)
            and not self.general
        )

    @property
    def jumps(self) -> bool:
        """Whether the fast search kept P constant since p may jump between samples; the general one
        has P(p) before and P(p+) after.
        """
        return (
            self.one_parameter
            and self.model.dt is not None
            and math.isinf(self.demand.rates[0])
            and self.uncertain is None
            and isinstance(self.form, Spline)
        )

    @property
    def by_points(self) -> bool:
        """Whether a gain over several parameters is computed from inequalities at single p, as
        products with P.
        """
        return self.points_serve and self.solver.name == LYAPUNOV

    @property
    def points_serve(self) -> bool:
        """Whether such a program is possible."""
        return (
            len(self.model.parameters) > 1
            and self.demand.kind == L2_GAIN
            and self.model.dt is None
            and isinstance(self.impose, Bernstein)
            and self.impose.elevation == self.impose.subdivision == 0
            and isinstance(self.form, Spline)
            and self.form.total_degree is None
        )

    @property
    def gains(self) -> bool:
        """Whether the bound is a gain or another level of a supply rate, minimised with margins."""
        return self.demand.kind.driven


def pose(
    model: Model,
    rate: Rate,
    kind: str,
    form: LyapunovForm | None,
    impose: Imposed | None,
    solver: Solver | str | None,
    search: LowerBoundSearch | None,
    effort: Effort | None = None,
) -> BoundProblem:
    """Check the options against one another and against the model, and return the problem.

    Raises `InputError` for an option that has no meaning for the problem.
    """
    usual = form is None and impose is None and solver is None
    form, impose = form or Spline(), impose or Bernstein()
    if not isinstance(form, Spline | LaggedParameter | HigherOrder):
        raise InputError(f"form must be a Spline, LaggedParameter or HigherOrder, got {form!r:.60}")
    if not isinstance(impose, Bernstein | SumOfSquares | Vertices | Grid):
        raise InputError(
            f"impose must be Bernstein, SumOfSquares, Vertices or Grid, got {impose!r:.60}"
        )
    if search is not None and not isinstance(search, LowerBoundSearch):
        raise InputError(f"search must be a LowerBoundSearch or None, got {search!r:.60}")
    uncertain = model if isinstance(model, UncertainStateSpace) else None
    model = _accepted(model)
    moving = limits(model.parameters, rate)
    motion = Motion.of(moving)
    if motion.tied:  # the model itself says so, and its proof
        model = model.with_scheduling(moving)
        _check_rest(motion, moving)
    elif any(isinstance(s.rate, str) for s in model.parameters):
        model = model.with_scheduling(moving)
    if uncertain is not None:
        uncertain = uncertain.with_scheduling(model.parameters)
    demand, usually = Demand(Kind.named(kind), motion), Solver("CLARABEL")
    work = Effort() if effort is None else effort
    problem = BoundProblem(pieces(model), demand, form, impose, usually, search, work)
    problem = problem._replace(uncertain=uncertain, usual=usual)
    _check_channels(problem)
    _check_options(problem)
    _check_block(problem)
    return problem._replace(solver=_solver(problem, solver))


def _solver(problem: BoundProblem, solver: Solver | str | None) -> Solver:
    by_products = (
        problem.one_parameter and isinstance(problem.form, Spline)
    ) or problem.points_serve
    if solver is None:
        return Solver(
            LYAPUNOV if by_products and problem.model.sizes[0] > MAX_STATES_GENERAL else "CLARABEL"
        )
    if by_products:
        return solver if isinstance(solver, Solver) else Solver(solver)
    return general_solver(solver)


def _accepted(model: Model) -> LPVStateSpace:
    if isinstance(model, LPVStateSpace):
        return model
    if isinstance(model, UncertainStateSpace):
        return model.nominal
    if not isinstance(model, LFT):
        raise InputError(
            "expected an LPVStateSpace, an UncertainStateSpace or an LFT, got"
            f" {type(model).__name__}; make one with LPVStateSpace.polynomial(...) or"
            " LinearFamily.interpolate()"
        )
    try:
        return model.to_lpv()
    except InputError as error:
        raise InputError(
            "the LFT depends on its parameters as a rational function, not a polynomial; use"
            " synthesis.robust.rational_gain, lft_gain where p may jump, or fit a polynomial:"
            " to_lpv(degree=...)"
        ) from error


def _check_rest(motion: Motion, moving: Sequence[Scheduling]) -> None:
    for i, j in motion.tied:
        s, r = moving[i], moving[j]
        if not r.low <= 0.0 <= r.high:
            raise InputError(
                f"{r.name} is the rate of {s.name}, which leaves its range where that cannot be 0:"
                f" expected a range with 0 inside, got [{r.low:g}, {r.high:g}]"
            )


def _check_channels(problem: BoundProblem) -> None:
    nx, nu, ny = problem.model.sizes
    if nx == 0:
        raise InputError("the model has no states; its gain is the largest norm of D(p)")
    if problem.gains and not (nu and ny):
        raise InputError(
            f"a gain needs inputs and outputs, got {nu} and {ny}; use stability() without channels"
        )
    if problem.demand.kind.indexed and nu != ny:
        raise InputError(
            f"{problem.demand.kind}: expected as many outputs as inputs, y'u must have a meaning;"
            f" got {ny} and {nu}; model.select(inputs=[...], outputs=[...]) takes pairs"
        )
    if problem.demand.of_gramian and problem.model.passes_peaks:
        raise InputError(
            f"the {problem.demand.kind} of a continuous model needs D = 0: feedthrough passes peaks"
            " of any height and white noise of any variance"
        )


def _check_block(problem: BoundProblem) -> None:
    if problem.uncertain is None:
        return
    if not problem.one_parameter or not isinstance(problem.form, Spline):
        raise InputError(
            "an UncertainStateSpace is for l2_gain and stability of one scheduling parameter with"
            " form=Spline(...) by plain Bernstein coefficients; for anything else take models of"
            " the set, .nominal or .draws(...)"
        )


def _check_options(problem: BoundProblem) -> None:
    form, kind, dt = problem.form, problem.demand.kind, problem.model.dt
    if not isinstance(form, Spline):
        name = type(form).__name__
        if kind not in (L2_GAIN, STABILITY) or not problem.one_parameter:
            raise InputError(
                f"{name} is a form for l2_gain and stability of an LPVStateSpace in one parameter"
                " by plain Bernstein coefficients; take form=Spline(...) here"
            )
        if dt is not None:
            raise InputError(
                f"{name} is for continuous time; this model is sampled every {dt:g} s: leave it"
                " out, or analyse the model before discretize(), as one in continuous time"
            )
        if problem.gains and isinstance(form, HigherOrder):
            raise InputError(
                "HigherOrder proves stability only: a V of that degree does not balance energies;"
                " for a gain use LaggedParameter"
            )
    if kind == STABILITY and form.accept is not None:
        raise InputError("accept compares bounds, and stability has none: leave it out")
    if not problem.gains and (problem.impose.margins, problem.impose.floor) != (None, None):
        raise InputError(
            f"margins and floor are for gains; for the {kind} the margin itself is maximised:"
            " leave them out"
        )
