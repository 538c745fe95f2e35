"""Conditions all over the range of a plant, at which it is looked at frozen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symheli.lpv.bases.polynomials import lobatto_points

if TYPE_CHECKING:
    from synthesis.plant.plant import Plant

Array = np.ndarray


def conditions(plant: Plant) -> tuple[Array, list[str]]:
    """Some p all over the box, as `Plant.matrices` takes them, and what to call each."""
    p = lobatto_points(5 if len(plant.parameters) == 1 else 3, plant.nominal.box)
    names = [s.name for s in plant.parameters]
    said = [
        ", ".join(f"{n} = {v:g}" for n, v in zip(names, np.atleast_1d(q), strict=True)) for q in p
    ]
    return p, said
