"""Whether a model with the scheduling held is stable, as far as its coefficients are known."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from identification.judge.coefficient_covariance import drawn
from identification.judge.frozen_plant import FrozenPlant, Model, Point, text
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.summary import summarized

BAND = 1.96
"""Half width of a band in standard deviations: 95 %."""

SMALL = 0.1
"""Draws are so many standard deviations wide, and what they move is scaled back: to first order.
The fastest of several slow modes of whole draws is faster on average than that of the truth.
"""

Call = Literal["stable", "unstable", "not known"]


@dataclass(frozen=True, eq=False)
class FrozenStability:
    """Growth rate of the fastest growing mode (the largest real part of a pole, 1/s) at points of
    the scheduling, with its 95 % band.

    Parameters
    ----------
    points : tuple
        Values of the scheduling.
    growth, low, high : array (K,)
        Of the estimate, and the ends of the band, 1/s.

    Examples
    --------
    >>> from identification.judge.frozen_stability import FrozenStability
    >>> found = FrozenStability((0.0, 5.0), [0.02, -0.3], [-0.01, -0.5], [0.05, -0.2])
    >>> found.calls
    ('not known', 'stable')
    """

    points: tuple[Point, ...]
    growth: Array
    low: Array
    high: Array

    __repr__ = summarized

    def __post_init__(self) -> None:
        frozen([np.ravel(p) for p in self.points], "points")
        for name in ("growth", "low", "high"):
            object.__setattr__(self, name, frozen(getattr(self, name), name, (len(self.points),)))

    @property
    def calls(self) -> tuple[Call, ...]:
        """The verdict at each point: "not known" where the band crosses the imaginary axis."""
        return tuple(
            "stable" if high < 0 else "unstable" if low > 0 else "not known"
            for low, high in zip(self.low, self.high, strict=True)
        )

    def __str__(self) -> str:
        calls = self.calls
        open_ = [text(p) for p, call in zip(self.points, calls, strict=True) if call == "not known"]
        return (
            f"with the scheduling held: stable at {calls.count('stable')}, unstable at"
            f" {calls.count('unstable')} of {len(calls)} points; not known at"
            f" {len(open_)}" + (f": p = {'; '.join(open_)}" if open_ else "")
        )


def frozen_stability(
    model: Model,
    points: Iterable[Point],
    covariance: object = None,
    draws: int = 200,
    seed: int = 0,
) -> FrozenStability:
    """Return whether the model is stable at points of the scheduling, by draws of its coefficients.

    Parameters
    ----------
    model : LPVARXModel or KinematicModel
        Any.
    points : iterable
        Values of the scheduling: numbers, or tuples of one number a parameter.
    covariance : array (ny, n, ny, n), optional
        Of the coefficients; default `model.covariance`. Bands hold what it holds: noise, and as far
        as residuals show it what the structure leaves out.
    draws, seed : int
        Of a normal distribution.

    Returns
    -------
    FrozenStability
        `.calls`, and `str()` that counts them.

    Raises
    ------
    InputError
        No covariance, or one of another shape.

    Examples
    --------
    >>> print(idn.judge.frozen_stability(model, [-0.5, 0.0, 0.5]))
    with the scheduling held: stable at 3, unstable at 0 of 3 points; not known at 0
    """
    covariance = model.covariance if covariance is None else covariance
    if covariance is None:
        raise InputError(
            f"covariance: method {model.method!r} gives none; fit by FilterError or least squares,"
            " or give one"
        )
    covariance = frozen(covariance, "covariance", 2 * model.theta.shape[::-1])
    plant = FrozenPlant(model, tuple(map(str, model.outputs)), tuple(map(str, model.inputs)))
    free = plant.regression.free
    draws = whole(draws, "draws", 2)
    thetas = drawn(model.theta, SMALL**2 * covariance, free, draws, seed)
    chosen = tuple(points)
    if not chosen:
        raise InputError("points: give at least one value of the scheduling")
    rates = np.array([_growth(plant, p, thetas) for p in chosen]).reshape(len(chosen), -1)
    growth = rates[:, 0]
    spread = np.sqrt(np.mean((rates[:, 1:] - growth[:, None]) ** 2, axis=1)) / SMALL
    return FrozenStability(chosen, growth, growth - BAND * spread, growth + BAND * spread)


def _growth(plant: FrozenPlant, p: Point, thetas: Array) -> Sequence[float]:
    """Growth rates of the estimate and of each draw at p, 1/s."""
    at = p if isinstance(p, tuple) else (p,)
    models = [plant.at(*at), *plant.of_each(thetas, *at)]
    return [float(np.log(_radius(m.A))) / plant.model.dt for m in models]


def _radius(A: Array) -> float:
    return max(float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)), np.finfo(float).tiny)
