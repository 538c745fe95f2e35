"""A plant in which every control costs and every measurement is noisy, by as little as a design
needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from symheli.values.arrays import Array
from symheli.values.signal import Signal
from synthesis.design.lpv.worst_optimum import worst_optimum
from synthesis.design.plant.diagnosis import NAMED_FRACTION, free_directions
from synthesis.design.plant.generalized import Generalized, continuous_plant
from synthesis.design.plant.plant import Plant
from synthesis.design.plant.refusals import conditions

SHARES = (1e-2, 1e-3, 1e-4)
"""Noise in shares of what the disturbances do to a measurement, and costs in shares of what a
control does to the performance: the first that counts for little.
"""

LITTLE = 1.005
"""By so much a share may raise the worst frozen optimum, beside a tenth of it."""


def regular(plant: Plant) -> Iterator[tuple[Plant, tuple[str, ...]]]:
    """Yield the plant with a noise on every measurement that has none, and a cost of every control
    that has none, and a sentence on each; only the plant itself where nothing is missing. First as
    little as matters, then more, for where solvers run out of digits.

    The performance of a controller with the plant is not worse than with the one yielded, which has
    more disturbances and outputs. The Riccati equations and the formulas of the controller want D21
    of full row rank and D12 of full column rank.
    """
    p, _ = conditions(plant)
    at = plant.matrices(p)
    free = _named(at.D12, plant.controls)
    silent = _named(np.swapaxes(at.D21, 1, 2), plant.measurements)
    if not free and not silent:
        yield plant, ()
        return
    each = [Generalized(*(M[k] for M in at)) for k in range(len(p))]
    costs = _sizes([P.dual for P in each], plant.controls, free, plant.dt)
    noises = _sizes(each, plant.measurements, silent, plant.dt)
    tried = [(share, _with(plant, costs, noises, share)) for share in SHARES]
    before = math.inf
    for least, (_, changed) in enumerate(tried):
        level = worst_optimum(changed).level
        if level > 0 and before <= LITTLE * level:
            tried = tried[:least]
            break
        before = level or math.inf
    for share, changed in reversed(tried):
        noisy = (
            f"{y} had no noise: the design has one of {share * size:.2g} {y.unit} on it"
            for y, size in noises.items()
        )
        costly = (
            f"{u} had no cost: the design has {share * size:.2g} {u} in the performance"
            for u, size in costs.items()
        )
        yield changed, (*noisy, *costly)


def _named(D: Array, names: Sequence[Signal]) -> list[Signal]:
    """The signals in the directions of the columns of D (K, m, n) that it does not see."""
    found: dict[Signal, None] = {}
    for each in D:
        for direction in free_directions(each).T:
            size = np.abs(direction) / np.abs(direction).max()
            found |= {n: None for n, s in zip(names, size, strict=True) if s >= NAMED_FRACTION}
    return list(found)


def _sizes(
    plants: Sequence[Generalized],
    names: Sequence[Signal],
    wanted: Sequence[Signal],
    dt: float | None,
) -> dict[Signal, float]:
    """Typical response of these measurements to the disturbances: the median over the plants, at
    the frequencies of their modes; 1 where there is none.
    """
    gains = []
    for P in plants:
        P = P if dt is None else continuous_plant(P)
        at = np.abs(np.linalg.eigvals(P.A))
        for omega in [*at[at > 0], 1.0]:
            response = np.linalg.solve(1j * omega * np.eye(len(P.A)) - P.A, P.B1)
            gains.append(np.linalg.norm(P.C2 @ response + P.D21, axis=1))
    typical = np.median(gains, axis=0)
    return {y: float(size) or 1.0 for y, size in zip(names, typical, strict=True) if y in wanted}


def _with(
    plant: Plant, costs: Mapping[Signal, float], noises: Mapping[Signal, float], share: float
) -> Plant:
    return plant.with_cost({u: share * size for u, size in costs.items()}).with_noise(
        {y: share * size for y, size in noises.items()}
    )
