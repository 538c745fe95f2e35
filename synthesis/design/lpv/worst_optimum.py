"""The largest optimum over the models frozen at each p, a lower bound for every scheduled
controller.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import optimize

from symheli.lpv.bases.polynomials import lobatto_points
from symheli.progress import tracked
from symheli.values.arrays import Array
from synthesis.design.lti.hinf import ROUGH_ACCURACY, optimum_above, slack
from synthesis.design.plant.generalized import Generalized

if TYPE_CHECKING:
    from synthesis.design.plant.plant import Plant

POINTS = {1: 65, 2: 5}
"""Number of values of each parameter (more parameters: 3)."""
MAX_MINIMA, MAX_EVALUATIONS, MAX_ROUNDS = 4, 12, 6
"""Between the points, the worst is searched near so many minima of the slack, with so many
evaluations each, again while the level rises.
"""
NEAR = 0.1
"""Slack up to which a minimum is looked at: gamma 5 % above the smallest there."""


class FrozenOptimum(NamedTuple):
    """Lower bound on the level of every scheduled controller, and the p (m,) of the model that
    decides it; 0 and None where none was found.
    """

    level: float = 0.0
    p: Array | None = None


def worst_optimum(plant: Plant) -> FrozenOptimum:
    """Return the largest optimum of H-infinity output feedback over models of the range, to a part
    in a thousand; of level 0 where the Riccati equations of none have a solution.

    Without the part of a plant that is uncertain, and of some p only; of one parameter also of
    those between them where the worst may be.
    """
    box = plant.box
    p = lobatto_points(POINTS.get(len(box), 3), box).reshape(-1, len(box))

    def at(q: Array) -> Generalized:
        (each,) = zip(*plant.matrices(q[None] if len(box) > 1 else q), strict=True)
        return Generalized(*each)

    worst = FrozenOptimum()

    def raised(q: Array) -> FrozenOptimum:
        level = optimum_above(at(q), worst.level, plant.dt)
        return FrozenOptimum(level, q) if level > worst.level else worst

    for q in tracked("worst frozen optimum", [p[k] for k in _coarse_to_fine(len(p))]):
        worst = raised(q)
    if len(box) > 1 or worst.level == 0:
        return worst

    def spare(q: float) -> float:
        return slack(at(np.array([q])), worst.level, plant.dt)

    line = np.sort(p.ravel())
    found = np.pad([spare(q) for q in line], 1, constant_values=math.inf)
    lowest = (found[1:-1] <= found[:-2]) & (found[1:-1] <= found[2:]) & (found[1:-1] <= NEAR)
    low = np.flatnonzero(lowest)
    for k in low[np.argsort(found[1:-1][low])][:MAX_MINIMA]:
        ends = line[max(k - 1, 0)], line[min(k + 1, len(line) - 1)]
        for _ in range(MAX_ROUNDS):  # out of reach, a level is so by no measure: raised, by another
            before = worst
            worst = raised(
                np.array([optimize.fminbound(spare, *ends, maxfun=MAX_EVALUATIONS, disp=0)])
            )
            if worst.level <= before.level * (1 + ROUGH_ACCURACY):
                break
    return worst


def _coarse_to_fine(count: int) -> list[int]:
    """Return the numbers below `count`, the ends first, then the middle of every gap: near the
    worst, a level is then seldom raised, which takes ten times as long as to see that it stands.
    """
    order = [0, count - 1]
    step = count - 1
    while step > 1:
        step = (step + 1) // 2
        order += range(0, count, step)
    return list(dict.fromkeys(order))
