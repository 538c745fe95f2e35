"""Airspeeds between trims at which the equations have a corner."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from symheli.helicopter import Helicopter
from symheli.steady.equilibrium import Equilibrium
from symheli.steady.flight_conditions import FlightConditions
from symheli.steady.newton import TOLERANCE
from symheli.steady.steady_flights import ALONE, SteadyFlights
from symheli.steady.trim_batch import TrimBatch, unknowns
from symheli.values.arrays import Array

ACCURACY = 1e-6
"""Accuracy of an airspeed at which there is a corner, m/s."""
_MEANINGLESS = 1e-7  # a switching function that stays below this is zero, not switching
_QUARTERS = np.array([0.25, 0.5, 0.75])
CUTS = len(_QUARTERS) + 3


def kink_speeds(heli: Helicopter, trims: TrimBatch) -> Mapping[str, tuple[float, ...]]:
    """Airspeeds (m/s) between neighbouring trims at which a switching function changes sign, to
    `ACCURACY`, by cause. Where the equations jump there may be none: then the end of the trims
    before the jump.
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
    """Return where each of the named functions changes sign after the trim `between`: every bracket
    is cut at its quarters and about the root of its secant, all side by side, until it is short.
    """
    at = np.stack([between, between + 1], axis=1)
    ends = trims.conditions.airspeed[at]
    values = np.array([trims.switches[name][k] for name, k in zip(names, at, strict=True)])
    # in each bracket one cut after the other, the brackets side by side
    midway = trims.conditions[np.tile(between, CUTS)]
    start = unknowns(heli, trims)[between]
    while np.any(np.ptp(ends, axis=1) > ACCURACY):
        cuts = _cuts(ends, values)
        found, heights = _heights(heli, midway, names, cuts, start)
        edges = np.column_stack([ends[:, 0], cuts, ends[:, 1]])
        # where there is no trim, as beyond the change
        heights = np.where(found, heights, -values[:, :1])
        heights = np.column_stack([values[:, 0], heights, values[:, 1]])
        pair = _changing(heights, found)
        ends = np.take_along_axis(edges, pair, axis=1)
        values = np.take_along_axis(heights, pair, axis=1)
    return _root(ends, values)


def _heights(
    heli: Helicopter, requested: FlightConditions, names: list[str], cuts: Array, start: Array
) -> tuple[Array, Array]:
    """Whether there is a trim at each cut (n, CUTS), and the function of its row there."""
    n, count = cuts.shape
    conditions = replace(requested, airspeed=cuts.T.ravel())
    flights = SteadyFlights([heli], np.zeros(n * count, int), conditions)
    after = np.maximum(np.arange(n * count) - n, ALONE)
    z, miss = flights.solved(np.tile(start, (count, 1)), after)
    found = (miss < TOLERANCE).reshape(count, n)
    for bracket in np.flatnonzero(~found.all(axis=0)).tolist():
        first = int(found[:, bracket].argmin())  # the others are beyond it
        k = first * n + bracket
        alone = Equilibrium(heli, conditions[k])
        z[k] = alone.solve(z[k - n] if first else start[bracket])
        found[first, bracket] = alone.miss(z[k]) < TOLERANCE
    switches = flights.points(z).switches.reshape(count, n, -1)
    columns = [flights.equations.switches.index(name) for name in names]
    return found.T, switches[:, np.arange(n), columns].T


def _changing(heights: Array, found: Array) -> Array:
    """Positions (n, 2) of the neighbours between which the sign of each row changes; where there is
    no trim on the way, the last before that and the first without one.
    """
    n = len(heights)
    known = np.column_stack([np.ones(n, bool), found, np.ones(n, bool)])
    changed = known & (np.sign(heights) != np.sign(heights[:, :1]))
    first = changed.argmax(axis=1)[:, None]
    positions = np.arange(heights.shape[1])
    last = np.where(known & (positions < first), positions, 0).max(axis=1)
    return np.stack([last, last + 1], axis=1)


def _cuts(ends: Array, values: Array) -> Array:
    """Airspeeds (n, CUTS) in each bracket, increasing."""
    low, width = ends[:, :1], np.ptp(ends, axis=1)[:, None]
    root = _root(ends, values)[:, None]
    # a secant misses by the square of the width; a quarter is cut off where it does not help
    near = root + np.array([-1.0, 0.0, 1.0]) * np.maximum(width / 64, 0.4 * ACCURACY)
    cuts = np.hstack([low + width * _QUARTERS, near])
    return np.sort(np.clip(cuts, low, ends[:, 1:]), axis=1)


def _root(ends: Array, values: Array) -> Array:
    """Return the root of the straight line through the ends of each bracket."""
    low, high = ends.T
    return low - values[:, 0] * (high - low) / (values[:, 1] - values[:, 0])
