"""Gain-scheduled state feedback."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from symheli.errors import InputError
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from synthesis.certify.statement.impose import Grid
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.rates import Rate, limits
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.existence import Existence, Solution, imposed_at
from synthesis.design.lpv.fitted import in_plant_units
from synthesis.design.lpv.frozen_stability import frozen_stability
from synthesis.design.lpv.output_feedback import USUAL
from synthesis.design.lpv.recovery import control_gain, state_gain
from synthesis.design.lpv.scaled_plant import ScaledPlant, depends
from synthesis.design.lpv.search import BACK_OFF, best, settled
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.design.plant.refusals import conditions, failed, least_ranks, levels_above
from synthesis.numerics.program.bases import Bases, Dependence, dependence

MAX_CONDITION = 1e12
"""Largest condition number of C2 at which all states count as measured."""


@with_one_thread
def state_feedback(
    plant: Plant,
    rate: Rate = None,
    *,
    Y: Dependence | None = None,
    back_off: float | Sequence[float] = BACK_OFF,
    divisions: int = 1,
    impose: Grid | None = None,
) -> Controller:
    """Design u = F(p) x for every p(t) within its range and rates; F does not depend on the rate of
    p.

    Parameters
    ----------
    plant : Plant
        Its measurements are all its states, as many as there are; every control must cost.
    rate : float, sequence or mapping, optional
        Largest |dp/dt|, as for `l2_gain`; by default the plant's own; math.inf: p may jump.
    Y : int, tuple or FunctionSpace, optional
        Degree of the storage function's inverse in every parameter, one each, or functions.
    back_off : float or sequence
        Multiples of the least gamma at which Y is settled, tried in turn.
    divisions : int
        In so many parts every range is cut where the inequalities are imposed.
    impose : Grid, optional
        As in `output_feedback`: at these points and nowhere else.

    Returns
    -------
    Controller
        Without states.

    Raises
    ------
    InputError
        Signals, ranks, rates or degrees that do not fit, with what to do.
    SynthesisError
        There is no such controller, or none was found; with reasons.

    See Also
    --------
    synthesis.lqr : state feedback by Riccati equations
    synthesis.output_feedback : a controller of the order of the plant

    References
    ----------
    Wu, Yang, Packard and Becker, Int. J. Robust and Nonlinear Control 6 (1996), theorem 4.1.

    Examples
    --------
    >>> shown = synthesis.Plant(
    ...     plant.model, disturbances=["w"], performance=["z_x", "z_u"],
    ...     controls=["u"], measurements=["z_x"])
    >>> made = synthesis.state_feedback(shown)
    >>> made.order, bool(made.promised < synthesis.output_feedback(plant).promised)
    (0, True)
    """
    require_plant(plant)
    parameters = limits(plant.parameters, rate)
    plant = plant.with_scheduling(parameters)
    least_ranks(plant, measurements=False)
    _check_measured(plant)
    attempts: list[Attempt] = []
    matters = depends(plant)

    def every(degree: int) -> list[Bases]:
        return [Bases(None, dependence(Y, parameters, "Y", matters, degree))]

    start = best(plant, every, imposed_at(divisions, impose), USUAL, attempts)
    factors = levels_above(back_off)
    for design in settled(start, factors, _recover, USUAL, attempts):
        method = f"state feedback, {start.shape}"
        made = in_plant_units(plant, design.scaled, design.fit, design.gamma, method)
        made = replace(made, optimum=start.gamma)
        if frozen_stability(made.closed()).stable is not False:
            return replace(made, attempts=tuple(attempts))
    raise failed(plant, attempts)


def _check_measured(plant: Plant) -> None:
    n, ny = len(plant.states), len(plant.measurements)
    at = plant.matrices(conditions(plant)[0])
    shown = np.linalg.svd(at.C2, compute_uv=False)
    if n != ny or np.any(at.D21) or np.any(at.D22) or shown.min() * MAX_CONDITION < shown.max():
        raise InputError(
            f"state feedback needs all {n} states among the measurements at every p, undisturbed,"
            f" and nothing else ({', '.join(plant.states)}); measured are"
            f" {', '.join(plant.measurements)}: take output_feedback"
        )


def _recover(
    scaled: ScaledPlant, existence: Existence, found: Solution
) -> Callable[[Array], Array]:
    Y, S = existence.Y, existence.S
    assert Y is not None  # noqa: S101 - it was asked for
    assert S is not None  # noqa: S101

    def gains(p: Array) -> Array:
        at, y = scaled.at(p), Y.at(found.coefficients, p)
        if scaled.dt is not None:
            F = state_gain(at, y, S.at(found.coefficients, p), found.gamma)
        else:
            nothing = np.zeros((len(p), at.B2.shape[-1], at.D21.shape[-2]))
            F = control_gain(at, y, nothing, found.gamma) @ np.linalg.inv(y)
        return F @ np.linalg.inv(at.C2)

    return gains
