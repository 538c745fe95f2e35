"""Whether a model with the scheduling held is stable, as far as its coefficients are known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from scipy.stats import norm

from identification.design.criterion import Criterion, Verdict, table
from identification.judge.coefficient_covariance import drawn
from identification.judge.frozen_plant import (
    FrozenPlant,
    Model,
    Point,
    text,
    tuples,
    with_covariance,
)
from identification.judge.response_regions import StructureBias
from symheli import LinearModel
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole
from symheli.values.summary import summarized

BAND = 1.96
"""Factor of a bias in half a band."""

TOGETHER = 0.05
"""Probability that noise carries any of the points that are asked together out of its band."""

SMALL = 0.1
"""Draws are so many standard deviations wide, and what they move is scaled back: to first order.
The fastest of several slow modes of whole draws is faster on average than that of the truth.
"""

Call = Literal["stable", "unstable", "not known"]


@dataclass(frozen=True, eq=False)
class FrozenStability:
    """Growth rate of the fastest growing mode (the largest real part of a pole, 1/s) at points of
    the scheduling, with a band that noise leaves at none of them, with a probability of 95 %.

    Parameters
    ----------
    points : tuple
        Values of the scheduling.
    growth, low, high : array (K,)
        Of the estimate, and the ends of the band, 1/s.
    bias : array (K,), optional
        Part of half the band that longer records leave as it is, 1/s; default none.

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
    bias: Array = field(default_factory=lambda: np.zeros(0))

    __repr__ = summarized

    def __post_init__(self) -> None:
        frozen([np.ravel(p) for p in self.points], "points")
        if not np.size(self.bias):
            object.__setattr__(self, "bias", np.zeros(len(self.points)))
        for name in ("growth", "low", "high", "bias"):
            object.__setattr__(self, name, frozen(getattr(self, name), name, (len(self.points),)))

    @property
    def calls(self) -> tuple[Call, ...]:
        """The verdict at each point: "not known" where the band crosses the imaginary axis."""
        return tuple(
            "stable" if high < 0 else "unstable" if low > 0 else "not known"
            for low, high in zip(self.low, self.high, strict=True)
        )

    @property
    def longer(self) -> Array:
        """How many times as long records of the same kind decide each point (K,), if the estimate
        stays where it is; infinite where the bias is the larger part: then other flights do.
        """
        noise = 0.5 * (np.asarray(self.high) - self.low) - self.bias
        left = np.abs(self.growth) - self.bias
        with np.errstate(divide="ignore", over="ignore"):
            return np.where(left > 0, np.maximum((noise / left) ** 2, 1.0), np.inf)

    @property
    def advice(self) -> str:
        """The flights that would decide the points not known; empty where there are none."""
        unknown = np.array([call == "not known" for call in self.calls])
        if not unknown.any():
            return ""
        times = self.longer[unknown]
        by_length, parts = times[np.isfinite(times)], []
        if len(by_length):
            parts.append(
                f"{len(by_length)} need longer records of the same kind,"
                f" {by_length.min():.2g} to {by_length.max():.2g} times as long"
            )
        if len(by_length) < len(times):
            parts.append(
                f"at {len(times) - len(by_length)} the structure is off by more than the growth"
                " rate: hold each value of the scheduling for long, with less excitation"
            )
        return "; ".join(parts)

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """The growth rate at each point, 1/s; met where the whole band is below 0."""
        verdicts: dict[Call, Verdict] = {"stable": "fit", "unstable": "not fit"}
        return tuple(
            Criterion(
                name=f"growth rate at p = {text(p)}, 1/s",
                value=float(growth),
                threshold=0.0,
                verdict=verdicts.get(call, "not known"),
                where=f"95 % band {low:.3g} to {high:.3g}",
            )
            for p, growth, low, high, call in zip(
                self.points, self.growth, self.low, self.high, self.calls, strict=True
            )
        )

    def __str__(self) -> str:
        counts = (f"{call} at {self.calls.count(call)}" for call in get_args(Call))
        of = f"of {len(self.points)} points"
        lines = [f"with the scheduling held: {', '.join(counts)} {of}", table(self.criteria, "  ")]
        return "\n".join([*lines, *([f"  not known: {self.advice}"] if self.advice else [])])


