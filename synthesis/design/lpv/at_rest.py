"""Output feedback for constant parameters: the central H-infinity controllers of the frozen models
as functions of p, for plants whose LMIs in X and Y have no solution.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.certify.statement.outcome import Attempt
from synthesis.design.lpv.fitted import Fitted
from synthesis.design.lpv.recovery import Gains
from synthesis.design.lpv.scaled_plant import ScaledPlant, scaled_plant_of
from synthesis.design.lpv.search import check_points, closed, simplest, with_knots
from synthesis.design.lpv.worst_optimum import FrozenOptimum
from synthesis.design.lti.hinf import central_gains
from synthesis.design.plant.generalized import Generalized

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant


class AtRest(NamedTuple):
    """Gains as functions of p that keep `gamma` at every constant p."""

    scaled: ScaledPlant
    fit: Fitted
    gamma: float


def at_rest(
    plant: Plant, worst: FrozenOptimum, factors: Sequence[float], attempts: list[Attempt]
) -> Iterator[AtRest]:
    """Yield such gains for these multiples of the `worst` frozen optimum."""
    scaled = scaled_plant_of(plant, worst.level)
    points = check_points(plant.parameters, worst.p)
    for factor in tracked("central controllers of frozen models", factors):
        gains = partial(_central, scaled, factor)
        fit, outcome = None, "no functions of p keep it"
        try:
            for fit_of in (simplest, with_knots):
                fit = fit or fit_of(scaled, gains, closed, points, factor)
        except np.linalg.LinAlgError:
            outcome = "not every frozen model has such a controller"
        if fit is not None:
            outcome = f"functions of p within {fit.misfit:.1e}"
        name = f"central controllers at {factor:g} of the worst frozen optimum"
        attempts.append(Attempt(name, 0.0, outcome, factor * worst.level))
        if fit is not None:
            yield AtRest(scaled, fit, factor * worst.level)


def _central(scaled: ScaledPlant, level: float, p: Array) -> Array:
    """Return [A B; C D] (K, ..) of the central controllers of the models frozen at p (K, m); raises
    `LinAlgError` where one has none of this level.
    """
    out = []
    for each in zip(*scaled.at(p), strict=True):
        found = central_gains(Generalized(*each), level, scaled.dt)
        if found is None:
            raise np.linalg.LinAlgError
        out.append(Gains(*found))
    return Gains(*(np.array(M) for M in zip(*out, strict=True))).packed
