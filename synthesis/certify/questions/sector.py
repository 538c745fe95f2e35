"""Conic sectors: how far y is from c u, in terms of u."""

from __future__ import annotations

from typing import Any

from symheli.threads import with_one_thread
from symheli.values.numbers import finite
from synthesis.certify.lower_bounds.lower_bound import THOROUGH, LowerBoundSearch
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.certify import certify
from synthesis.certify.questions.problem import Model, pose
from synthesis.certify.statement.forms import Spline
from synthesis.certify.statement.impose import Imposed
from synthesis.certify.statement.kind import Kind, Supply
from synthesis.certify.statement.rates import Rate
from synthesis.numerics.program.cone_program import Solver


def kind(centre: float) -> Kind:
    """The kind "radius about c": dV/dt < r^2 |u|^2 - |y - c u|^2."""
    c = float(centre)
    return Kind(
        f"radius about {c!r}",
        sense=1,
        fields=("gamma", "lower"),
        unit="y per u",
        meaning=f"|y - ({c!r}) u|_2 < gamma |u|_2 from rest",
        supply=lambda number, unit: _about(number(c) * (number(1.0) / number(unit)), number),
    )


def _about(c: Any, number: Any) -> Supply:
    return Supply(-number(1.0), c, -c * c)


@with_one_thread
def sector_radius(
    model: Model,
    centre: float,
    rate: Rate = None,
    *,
    form: Spline | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> Certificate:
    """Certify the least r found with |y - c u|_2 < r |u|_2 from rest, for every p(t) within its
    range and rates: the model is inside the cone about the `centre` c with the radius r.

    Parameters
    ----------
    model : LPVStateSpace or LFT
        The model, with as many outputs as inputs: each output is compared with its input.
    centre : float
        c, in units of y per unit of u.
    rate, impose, solver, search
        As of `l2_gain`.
    form : Spline, optional
        The form of the Lyapunov function.

    Returns
    -------
    Certificate
        `gamma` is the proven radius; no proof goes below `lower`.

    Raises
    ------
    InputError, SolverError
        As of `l2_gain`; for another number of outputs than inputs, a centre that is no number.

    See Also
    --------
    synthesis.l2_gain : the radius about zero

    References
    ----------
    Zames, "On the input-output stability of time-varying nonlinear feedback systems", IEEE Trans.
    Automatic Control 11 (1966).

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> from synthesis.analysis import sector_radius
    >>> p = Scheduling("p", "1", 0.0, 1.0, rate=0.5)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> cert = sector_radius(lag, 0.5, search=None)  # the circle of 1/(s + 1)
    >>> print(f"{cert.gamma:.3f}", cert.verify(rigorous=True))
    0.500 True
    """
    return certify(pose(model, rate, kind(finite(centre, "centre")), form, impose, solver, search))
