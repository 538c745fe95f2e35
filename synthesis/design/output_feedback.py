"""Gain-scheduled output feedback by two linear matrix inequalities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from symheli.errors import InputError, SynthesisError
from symheli.lpv import LPVStateSpace, UncertainStateSpace
from synthesis.certificate import Attempt
from synthesis.design.cells import degrees_of
from synthesis.design.conditions import conditions
from synthesis.design.controller import Controller
from synthesis.design.coordinates import Coordinates
from synthesis.design.diagnosis import reasons, unpriced
from synthesis.design.existence import Existence, Found
from synthesis.design.fitted import fitted
from synthesis.design.motions import motions, used
from synthesis.design.recovery import Gains, controller, split
from synthesis.design.robust import scaled_plant
from synthesis.design.sampled_recovery import joined
from synthesis.design.search import BACK_OFF, Dependence, Shape, least, settled, shapes
from synthesis.program.cone_program import LYAPUNOV, Solver
from synthesis.worst.rates import Rate
from synthesis.worst.rates import asked as limits

if TYPE_CHECKING:
    from synthesis.design.plant import Plant

Array = np.ndarray

ACCURACY = 3e-3
"""Of the functions of p fitted to the gains, relative, entry by entry."""
USUAL = Solver(LYAPUNOV, tolerance=1e-7, iterations=100)


def output_feedback(
    plant: Plant,
    rate: Rate = None,
    *,
    X: Dependence | None = None,
    Y: Dependence | None = None,
    back_off: float | Sequence[float] = BACK_OFF,
    fastest: float = math.inf,
    divisions: int = 1,
) -> Controller:
    """A dynamic controller from the measurements, of as many states as the plant, for every p(t)
    within its range and rates.

    X(p) belongs to what the measurements tell, Y(p) to what the controls can do. While only one of
    them moves with a parameter the controller needs no rate of it; both pairs are tried. Both may
    move with a parameter whose rate is another one (`plant.lagged`), or that stands still.

    Parameters
    ----------
    plant : Plant
        With disturbances, performance, controls and measurements; every control must cost (D12 of
        full column rank), every measurement be disturbed (D21 of full row rank).
    rate : float, sequence or mapping, optional
        Largest |dp/dt|, as for `l2_gain`; by default the plant's own; math.inf: p may jump.
    X, Y : int, tuple or FunctionSpace, optional
        Degree in every parameter, one each, or functions; by default 2 for the one that moves.
    back_off : float or sequence
        Multiples of the least gamma at which X and Y are settled, tried in turn until the gains are
        smooth functions of p: at the least itself a controller has poles without limit.
    fastest : float
        Largest modulus of a pole of the controller, rad/s (continuous time): a reason to back off
        further.
    divisions : int
        In so many parts every range is cut where the inequalities are imposed.

    Returns
    -------
    Controller
        Its `gamma` is what the inequalities promise; `certify` proves what the controller does.

    Raises
    ------
    InputError
        Signals, ranks, rates or degrees that do not fit, with what to do.
    SynthesisError
        There is no such controller, or none was found; `reasons` say which mode, direction or
        weight decides.

    References
    ----------
    Wu, Yang, Packard and Becker, Int. J. Robust and Nonlinear Control 6 (1996); Apkarian and Adams,
    IEEE Trans. Control Systems Technology 6 (1998).

    Examples
    --------
    >>> slow, fast = (synthesis.output_feedback(plant, rate) for rate in (0.1, 10.0))
    >>> bool(slow.gamma < fast.gamma)
    True
    >>> slow.certify(0.1, search=None).verified
    True
    """
    parameters = limits(plant.parameters, rate)
    plant = plant.with_scheduling(parameters)
    least_ranks(plant)
    factors = (back_off,) if isinstance(back_off, int | float) else tuple(back_off)
    attempts: list[Attempt] = []
    every = shapes(parameters, X, Y, plant.dt is not None, depends(plant))
    if isinstance(plant.model, UncertainStateSpace):
        return _robust(plant, every, factors, fastest, divisions, attempts)
    return _nominal(plant, every, factors, fastest, divisions, attempts)


def _robust(
    plant: Plant,
    every: Sequence[Shape],
    factors: Sequence[float],
    fastest: float,
    divisions: int,
    attempts: list[Attempt],
) -> Controller:
    """For all models of the set, by the one of the shapes that serves the nominal one best."""
    gammas = [_gamma(_start(plant, shape, divisions, attempts)) for shape in every]
    start = min(gammas)
    best = every[gammas.index(start)]
    found = scaled_plant(plant, start, lambda p: _gamma(_start(p, best, divisions, attempts)))
    if found is None:
        raise failed(plant, attempts)
    made = _nominal(found, [best], factors, fastest, divisions, attempts)
    return replace(made, plant=plant, method=f"robust {made.method}")


def _start(
    plant: Plant, shape: Shape, divisions: int, attempts: list[Attempt]
) -> tuple[Coordinates, Existence, Found]:
    return least(lambda channel: coordinates_of(plant, channel), shape, divisions, USUAL, attempts)


def _gamma(start: tuple[Coordinates, Existence, Found]) -> float:
    return start[0].channel * start[2].gamma


def _nominal(
    plant: Plant,
    every: Sequence[Shape],
    factors: Sequence[float],
    fastest: float,
    divisions: int,
    attempts: list[Attempt],
) -> Controller:
    """For one model, by the best of the shapes."""
    started = [(_start(plant, shape, divisions, attempts), shape) for shape in every]
    started = [each for each in started if math.isfinite(_gamma(each[0]))]
    if not started:
        raise failed(plant, attempts)
    start, shape = min(started, key=lambda each: _gamma(each[0]))
    best: Controller | None = None
    for design in settled(start, factors, _recover, USUAL, attempts):
        made = in_plant_units(
            plant, design.coordinates, design.gains, design.gamma, f"output feedback, {shape}"
        )
        made = replace(made, by_adjoint=shape.by_y)
        # rough gains of p, or fast ones, are those of a block that is nearly singular
        good = made.misfit <= ACCURACY and _fastest(made.model) <= fastest
        best = made if best is None or good or made.misfit < best.misfit else best
        if good:
            break
    if best is None:
        raise failed(plant, attempts)
    return replace(best, optimum=_gamma(start), attempts=tuple(attempts))


def coordinates_of(plant: Plant, channel: float) -> Coordinates:
    """Coordinates of the plant with performance in units of `channel`."""
    one = len(plant.parameters) == 1
    return Coordinates.of(
        lambda p: plant.matrices(p[:, 0] if one else p),
        plant.parameters,
        plant.basis,
        plant.dt,
        channel,
    )


def depends(plant: Plant) -> list[bool]:
    """On which parameters."""
    c = coordinates_of(plant, 1.0)
    return [d > 0 for d in degrees_of(lambda p: list(c.at(p)), c.breaks)]


def least_ranks(plant: Plant, *, controls: bool = True, measurements: bool = True) -> None:
    """Raises `InputError` where a control costs nothing or a measurement is free of disturbances at
    some p, and where the plant has none.
    """
    named = plant.channels
    for wanted, group in (
        (True, "disturbances"),
        (True, "performance"),
        (controls, "controls"),
        (measurements, "measurements"),
    ):
        if wanted and not getattr(named, group):
            raise InputError(f"the plant has no {group}: name them, Plant(model, {group}=[...])")
    at = plant.matrices(conditions(plant)[0])
    found: list[str] = []
    if controls:
        found += unpriced(at.D12, named.controls)
    if measurements:
        found += unpriced(np.swapaxes(at.D21, 1, 2), named.measurements, dual=True)
    if found:
        raise InputError("; ".join(found))


def failed(plant: Plant, attempts: Sequence[Attempt]) -> SynthesisError:
    """The error that says why: modes, directions and weights, and every program that was tried."""
    p, said = conditions(plant)
    least = min((a.bound for a in attempts), default=math.inf)
    why = reasons(
        plant.matrices(p),
        plant.channels,
        dt=plant.dt,
        at=said,
        gamma=least if math.isfinite(least) else None,
    )
    lines = why or (
        "nothing is wrong with the plant at frozen p: a lower rate, other functions for X and Y, or"
        " more divisions may help",
    )
    return SynthesisError(
        "no controller was found:\n  " + "\n  ".join([*lines, *map(str, attempts)]), tuple(lines)
    )


def _recover(
    coordinates: Coordinates, existence: Existence, found: Found
) -> Callable[[Array], Array]:
    X, Y, S = existence.X, existence.Y, existence.S
    assert X is not None  # noqa: S101 - all were asked for
    assert Y is not None  # noqa: S101
    assert S is not None  # noqa: S101
    parameters = coordinates.parameters

    def gains(p: Array) -> Array:
        at = coordinates.at(p)
        x, y, s = (u.at(found.coefficients, p) for u in (X, Y, S))
        if coordinates.dt is not None:
            return packed(joined(at, x, y, s, found.gamma))
        transformed = split(at, x, y, found.gamma)
        moving = None
        if X.moves and Y.moves:
            # dX/dt along the known motion; zero where p stands still
            known = [
                m and isinstance(s.rate, str)
                for m, s in zip(used(X.basis), parameters, strict=True)
            ]
            (motion,) = motions(parameters, p, coordinates.time, known)
            moving = X.moving(found.coefficients, p, motion)
        return packed(controller(at, x, y, transformed, constant_x=not X.moves, moving_x=moving))

    return gains


def packed(gains: Gains) -> Array:
    """[A B; C D] (K, ..)."""
    top, bottom = (np.concatenate(pair, axis=-1) for pair in (gains[:2], gains[2:]))
    return np.concatenate([top, bottom], axis=-2)


def in_plant_units(
    plant: Plant,
    c: Coordinates,
    gains: Callable[[Array], Array],
    gamma: float,
    method: str,
) -> Controller:
    """The controller in the units of the plant, of `gains` (K, ..) at p (K, m) in the scaled ones,
    as functions of p.
    """
    ny = len(plant.measurements)
    n = gains(np.array([[s.middle for s in plant.parameters]])).shape[-1] - ny
    pace = np.full(n, 1 / math.sqrt(c.time))
    rows = np.concatenate([pace, c.controls])
    columns = np.concatenate([pace, c.measurements])

    basis, M, misfit = fitted(gains, plant.parameters, ACCURACY)
    M = rows[:, None] * M * columns
    names = tuple(f"k{i + 1}" for i in range(n))
    model = LPVStateSpace(
        basis,
        M[:, :n, :n],
        M[:, :n, n:],
        M[:, n:, :n],
        M[:, n:, n:],
        plant.parameters,
        names,  # type: ignore[arg-type]
        plant.measurements,
        plant.controls,
        plant.dt,
    )
    return Controller(model=model, plant=plant, gamma=gamma, method=method, misfit=misfit)


def _fastest(model: LPVStateSpace) -> float:
    """The largest modulus of a pole, rad/s, of a continuous controller; 0 of another."""
    if model.dt is not None:
        return 0.0
    p = np.stack([np.linspace(s.low, s.high, 9) for s in model.parameters], axis=1)
    A = model.matrices(p[:, 0] if p.shape[1] == 1 else p).A
    return float(np.abs(np.linalg.eigvals(A)).max(initial=0.0))
