"""H-infinity output feedback for one model: the smallest level, and the central controller near
it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, overload

import numpy as np
from scipy import linalg, optimize

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv.linear_model import as_model
from symheli.values.arrays import Array
from synthesis.design.loops.controller import Controller
from synthesis.design.lti.central import Normalised, Obstacle, RiccatiTrial
from synthesis.design.lti.linear_quadratic import Matrices, lqg
from synthesis.design.lti.point_design import DesignStatus, PointDesign, checked, on_plant
from synthesis.design.plant.diagnosis import decided_by, reasons
from synthesis.design.plant.generalized import (
    Channels,
    Generalized,
    continuous_plant,
    sampled_controller,
)
from synthesis.design.plant.plant import Plant
from synthesis.design.plant.refusals import levels_above
from synthesis.numerics.linear.norm import norm

ACCURACY = 1e-10
"""Relative accuracy of the optimum."""

ROUGH_ACCURACY = 1e-3
"""Relative accuracy of an optimum that only serves for comparison."""

ZERO_LEVEL = 1e-9
"""A level below this fraction of the H-infinity norm of the LQG loop counts as zero."""

BACK_OFFS = 1.0, 1.02, 1.05, 1.2, 2.0, 10.0, 100.0, 1000.0
"""Factors by which the level is raised in turn where a controller does not keep it in the check."""

LEVEL_TOLERANCE = 1e-6
"""Relative excess of the norm of the loop over the level up to which the level counts as reached.
"""

MAX_DOUBLINGS = 40
"""Largest number of times that a level is doubled which was not reached although a controller
exists.
"""

MAX_TRIALS = 1000
"""Largest number of levels tried: a slack that jumps takes more of them than halving does."""

NOT_KEPT = "the loop of the central controller for gamma = {:.6g} does not keep that level"
NO_LEVEL = "the Riccati equations have no solution at any level, for no known reason"
NO_LEAST = (
    "gamma can be made arbitrarily small: the controller is the H2-optimal one; add measurement"
    " noise or control weights, which limit it"
)

MAX_LEVEL = 1e100
"""Largest level, and the inverse of the smallest: its square must neither over- nor underflow."""


@overload
def hinf(model: Plant, *, gamma: float | None = None, back_off: float = 1.01) -> Controller: ...
@overload
def hinf(
    model: LinearModel,
    controls: Sequence[str],
    measurements: Sequence[str],
    *,
    disturbances: Sequence[str] | None = None,
    performance: Sequence[str] | None = None,
    gamma: float | None = None,
    back_off: float = 1.01,
) -> PointDesign: ...
def hinf(
    model: Any,
    controls: Sequence[str] = (),
    measurements: Sequence[str] = (),
    *,
    disturbances: Sequence[str] | None = None,
    performance: Sequence[str] | None = None,
    gamma: float | None = None,
    back_off: float = 1.01,
) -> Any:
    """Design the H-infinity output-feedback controller of one model, continuous or sampled: of a
    `Plant` that depends on no parameter, or of a `LinearModel` with its channels.

    Two Riccati equations decide whether a level can be reached; the smallest is found to eight
    digits (five where noise or price are 1e-5 of the rest), and the central controller is that of a
    level `back_off` times higher, where it has no pole at infinity. D11 and D22 may be anything; a
    sampled model is taken through the bilinear transformation, which keeps the norm.

    Parameters
    ----------
    model : Plant, LinearModel or system of python-control
        From disturbances and controls to performance and measurements.
    controls, measurements : sequence of str
        Inputs that the controller commands, outputs that it reads; a plant names its own.
    disturbances, performance : sequence of str, optional
        The inputs and outputs between which the gain counts; default all others.
    gamma : float, optional
        Design at this level; the smallest is not sought.
    back_off : float
        At least 1; the level of the controller by the optimum.

    Returns
    -------
    Controller or PointDesign
        Of a plant the controller, with the norm of its loop `promised`. Of a model `optimum`, the
        controller u = K y, and the recomputed norm `hinf_norm` of its loop. Where there is no
        controller, `reasons` with the modes, controls or measurements that stand against it.

    Raises
    ------
    InputError
        A level or back-off that cannot be, another type of model, a plant that depends on p.
    SynthesisError
        No controller of a plant; with the reasons.
    UnknownNameError
        A signal that the model does not have.

    See Also
    --------
    synthesis.h2 : least variance of one model
    synthesis.output_feedback : a controller of the order of the plant
    synthesis.designs.mixed_sensitivity : weights on S, KS and T

    References
    ----------
    Doyle, Glover, Khargonekar, Francis, IEEE Trans. Automatic Control 34 (1989); Zhou, Doyle,
    Glover (1996), section 17.1 for D11.

    Examples
    --------
    x' = 3u + w1, y = 2x + w2, z = (x, u): the optimum is sqrt(1/9 + 1/4).

    >>> from symheli import LinearModel
    >>> plant = LinearModel(
    ...     [[0.0]], [[1.0, 0.0, 3.0]], [[1.0], [0.0], [2.0]],
    ...     [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
    ...     ["x"], ["w1", "w2", "u"], ["z1", "z2", "y"],
    ... )
    >>> design = hinf(plant, ["u"], ["y"])
    >>> print(f"{design.optimum:.7f} {design.hinf_norm:.3f}", design.controller.is_stable())
    0.6009252 0.607 True
    """
    if isinstance(model, Plant):
        design = partial(hinf, gamma=gamma, back_off=back_off)
        names = controls, measurements, disturbances, performance
        return on_plant(model, names, design, "H-infinity", gain=True)
    model = as_model(model)
    if gamma is not None and not 1 / MAX_LEVEL < gamma < MAX_LEVEL:
        raise InputError(
            f"gamma: expected a number from {1 / MAX_LEVEL:g} to {MAX_LEVEL:g}, got {gamma}"
        )
    levels_above(back_off)
    names = Channels.of(model, controls, measurements, disturbances, performance)
    plant = Generalized.between(model, names)
    if against := reasons(plant, names, dt=model.dt):
        return PointDesign.without(DesignStatus.IMPOSSIBLE, against)
    levels = _Levels.of(plant, model.dt)
    if gamma is not None:
        return _at(levels, plant, names, gamma)
    return _optimal(levels, plant, names, back_off)


class _Levels(NamedTuple):
    """The Riccati equations of a plant, solved at any level.

    `units` (nx,) of the states in which they are solved.
    """

    normal: Normalised
    units: Array
    dt: float | None

    @classmethod
    def of(cls, plant: Generalized, dt: float | None) -> _Levels:
        P = plant if dt is None else continuous_plant(plant)
        A, (units, _) = linalg.matrix_balance(P.A, permute=False, separate=True)
        into, out = 1 / units[:, None], units
        P = P._replace(A=A, B1=into * P.B1, B2=into * P.B2, C1=P.C1 * out, C2=P.C2 * out)
        return cls(Normalised.of(P), units, dt)

    def controller(self, trial: RiccatiTrial) -> Matrices | None:
        """Return the central controller for the original plant; None where it would not be
        causal.
        """
        A, B, C, D = self.normal.controller(trial)
        A, B, C = A * self.units[:, None] / self.units, B * self.units[:, None], C / self.units
        return (A, B, C, D) if self.dt is None else sampled_controller(A, B, C, D)


def optimum_above(plant: Generalized, level: float, dt: float | None) -> float:
    """Return the smallest level of a plant to a part in a thousand, or `level` where that can be
    reached or no level is found; without its controller.
    """
    try:
        normal = _Levels.of(plant, dt).normal
        if level > 0 and normal.trial(level).obstacle is None:
            return level
        found = _smallest(normal, level or 1.0, ROUGH_ACCURACY)
    except (np.linalg.LinAlgError, InputError):
        return level
    return level if found is None else max(level, found[0])


def slack(plant: Generalized, gamma: float, dt: float | None) -> float:
    """Return how far a level is above the smallest, as gamma^2 over the spectral radius of XY less
    one; not above 0 where it cannot be reached, inf where the equations cannot be written.
    """
    try:
        return _Levels.of(plant, dt).normal.trial(gamma).slack
    except (np.linalg.LinAlgError, InputError):
        return math.inf


def central_gains(plant: Generalized, gamma: float, dt: float | None) -> Matrices | None:
    """Return A, B, C, D of the central controller of this level, None where it cannot be
    reached.
    """
    levels = _Levels.of(plant, dt)
    trial = levels.normal.trial(gamma)
    return None if trial.obstacle is not None else levels.controller(trial)


def _at(levels: _Levels, plant: Generalized, names: Channels, gamma: float) -> PointDesign:
    """Return the central controller of this level, or why it cannot be reached."""
    obstacle = levels.normal.trial(gamma).obstacle
    if obstacle is not None:
        why = f"gamma = {gamma:.6g} is out of reach: {obstacle.value}"
        return PointDesign.without(
            DesignStatus.TOO_LOW, [why, *decided_by(plant, names, gamma, levels.dt)]
        )
    return _kept(levels, plant, names, gamma) or PointDesign.without(
        DesignStatus.FAILED, [NOT_KEPT.format(gamma)]
    )


def _optimal(levels: _Levels, plant: Generalized, names: Channels, back_off: float) -> PointDesign:
    """Return the central controller a little above the smallest level."""
    K = lqg(plant, levels.dt)
    simple = None if K is None else checked(plant, K, names, levels.dt)
    if simple is not None and simple.hinf_norm <= ZERO_LEVEL * _untouched(plant, simple):
        return replace(simple, optimum=0.0, reasons=(NO_LEAST,))
    found = _smallest(levels.normal, 1.0 if simple is None else simple.hinf_norm)
    if found is None:
        return PointDesign.without(DesignStatus.FAILED, [NO_LEVEL])
    optimum, obstacle = found
    if optimum == 0.0 and simple is not None:
        return replace(simple, optimum=0.0, reasons=(NO_LEAST,))
    limit = "" if obstacle is None else f"a lower level is out of reach: {obstacle.value}"
    for more in BACK_OFFS:
        design = _kept(levels, plant, names, optimum * back_off * more)
        if design is not None:
            about = decided_by(plant, names, optimum, levels.dt, reached=design.hinf_norm)
            optimum = min(optimum, design.hinf_norm)  # within rounding, where the norm cannot move
            return replace(design, optimum=optimum, limit=limit, reasons=tuple(about))
    level = optimum * back_off * BACK_OFFS[-1]
    return PointDesign.without(DesignStatus.FAILED, [NOT_KEPT.format(level), limit], optimum)


def _untouched(plant: Generalized, design: PointDesign) -> float:
    """Return the gain of the loop if the controls did not enter the performance, the scale of
    rounding.
    """
    assert design.loop is not None  # noqa: S101
    A, B, C = design.loop.A, design.loop.B, np.zeros(design.loop.C.shape)
    C[:, : len(plant.A)] = plant.C1
    return norm(A, B, C, plant.D11, design.loop.dt)[0]


def _kept(levels: _Levels, plant: Generalized, names: Channels, gamma: float) -> PointDesign | None:
    """Return the central controller of a level, if its loop keeps it."""
    trial = levels.normal.trial(gamma)
    K = None if trial.obstacle is not None else levels.controller(trial)
    if K is None:
        return None
    design = checked(plant, K, names, levels.dt)
    return (
        design if design is not None and design.hinf_norm <= gamma * (1 + LEVEL_TOLERANCE) else None
    )


def _smallest(
    normal: Normalised, start: float, accuracy: float = ACCURACY
) -> tuple[float, Obstacle | None] | None:
    """Return the smallest level, and the obstacle to a lower one; 0 where none is too low, None
    where none was found.

    `start`: a level that some controller reaches. The root of the slack of the coupling condition,
    or of what takes its place, the jump to where an equation has no solution.
    """
    least = normal.least()
    high = max(start * (1 + 1e-6), least * (1 + 1e-6), 1e-300)
    for _ in range(MAX_DOUBLINGS):
        if normal.trial(high).obstacle is None:
            break
        high *= 2
    else:
        return None
    low = max(least, ZERO_LEVEL * high)
    below = normal.trial(low)
    if below.obstacle is None:
        return 0.0, None
    good, bad = high, below
    ends = {
        math.log(low): low,
        math.log(high): high,
    }  # exp(log(high)) may round below it, unreached

    def slack(log_gamma: float) -> float:
        nonlocal good, bad
        trial = normal.trial(ends.get(log_gamma) or math.exp(log_gamma))
        if trial.obstacle is None:
            good = min(good, trial.gamma)
        elif trial.gamma > bad.gamma:
            bad = trial
        # 0, a root met exactly, would end the search with `good` wherever above it was
        return min(trial.slack, 1.0) or -sys.float_info.min

    optimize.brentq(slack, *ends, xtol=accuracy, maxiter=MAX_TRIALS)
    return good, bad.obstacle
