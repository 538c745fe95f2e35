"""What is asked of a model, checked and complete."""

from __future__ import annotations

from typing import NamedTuple

from symheli.errors import InputError
from symheli.lpv import LFT, LPVStateSpace
from synthesis.certificate import Kind
from synthesis.forms import HigherOrder, LyapunovForm, Memory, Spline
from synthesis.impose import Bernstein, Grid, Imposed, SumOfSquares, Vertices
from synthesis.polynomial.pieces import Pieces, pieces
from synthesis.polynomial.state_space import PolynomialStateSpace
from synthesis.program.cone_program import Solver
from synthesis.proof.drift import Drift
from synthesis.proof.inequalities import Demand
from synthesis.worst.lower_bound import Search
from synthesis.worst.rates import Rate, rates

Model = LPVStateSpace | PolynomialStateSpace | LFT


class Question(NamedTuple):
    """A model in polynomial pieces, what is asked of it, and by which means."""

    model: Pieces
    demand: Demand
    form: LyapunovForm
    impose: Imposed
    solver: Solver
    search: Search | None

    @property
    def one_parameter(self) -> bool:
        """Whether the fast route for one parameter answers it: gain and stability by plain
        Bernstein coefficients.
        """
        return (
            isinstance(self.model.source, LPVStateSpace)
            and self.demand.kind in ("l2 gain", "stability")
            and isinstance(self.impose, Bernstein)
            and self.impose.subdivision == 0
            and not (isinstance(self.form, Spline) and self.form.total_degree is not None)
        )

    @property
    def gains(self) -> bool:
        """Whether a gain is asked for."""
        return self.demand.kind.endswith("gain")


def question(
    model: Model,
    rate: Rate,
    kind: Kind,
    form: LyapunovForm | None,
    impose: Imposed | None,
    solver: Solver | str,
    search: Search | None,
) -> Question:
    """The question, its options checked against one another and against the model.

    Raises `InputError` for an option that has no meaning for the question.
    """
    form, impose = form or Spline(), impose or Bernstein()
    solver = solver if isinstance(solver, Solver) else Solver(solver)
    if not isinstance(form, Spline | Memory | HigherOrder):
        raise InputError(f"form must be a Spline, Memory or HigherOrder, got {form!r:.60}")
    if not isinstance(impose, Bernstein | SumOfSquares | Vertices | Grid):
        raise InputError(
            f"impose must be Bernstein, SumOfSquares, Vertices or Grid, got {impose!r:.60}"
        )
    if search is not None and not isinstance(search, Search):
        raise InputError(f"search must be a Search, or None for none, got {search!r:.60}")
    own = pieces(_accepted(model))
    asked = Question(
        own, Demand(kind, Drift(rates(own.parameters, rate))), form, impose, solver, search
    )
    _check_channels(asked)
    _check_options(asked)
    return asked


def _accepted(model: Model) -> LPVStateSpace | PolynomialStateSpace:
    if isinstance(model, LFT):
        return PolynomialStateSpace.from_lft(model)
    if not isinstance(model, LPVStateSpace | PolynomialStateSpace):
        raise InputError(
            "expected an LPVStateSpace, a PolynomialStateSpace or an LFT, got"
            f" {type(model).__name__}; make one with LPVStateSpace.polynomial(...),"
            " PolynomialStateSpace.polynomial(...) or LinearFamily.interpolate()"
        )
    return model


def _check_channels(asked: Question) -> None:
    nx, nu, ny = asked.model.sizes
    if nx == 0:
        raise InputError("the model has no states; its gain is the largest norm of D(p)")
    if asked.gains and not (nu and ny):
        raise InputError(
            f"a gain needs inputs and outputs, got {nu} and {ny}; use stability() without channels"
        )
    if asked.demand.kind == "energy-to-peak gain" and asked.model.passes_peaks:
        raise InputError(
            "the energy-to-peak gain of a continuous model needs D = 0: feedthrough passes peaks of"
            " any height"
        )


def _check_options(asked: Question) -> None:
    form, kind, dt = asked.form, asked.demand.kind, asked.model.dt
    if not isinstance(form, Spline):
        name = type(form).__name__
        if kind not in ("l2 gain", "stability") or not asked.one_parameter:
            raise InputError(
                f"{name} is a form for l2_gain and stability of an LPVStateSpace in one parameter"
                " by plain Bernstein coefficients; take form=Spline(...) here"
            )
        if dt is not None:
            raise InputError(
                f"{name} is for continuous time; this model is sampled every {dt:g} s: leave it"
                " out, or analyse the model before discretize(), as one in continuous time"
            )
        if asked.gains and isinstance(form, HigherOrder):
            raise InputError(
                "HigherOrder proves stability only: a V of that degree does not balance energies;"
                " for a gain use Memory"
            )
    if kind == "stability" and form.accept is not None:
        raise InputError("accept compares bounds, and stability has none: leave it out")
    if not asked.gains and (asked.impose.margins, asked.impose.floor) != (None, None):
        raise InputError(
            f"margins and floor are for gains; for the {kind} the margin itself is maximised:"
            " leave them out"
        )
