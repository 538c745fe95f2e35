"""What keeps a tube from being proven: how fast what is bounded in size alone may move the
deviations, and how much smaller the tube would be without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from evidence.tables import markdown
from symheli import Helicopter, trim
from symheli.errors import InputError
from synthesis.numerics.program.cone_program import Solver
from synthesis.tubes.controllers import Choice
from synthesis.tubes.deviations import CommandCell, Deviations
from synthesis.tubes.inequality import MatrixSet
from synthesis.tubes.reference import TUBE_SIZES, moving
from synthesis.tubes.search import smallest
from synthesis.tubes.tube import (
    FIRST_SHARE,
    FIRST_SIZE,
    SPARE,
    TOLERANCE,
    coordinates,
    enclosed_cells,
    inside,
    of_linear_loop,
)

Array = np.ndarray

INTERVALS = (3.0, 5.0, 7.0, 8.0, 9.0, 10.0, 12.0)
"""Where remainders are shown, m/s."""
SMALL_TUBE = 0.1
"""Its half widths, in units of `TUBE_SIZES`."""
LIMITS = (1.0, 1.0, 1.0)
"""Acceleration, jerk and snap of the commands, m/s^2, m/s^3, m/s^4."""
HELD_AGAINST = ((3.0, 0.5), (7.0, 0.5), (12.0, 0.5), (12.0, 0.25))
"""Where the tube needed is held against the one enclosed: intervals of 1 m/s from here, and gusts,
m/s.
"""
ACCELERATIONS = np.linspace(-1.0, 1.0, 5)
"""Ends of their cells, m/s^2."""
BEYOND = 1.2
"""The ellipsoids enclosed, in units of those of the linear loop."""
GONE = 1e-3
"""Factor on what is left out: without any of it multipliers have no bound."""

SIZES = np.array(TUBE_SIZES[:10])


def remainders(vehicle: str, intervals: Sequence[float]) -> str:
    """For cells of 1 m/s, and accelerations from 0 to 1 m/s^2, the rates (1/s) at which terms of
    the Jacobian that are bounded in size alone may move the deviations, on a small tube, in
    Markdown; with the feedback of a range of airspeeds, and with that of a held one.
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    rows = []
    for low in intervals:
        nodes = np.array([low, low + 1])
        steady = [trim(heli, airspeed=p) for p in nodes]
        alike = [Choice().regulator(heli, np.array(at.x), np.array(at.u)) for at in steady]
        cells = [_rates(heli, nodes, choice) for choice in (Choice(), Choice(alike))]
        rows.append([f"{low:g} to {low + 1:g}", *cells[0], *cells[1]])
    head = ["largest kink, 1/s", "remainder of p q r, 1/s"]
    alike_head = [f"{name}, all controls of equal weight" for name in head]
    return markdown(["airspeed, m/s", *head, *alike_head], rows)


def _rates(heli: Helicopter, nodes: Array, choice: Choice) -> list[str]:
    """Rates (1/s) of the largest kink, and of the remainders of p, q and r, as two cells."""
    units = np.concatenate([SMALL_TUBE * SIZES, np.ones(4)])
    loop = Deviations(heli, moving(heli, nodes, LIMITS, choice), 0.0)
    cell = CommandCell(0, (0.0, 1.0), (0.0, 1.0))
    (over,) = loop.enclosed([cell], np.diag(units[:10])[None], loop.drifts([cell]))
    if over is None:
        raise InputError(f"no bounds from {nodes[0]:g} to {nodes[1]:g} m/s")
    across = np.sqrt(np.einsum("kii,i->k", over.weights[:, :-1, :-1], units[:-1] ** 2))
    rates, own = across * np.abs(over.left / units[:10]).max(axis=1), _remainder(over)
    row = dict(zip(np.abs(over.left[own]).argmax(axis=1), rates[own], strict=True))
    kinks = max(rates[~own], default=0.0)
    return [f"{kinks:.2g}", " ".join(f"{row.get(i, 0.0):.2g}" for i in (3, 4, 5))]


def _remainder(over: MatrixSet) -> Array:
    """Which terms are the remainder of one row each, that of what the reference misses included."""
    return (over.left != 0).sum(axis=1) == 1


def _kinks(over: MatrixSet) -> Array:
    """Which terms are kinks: the others move the deviation where it is 0 too."""
    return ~_remainder(over) & (over.weights[:, -1, -1] == 0)


def held_against(vehicle: str, cases: Sequence[tuple[float, float]]) -> str:
    """How many times larger than the deviations enclosed the ones needed are, in the direction
    where it is worst, in Markdown: with all terms, and without one kind of them. Below 1 the search
    ends with a tube.
    """
    heli = Helicopter.load(vehicle, governor="ideal")
    kinds = {
        "all terms": lambda over: over,
        "the reference misses nothing": _consistent,
        "no kinks": lambda over: _without(over, _kinks(over)),
        "no remainder": lambda over: _without(over, _remainder(over)),
        "no part linear in the deviations": lambda over: over._replace(
            tube=GONE * over.tube, gust=GONE * over.gust
        ),
    }
    rows = []
    for low, gust in cases:
        needed = _needed(heli, low, gust, list(kinds.values()))
        rows.append([f"{low:g} to {low + 1:g}", f"{gust:g}", *needed])
    return markdown(["airspeed, m/s", "gusts, m/s", *kinds], rows)


def _needed(
    heli: Helicopter, low: float, gust: float, kinds: Sequence[Callable[[MatrixSet], MatrixSet]]
) -> list[str]:
    """For each kind of terms the deviations needed over those enclosed, at most."""
    nodes = np.array([low, low + 1])
    loop = Deviations(heli, moving(heli, nodes, LIMITS), gust)
    cells = [CommandCell(0, (0.0, 1.0), ends) for ends in pairwise(ACCELERATIONS.tolist())]
    drifts, root = loop.drifts(cells), FIRST_SIZE * np.diag(SIZES)
    linear = enclosed_cells(loop, cells, np.stack([root] * len(cells)), drifts, FIRST_SHARE)
    if linear is None:
        raise InputError(f"no bounds from {low:g} to {low + 1:g} m/s")
    solver = Solver(tolerance=TOLERANCE)
    found = of_linear_loop(loop, cells, linear, np.stack([root] * 2), SIZES, solver)
    if found is None:
        return ["no ellipsoid"] * len(kinds)
    P, decay = found
    roots, factors = coordinates(P / BEYOND**2, cells)
    over = enclosed_cells(loop, cells, factors, drifts)
    if over is None:
        return ["no bounds"] * len(kinds)
    out = []
    for kind in kinds:
        some = [cell._replace(over=kind(cell.over)) for cell in over]
        own = smallest(some, roots, SIZES, decay, SPARE, solver)
        needed = None if own is None else inside(own.P, cells, factors) ** -0.5
        out.append("no ellipsoid" if needed is None else f"{needed:.1f}")
    return out


def _consistent(over: MatrixSet) -> MatrixSet:
    """The set of a reference that misses nothing of the equations."""
    corners, weights = over.corners.copy(), over.weights.copy()
    corners[..., -1], weights[:, -1, :], weights[:, :, -1] = 0.0, 0.0, 0.0
    return over._replace(corners=corners, weights=weights)


def _without(over: MatrixSet, terms: Array) -> MatrixSet:
    """The set without these terms."""
    return over._replace(weights=np.where(terms[:, None, None], GONE**2, 1.0) * over.weights)
