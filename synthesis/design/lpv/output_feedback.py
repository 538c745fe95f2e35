"""Gain-scheduled output feedback by two linear matrix inequalities."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from symheli import UncertainStateSpace
from symheli.errors import SynthesisError
from symheli.lpv.bases.polynomials import lobatto_points
from symheli.threads import with_one_thread
from symheli.values.arrays import Array
from synthesis.certify.statement.impose import Grid
from synthesis.certify.statement.outcome import Attempt
from synthesis.certify.statement.rates import Rate, limits
from synthesis.design.loops.controller import Controller
from synthesis.design.lpv.at_rest import at_rest
from synthesis.design.lpv.enough_states import enough_states
from synthesis.design.lpv.existence import MATRIX_BOUNDS, Divisions, Existence, Solution, imposed_at
from synthesis.design.lpv.fitted import in_plant_units
from synthesis.design.lpv.frozen_stability import frozen_stability
from synthesis.design.lpv.recovery import controller, sampled_controller, split
from synthesis.design.lpv.regular import regular
from synthesis.design.lpv.robust import robust_plant
from synthesis.design.lpv.scaled_plant import ScaledPlant, depends, scaled_plant_of
from synthesis.design.lpv.search import (
    BACK_OFF,
    CHECK_POINTS,
    CLOSE_TO_OPTIMUM,
    FAR_ABOVE,
    MIN_IMPROVEMENT,
    ScaledDesign,
    Start,
    best,
    least,
    settled,
)
from synthesis.design.lpv.worst_optimum import FrozenOptimum, worst_optimum
from synthesis.design.plant.plant import Plant, require_plant
from synthesis.design.plant.refusals import NOTHING_WRONG, failed, levels_above, require_channels
from synthesis.numerics.program.bases import (
    DEGREES,
    Bases,
    Dependence,
    both_moving,
    candidates,
    used,
)
from synthesis.numerics.program.cone_program import LYAPUNOV, Solver

CENTRAL = "output feedback, central controllers of the frozen models"
BOUND_DECIDES = (
    "the bound {:g} on X and Y decides gamma: some measurement is almost free of noise or some"
    " control almost free of cost; give it more"
)

USUAL = Solver(LYAPUNOV, tolerance=1e-7, iterations=100)


@with_one_thread
def output_feedback(
    plant: Plant,
    rate: Rate = None,
    *,
    X: Dependence | None = None,
    Y: Dependence | None = None,
    back_off: float | Sequence[float] = BACK_OFF,
    fastest: float = math.inf,
    divisions: int = 1,
    impose: Grid | None = None,
) -> Controller:
    """Design a dynamic controller from the measurements, of at most the order of the plant, for
    every p(t) within its range and rates.

    Where the plant has more than 12 states, those are left out without which the central
    controllers of frozen models keep their level on the whole plant, such as states of fast servos
    and delays; they are taken as at rest. The loops that are checked and certified have them all.

    X(p) is the matrix of the estimation inequality, Y(p) that of the control inequality. If only
    one of them depends on a parameter, the controller does not need its rate; both pairs are tried.
    Both may depend on a parameter whose rate is another one (`plant.lagged`), or that is constant.
    If one of them does not come near the worst frozen optimum, both depend on p and the controller
    neglects dp/dt: `gamma` is then proven with the storage function of X and Y for that controller,
    and is accepted if it is at most 1.05 times the gamma with dp/dt measured. If parameters are
    constant and the inequalities find nothing near that optimum, the gains are those of the central
    H-infinity controllers of the frozen models.

    Parameters
    ----------
    plant : Plant
        With disturbances, performance, controls and measurements. A control without a cost (D12
        not of full column rank), or a measurement without noise (D21 not of full row rank), gets a
        little of it for the design, which `notes` say.
    rate : float, sequence or mapping, optional
        Largest |dp/dt|, as for `l2_gain`; by default the plant's own; math.inf: p may jump.
    X, Y : int, tuple or FunctionSpace, optional
        Degree in every parameter, one each, or functions, such as
        `UserFunctions.from_expressions([1, cos(t)], t)`; by default one of the two moves, with a
        degree that rises from 2 while that lowers gamma by .5 % and gamma is above the worst
        optimum of the frozen models, which no controller can beat. A shape is given up once its
        multipliers show that it brings less. Where both are given and move with a parameter of a
        bounded rate, the controller neglects dp/dt, as above.
    back_off : float or sequence
        Multiples of the least gamma at which X and Y are settled, tried in turn until the gains are
        smooth functions of p: at the least itself a controller has poles without limit.
    fastest : float
        Largest modulus of a pole of the controller, rad/s (continuous time): a reason to try other
        values of `back_off`.
    divisions : int
        In so many parts every range is cut at first where the inequalities are imposed; where they
        are violated between, points are added.
    impose : Grid, optional
        The inequalities are imposed at these points alone, as in published designs: `promised`
        is then no bound between the points; `certify` proves one.

    Returns
    -------
    Controller
        `promised` is the gain of its inequalities; `certify` proves what the controller does.

    Raises
    ------
    InputError
        Signals, ranks, rates or degrees that do not fit, with what to do.
    SynthesisError
        There is no such controller, or none was found; `reasons` say which mode, direction or
        weight decides.

    See Also
    --------
    synthesis.Plant : what a design takes
    synthesis.certify_sampled : the sampled loop as implemented
    synthesis.multiobjective : several objectives at once

    References
    ----------
    Wu, Yang, Packard and Becker, Int. J. Robust and Nonlinear Control 6 (1996); Apkarian and Adams,
    IEEE Trans. Control Systems Technology 6 (1998).

    Examples
    --------
    >>> slow, fast = (synthesis.output_feedback(plant, rate) for rate in (0.1, 10.0))
    >>> bool(slow.promised < fast.promised)
    True
    >>> slow.certify(0.1, search=None).verified
    True
    """
    require_plant(plant)
    parameters = limits(plant.parameters, rate)
    given = plant.with_scheduling(parameters)
    require_channels(given)
    factors = levels_above(back_off)
    attempts: list[Attempt] = []
    matters = depends(given)
    cut = imposed_at(divisions, impose)

    def every(degree: int) -> list[Bases]:
        return candidates(parameters, X, Y, given.dt is not None, matters, degree)

    def both(degree: int) -> list[Bases]:
        free = X is None and Y is None and given.dt is None
        return both_moving(parameters, matters, degree) if free else []

    failure = None
    for plant, added in regular(given):
        try:
            if isinstance(plant.model, UncertainStateSpace):
                made = _robust(plant, every(DEGREES[1][0]), factors, fastest, cut, attempts)
            else:
                free = X is None and Y is None
                made = _nominal(plant, every, both, factors, fastest, cut, attempts, free=free)
        except SynthesisError as error:
            failure = error
            if error.reasons != (NOTHING_WRONG,):
                break
        else:
            return replace(made, plant=given, notes=(*added, *made.notes)) if added else made
    assert failure is not None  # noqa: S101 - at least one plant was tried
    raise failure


@with_one_thread
def lft_feedback(
    plant: Plant,
    *,
    back_off: float | Sequence[float] = BACK_OFF,
    fastest: float = math.inf,
    divisions: int = 1,
) -> Controller:
    """Design an output-feedback controller for parameters that change arbitrarily fast, from an LFT
    in them.

    With constant X and Y the conditions of `output_feedback` need hold at every p alone. The full
    block S-procedure turns them into conditions on multipliers without losing anything (Scherer
    2001, theorem 8); here they are imposed on p itself, by Bernstein coefficients. The controller
    is polynomial in p: `controller.model.to_lft().reduce()`.

    Parameters
    ----------
    plant : Plant
        As for `output_feedback`.
    back_off, fastest, divisions
        As for `output_feedback`.

    Returns
    -------
    Controller
        `certify(math.inf)` or `lft_gain(controller.closed().to_lft().reduce())` prove its gain.

    Raises
    ------
    InputError, SynthesisError
        As `output_feedback`; where p may jump there often is no controller.

    References
    ----------
    Scherer, "LPV control and full block multipliers", Automatica 37 (2001).

    Examples
    --------
    >>> made = synthesis.designs.lft_feedback(plant)
    >>> proof = made.certify(math.inf, search=None)
    >>> proof.verified, bool(proof.gamma <= made.promised)
    (True, True)
    """
    return output_feedback(plant, math.inf, back_off=back_off, fastest=fastest, divisions=divisions)


def _robust(
    plant: Plant,
    every: Sequence[Bases],
    factors: Sequence[float],
    fastest: float,
    divisions: Divisions,
    attempts: list[Attempt],
) -> Controller:
    """Design for all models of the set, with the shape that is best for the nominal one."""
    starts = [least(plant, shape, divisions, USUAL, attempts) for shape in every]
    start = min(starts, key=lambda each: each.gamma)
    found = robust_plant(
        plant, start.gamma, lambda p: least(p, start.shape, divisions, USUAL, attempts).gamma
    )
    if found is None:
        raise failed(plant, attempts)
    made = _nominal(
        found, lambda _: [start.shape], lambda _: [], factors, fastest, divisions, attempts
    )
    return replace(made, plant=plant, method=f"robust {made.method}")


def _nominal(
    plant: Plant,
    every: Callable[[int], Sequence[Bases]],
    both: Callable[[int], Sequence[Bases]],
    factors: Sequence[float],
    fastest: float,
    divisions: Divisions,
    attempts: list[Attempt],
    *,
    free: bool = False,
) -> Controller:
    """Design for one model, with the best of the shapes; they are `free` where the user requested
    none.
    """
    worst = worst_optimum(plant)
    if worst.level == 0 and (refusal := failed(plant, attempts)).reasons != (NOTHING_WRONG,):
        raise refusal  # no frozen model has a controller, and it is known why
    tried = []
    for states in _orders(plant, worst, divisions):
        start = best(plant, every, divisions, USUAL, attempts, worst, states)
        made = _slowest(plant, start, both, factors, fastest, worst, divisions, attempts, free=free)
        if made is not None:
            tried.append(made)
            if made.optimum is None or made.promised <= _far(min(factors)) * made.optimum:
                break
    if not tried:
        raise failed(plant, attempts, _advice(start.shape.unmeasured_rates(plant.parameters)))
    found = min(tried, key=lambda each: (_fastest(each) > fastest, each.promised))
    return replace(found, attempts=tuple(attempts))


def _orders(plant: Plant, worst: FrozenOptimum, divisions: Divisions) -> list[int]:
    """Return the numbers of states to design with: those that matter, then all; all where the user
    requested the points.
    """
    scaled = scaled_plant_of(plant, worst.level or 1.0)
    whole = len(scaled.left)
    if isinstance(divisions, Grid) or worst.level == 0:
        return [whole]
    return list(dict.fromkeys([enough_states(scaled, worst.p), whole]))


def _slowest(
    plant: Plant,
    start: Start,
    both: Callable[[int], Sequence[Bases]],
    factors: Sequence[float],
    fastest: float,
    worst: FrozenOptimum,
    divisions: Divisions,
    attempts: list[Attempt],
    *,
    free: bool,
) -> Controller | None:
    """Return the first controller with no pole faster than `fastest`, else the slowest; None
    without any.
    """
    slowest = None
    for found, notes in _controllers(
        plant, start, both, factors, worst, divisions, attempts, free=free
    ):
        frozen = frozen_stability(found.closed())
        if frozen.stable is False:
            attempts.append(Attempt("frozen loop", 0.0, f"not stable at {frozen.p}", math.inf))
            continue
        if slowest is None or _fastest(found) < _fastest(slowest):
            slowest = replace(found, notes=(*notes, *_limited(found, min(factors), fastest)))
        if _fastest(found) <= fastest:
            break
    return slowest


def _controllers(
    plant: Plant,
    start: Start,
    both: Callable[[int], Sequence[Bases]],
    factors: Sequence[float],
    worst: FrozenOptimum,
    divisions: Divisions,
    attempts: list[Attempt],
    *,
    free: bool,
) -> Iterator[tuple[Controller, tuple[str, ...]]]:
    """Yield controllers from the inequalities, with the reasons against a lower gamma. If every
    parameter is constant and X and Y are `free`, central controllers of the frozen models precede
    those far from the least gamma; if X or Y alone stays above the bound for every controller, both
    depend on p first.
    """
    floor = worst.level
    still = free and floor > 0 and all(s.rate == 0 for s in plant.parameters)

    def central() -> Iterator[tuple[Controller, tuple[str, ...]]]:
        for each in at_rest(plant, worst, factors, attempts):
            made = in_plant_units(plant, each.scaled, each.fit, each.gamma, CENTRAL)
            yield replace(made, optimum=floor), ()

    def other() -> Start | None:
        if start.gamma <= CLOSE_TO_OPTIMUM * floor or not both(DEGREES[1][0]):
            return None
        kept = start.existence.states
        found = best(plant, both, divisions, USUAL, attempts, worst, kept, start.gamma)
        return found if found.gamma < MIN_IMPROVEMENT * start.gamma else None

    for own, design in _designs(plant, start, other(), factors, attempts):
        if still and design.gamma > _far(min(factors)) * floor:
            yield from central()
            still = False
        suffix = ", their rates neglected" if own.shape.unmeasured_rates(plant.parameters) else ""
        kept, states = own.existence.states, len(plant.model.states)
        if kept < states:
            suffix += f", with {kept} of {states} states"
        method = f"output feedback, {own.shape}{suffix}"
        made = in_plant_units(plant, design.scaled, design.fit, design.gamma, method)
        made = replace(made, optimum=own.gamma, by_adjoint=own.shape.by_y)
        decides = own.existence.bounded(own.found) and own.existence.largest >= MATRIX_BOUNDS[-1]
        yield made, (BOUND_DECIDES.format(own.existence.largest),) if decides else ()
    if still:
        yield from central()


def _far(wanted: float) -> float:
    """Return the ratio to the least gamma above which a design counts as far from it, where the
    least requested back-off is `asked`.
    """
    return FAR_ABOVE * max(1.0, wanted / BACK_OFF[0])


def _advice(names: Sequence[str]) -> tuple[str, ...]:
    """Return the advice where X and Y both depend on these parameters."""
    if not names:
        return ()
    return (
        f"X and Y both depend on {', '.join(names)}, and a controller without a measurement of its"
        " rate keeps no gamma near theirs: let X or Y be of degree 0 in it, as X=0, or give a"
        " lagged parameter to the plant, plant.lagged(...)",
    )


def _designs(
    plant: Plant,
    start: Start,
    other: Start | None,
    factors: Sequence[float],
    attempts: list[Attempt],
) -> Iterator[tuple[Start, ScaledDesign]]:
    """Yield designs of `other` first, where X and Y both depend on p and dp/dt is not measured,
    which suits slow parameters; only with back-offs whose gamma is still lower.
    """
    first: list[float] = []
    if other is not None:
        first = [f for f in factors if f * other.gamma < min(factors) * start.gamma]
        for design in settled(other, first, _recover, USUAL, attempts, neglecting=True):
            yield other, design
    neglected = bool(start.shape.unmeasured_rates(plant.parameters))  # requested by the user
    for design in settled(start, factors, _recover, USUAL, attempts, neglecting=neglected):
        yield start, design
    if other is not None:
        rest = [f for f in factors if f not in first]
        for design in settled(other, rest, _recover, USUAL, attempts, neglecting=True):
            yield other, design


def _limited(made: Controller, wanted: float, fastest: float) -> tuple[str, ...]:
    """Return what may have kept the controller from a lower gamma, or from its limits, a sentence
    each.
    """
    out = []
    if made.optimum and made.promised > _far(wanted) * made.optimum:
        out.append(
            f"gamma is {made.promised / made.optimum:.2f} times the least one of the"
            " inequalities: no nearer controller had gains that are smooth in the scheduling"
            " parameters"
        )
    if _fastest(made) > fastest:
        out.append(
            f"the fastest pole of the controller is at {_fastest(made):.4g} rad/s, asked was"
            f" {fastest:g}: give larger values of back_off, or weights that ask for less bandwidth"
        )
    return tuple(out)


def _recover(
    scaled: ScaledPlant, existence: Existence, found: Solution
) -> Callable[[Array], Array]:
    X, Y, S = existence.X, existence.Y, existence.S
    assert X is not None  # noqa: S101 - all were asked for
    assert Y is not None  # noqa: S101
    assert S is not None  # noqa: S101
    parameters = scaled.parameters

    def gains(p: Array) -> Array:
        at = scaled.at(p)
        x, y, s = (u.at(found.coefficients, p) for u in (X, Y, S))
        if scaled.dt is not None:
            return sampled_controller(at, x, y, s, found.gamma).packed
        transformed = split(at, x, y, found.gamma)
        moving = None
        if X.moves and Y.moves:
            # dX/dt along the known motion; zero where p stands still
            known = [
                m and isinstance(s.rate, str)
                for m, s in zip(used(X.basis), parameters, strict=True)
            ]
            (motion,) = scaled.motions(p, known)
            moving = X.moving(found.coefficients, p, motion)
        return controller(at, x, y, transformed, constant_x=not X.moves, moving_x=moving).packed

    return gains


def _fastest(made: Controller) -> float:
    """Return the largest modulus of a pole, rad/s, of a continuous controller; 0 for a
    sampled one.
    """
    model = made.model
    if model.dt is not None:
        return 0.0
    p = lobatto_points(CHECK_POINTS.get(len(model.parameters), 3), model.box)
    A = model.matrices(p).A
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