def frozen_stability(
    model: Model,
    points: Iterable[Point],
    covariance: object = None,
    draws: int = 200,
    seed: int = 0,
    *,
    bias: StructureBias | None = None,
) -> FrozenStability:
    """Return whether the model is stable at points of the scheduling, by draws of its coefficients.

    Parameters
    ----------
    model : LPVARXModel, KinematicModel or StateSpaceModel
        Any.
    points : iterable
        Values of the scheduling: numbers, or tuples of one number a parameter. The 95 % are for all
        of them together (Bonferroni): of 27 points 3.1 standard deviations, of one 1.96.
    covariance : array (ny, n, ny, n), optional
        Of the coefficients; default `model.covariance`. Bands hold what it holds: noise, and as far
        as residuals show it what the structure leaves out.
    draws, seed : int
        Of a normal distribution.
    bias : StructureBias, optional
        From `structure_bias`, at the same points. Noise is then not all: the growth rate in the
        simulator is off by what the structure leaves out. The largest of three neighbouring points
        is added 1.96 times, as if noise had the same sign.

    Returns
    -------
    FrozenStability
        `.calls`, `.advice`, and `str()` that counts and shows them.

    Raises
    ------
    InputError
        No covariance, one of another shape, or a bias at other points.

    Examples
    --------
    >>> print(idn.judge.frozen_stability(model, [0.0]))
    with the scheduling held: stable at 1, unstable at 0, not known at 0 of 1 points
      criterion                  value  threshold  verdict  where
      growth rate at p = 0, 1/s  -6.93  at most 0  met      95 % band -6.94 to -6.91
    """
    covariance = model.covariance if covariance is None else covariance
    if covariance is None:
        raise InputError(
            f"covariance: method {model.method!r} gives none; {with_covariance(model)}, or give one"
        )
    covariance = frozen(covariance, "covariance", 2 * model.theta.shape[::-1])
    plant = FrozenPlant(model, tuple(map(str, model.outputs)), tuple(map(str, model.inputs)))
    free = plant.free
    draws = whole(draws, "draws", 2)
    thetas = drawn(model.theta, SMALL**2 * covariance, free, draws, seed)
    chosen = tuple(points)
    at = tuples(chosen)
    rates = np.array([_growth(plant, p, thetas) for p in at]).reshape(len(at), -1)
    growth = rates[:, 0]
    spread = np.sqrt(np.mean((rates[:, 1:] - growth[:, None]) ** 2, axis=1)) / SMALL
    off = np.zeros(len(at)) if bias is None else _growth_bias(bias, plant, at)
    half = norm.isf(TOGETHER / (2 * len(chosen))) * spread + BAND * off
    return FrozenStability(chosen, growth, growth - half, growth + half, BAND * off)


def _growth_bias(bias: StructureBias, plant: FrozenPlant, points: list[tuple[float, ...]]) -> Array:
    """Errors of growth rates (K,) in the simulator, the largest of three neighbours, 1/s."""
    bias.require(points)
    there = replace(plant, model=bias.model)
    of_each = zip(points, bias.exact.values(), strict=True)
    rates = np.array([_rates([there.at(*p), exact], plant.model.dt) for p, exact in of_each])
    off = np.pad(np.abs(rates[:, 0] - rates[:, 1]), 1, mode="edge")
    return np.asarray(np.max([off[:-2], off[1:-1], off[2:]], axis=0))


def _growth(plant: FrozenPlant, p: tuple[float, ...], thetas: Array) -> list[float]:
    """Growth rates of the estimate and of each draw at p, 1/s."""
    return _rates([plant.at(*p), *plant.of_each(thetas, *p)], plant.model.dt)


def _rates(models: Iterable[LinearModel], dt: float) -> list[float]:
    return [float(np.log(_radius(m.A))) / dt for m in models]


def _radius(A: Array) -> float:
    return max(float(np.abs(np.linalg.eigvals(A)).max(initial=0.0)), np.finfo(float).tiny)
