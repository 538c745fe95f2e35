"""Airspeeds between trims at which the equations have a corner."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from symheli.helicopter import Helicopter
from symheli.steady.steady_flights import ALONE, SteadyFlights
from symheli.steady.trim_batch import TrimBatch, trimmed, unknowns
from symheli.values.arrays import Array

ACCURACY = 1e-6
"""Of an airspeed at which there is a corner, m/s."""
_MEANINGLESS = 1e-7  # a switching function that stays below this is zero, not switching
_QUARTERS = np.array([0.25, 0.5, 0.75])
CUTS = len(_QUARTERS) + 3


def kink_speeds(heli: Helicopter, trims: TrimBatch) -> Mapping[str, tuple[float, ...]]:
    """Airspeeds (m/s) between neighbouring trims at which a switching function changes sign, to
    `ACCURACY`, by cause.
    """
    names = [name for name in trims.switches if not name.endswith("vortex ring")]  # no corner
    values = np.array([trims.switches[name] for name in names]).reshape(len(names), -1)
    before, after = values[:, :-1], values[:, 1:]
    changes = (before * after < 0) & (np.minimum(abs(before), abs(after)) > _MEANINGLESS)
    which, between = np.nonzero(changes)
    if not len(which):
        return {}
    found = _crossings(heli, trims, [names[i] for i in which], between)
    return {name: tuple(found[which == i].tolist()) for i, name in enumerate(names) if i in which}


def _crossings(heli: Helicopter, trims: TrimBatch, names: list[str], between: Array) -> Array:
    """Where each of the named functions changes sign after the trim `between`: every bracket is cut
    at its quarters and about the root of its secant, all cuts side by side, until it is short.
    """
    conditions = trims.conditions
    ends = conditions.airspeed[np.stack([between, between + 1], axis=1)]
    values = _values(trims, names, np.stack([between, between + 1], axis=1))
    start = np.repeat(between, CUTS)
    while np.any(np.ptp(ends, axis=1) > ACCURACY):
        cuts = _cuts(ends, values)
        # where the equations jump there may be no trim: the nearest point says which side it is
        flights = SteadyFlights(
            [heli],
            np.zeros(cuts.size, int),
            replace(conditions.at(start), airspeed=cuts.ravel()),
        )
        found = trimmed(flights, unknowns(flights, trims.at(start)), ALONE, throw=False)
        at = np.arange(cuts.size).reshape(cuts.shape)
        edges = np.column_stack([ends[:, 0], cuts, ends[:, 1]])
        heights = np.column_stack([values[:, 0], _values(found, names, at), values[:, 1]])
        beyond = (np.sign(heights) != np.sign(heights[:, :1])).argmax(axis=1)
        pair = np.stack([beyond - 1, beyond], axis=1)
        ends = np.take_along_axis(edges, pair, axis=1)
        values = np.take_along_axis(heights, pair, axis=1)
    return _root(ends, values)


def _values(trims: TrimBatch, names: list[str], at: Array) -> Array:
    """The named function of each row at the trims `at` (n, m) of that row."""
    return np.array([trims.switches[name][k] for name, k in zip(names, at, strict=True)])


def _cuts(ends: Array, values: Array) -> Array:
    """Airspeeds (n, CUTS) in each bracket, increasing."""
    low, width = ends[:, :1], np.ptp(ends, axis=1)[:, None]
    root = _root(ends, values)[:, None]
    # a secant misses by the square of the width; a quarter is cut off where it does not help
    near = root + np.array([-1.0, 0.0, 1.0]) * np.maximum(width / 64, 0.4 * ACCURACY)
    cuts = np.hstack([low + width * _QUARTERS, near])
    return np.sort(np.clip(cuts, low, ends[:, 1:]), axis=1)


def _root(ends: Array, values: Array) -> Array:
    """Of the straight line through the ends of each bracket."""
    low, high = ends.T
    return low - values[:, 0] * (high - low) / (values[:, 1] - values[:, 0])
