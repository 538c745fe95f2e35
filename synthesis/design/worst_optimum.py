"""The worst optimum of the models frozen at each p, which no scheduled controller can beat."""

from __future__ import annotations

from typing import TYPE_CHECKING

from symheli.lpv.bases.polynomials import lobatto_points
from symheli.progress import tracked
from synthesis.design.generalized import Generalized
from synthesis.design.hinf import optimum_above

if TYPE_CHECKING:
    from synthesis.design.plant import Plant

POINTS = {1: 33, 2: 5}
"""Values of each parameter (more parameters: 3)."""


def worst_optimum(plant: Plant) -> float:
    """The largest optimum of H-infinity output feedback over models of the range, to a part in a
    thousand; 0 where the Riccati equations of none have a solution.

    Without the part of a plant that is uncertain, and of some p only.
    """
    p = lobatto_points(POINTS.get(len(plant.parameters), 3), plant.nominal.box)
    least = 0.0
    for each in tracked("worst frozen optimum", list(zip(*plant.matrices(p), strict=True))):
        least = optimum_above(Generalized(*each), least, plant.dt)
    return least
