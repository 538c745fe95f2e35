"""Gains that were computed in scaled coordinates as a controller in the units of its plant."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from symheli.lpv import LPVStateSpace
from synthesis.loops.controller import Controller
from synthesis.lpv.coordinates import Coordinates
from synthesis.lpv.fitted import Fitted
from synthesis.lpv.recovery import Gains

if TYPE_CHECKING:
    from synthesis.plant.plant import Plant

Array = np.ndarray


def packed(gains: Gains) -> Array:
    """[A B; C D] (K, ..)."""
    top, bottom = (np.concatenate(pair, axis=-1) for pair in (gains[:2], gains[2:]))
    return np.concatenate([top, bottom], axis=-2)


def in_plant_units(
    plant: Plant, c: Coordinates, fit: Fitted, gamma: float, method: str
) -> Controller:
    """The controller in the units of the plant, of gains in the scaled ones as functions of p."""
    basis, M, misfit = fit
    ny = len(plant.measurements)
    n = M.shape[-1] - ny
    pace = np.full(n, 1 / math.sqrt(c.time))
    rows = np.concatenate([pace, c.controls])
    columns = np.concatenate([pace, c.measurements])
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
    return Controller(model=model, plant=plant, promised=gamma, method=method, misfit=misfit)
