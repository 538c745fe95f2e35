"""Gain of a loop as a function of the permitted rate of its parameter."""

from __future__ import annotations

import math
from collections.abc import Sequence

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.threads import with_one_thread
from symheli.values.labelled import per
from symheli.values.signal import Signal
from synthesis.certify.lower_bounds.lower_bound import THOROUGH, LowerBoundSearch
from synthesis.certify.questions.gain_curve import GainCurve
from synthesis.certify.questions.lft_gain import lft_gain
from synthesis.certify.questions.questions import l2_gain
from synthesis.certify.statement.forms import LyapunovForm
from synthesis.certify.statement.impose import Imposed
from synthesis.numerics.program.cone_program import Solver

MOVING, CONSTANT = "P(p)", "constant P"
"""Names of the Lyapunov functions for a bounded rate, and for a parameter that jumps."""


REDUCED = (
    "of the LFT that reduce() makes of the model: a dependence on the parameter below 1e-12 of the"
    " size that row and column give an entry counts as rounding"
)


@with_one_thread
def gain_against_rate(
    model: LPVStateSpace | UncertainStateSpace,
    rates: Sequence[float],
    *,
    lft: Sequence[str] = (),
    title: str = "",
    form: LyapunovForm | None = None,
    impose: Imposed | None = None,
    solver: Solver | str | None = None,
    search: LowerBoundSearch | None = THOROUGH,
) -> GainCurve:
    """Certify the L2 gain of a model over a list of rate bounds of its parameter, each with a lower
    bound.

    Parameters
    ----------
    model : LPVStateSpace or UncertainStateSpace
        With one scheduling parameter.
    rates : sequence of float
        Largest |dp/dt| in units of p per second, in any order: 0 is frozen, math.inf a parameter
        that may jump.
    lft : sequence of str
        LFT tests for a parameter that may jump, "small gain", "D", "DG" or "full block"; of
        polynomial models only.
    title : str
        Of the curve.
    form, impose, solver, search
        As of `l2_gain`, for every rate.

    Returns
    -------
    GainCurve
        Its `certificates` are the proofs, by form and rate; a rate at which nothing could be proven
        has inf.

    Raises
    ------
    InputError
        No rates, one that is negative or twice there, a model of several parameters, LFT tests of
        what is no polynomial model.

    Examples
    --------
    >>> from symheli import LPVStateSpace, Scheduling
    >>> p = Scheduling("p", "1", 0.0, 1.0)
    >>> lag = LPVStateSpace.polynomial([[[-1.0]], [[-1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], p)
    >>> curve = gain_against_rate(lag, [0.0, 0.5], lft=["DG"], search=None)
    >>> print(f"{curve.best[0.5]:.3f}, when p may jump {curve.jumping['LFT DG']:.3f}")
    1.000, when p may jump 1.000
    >>> curve.certificates["P(p)", 0.5].verified
    True
    """
    wanted = _checked(rates)
    s = _parameter(model)
    if lft and not isinstance(model, LPVStateSpace):
        raise InputError("LFT tests do not apply to an uncertain model: leave out lft=")
    options = {"form": form, "impose": impose, "solver": solver, "search": search}
    found = [
        (CONSTANT if math.isinf(rate) else MOVING, rate, l2_gain(model, rate, **options))
        for rate in wanted
    ]
    if lft:
        assert isinstance(model, LPVStateSpace)  # noqa: S101
        reduced = model.to_lft().reduce()
        found += [
            (
                f"LFT {scaling}",
                math.inf,
                lft_gain(reduced, scaling, search=None).resting_on([REDUCED]),
            )
            for scaling in lft
        ]
    unit = per(_units(model.outputs), _units(model.inputs))
    return GainCurve.of(found, title, unit, s.name, per(s.unit, "s"))


def _checked(rates: Sequence[float]) -> list[float]:
    wanted = sorted(float(rate) for rate in rates)
    if not wanted or not wanted[0] >= 0 or len(set(wanted)) < len(wanted):
        raise InputError(
            "rates: expected different numbers >= 0 (math.inf: the parameter may jump), got"
            f" {list(rates)!r:.80}"
        )
    return wanted


def _parameter(model: LPVStateSpace | UncertainStateSpace) -> Scheduling:
    if len(model.parameters) > 1:
        raise InputError(
            "a curve over the rate needs a model of one parameter, this one has"
            f" {', '.join(s.name for s in model.parameters)}: hold the others, .along(...)"
        )
    return model.scheduling


def _units(names: Sequence[Signal]) -> str:
    """Return the unit of a group of signals, or all of their units where they differ."""
    units = list(dict.fromkeys(s.unit for s in names))
    return units[0] if len(units) == 1 else f"({', '.join(units)})"
