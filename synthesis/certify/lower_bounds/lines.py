"""Straight lines through a box of parameters, along which a single parameter moves; one time budget
for all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from symheli.progress import tracked
from synthesis.certify.lower_bounds.budget import Budget
from synthesis.certify.lower_bounds.lower_bound import Search, growing_trajectory
from synthesis.certify.lower_bounds.trajectory import SchedulingTrajectory

Array = np.ndarray


class Line(NamedTuple):
    """The `model` along a line, how fast its parameter may move (per second), and the map `back` to
    p.
    """

    model: Any
    rate: float
    back: Callable[[Array], Array]

    def in_box(self, found: SchedulingTrajectory) -> SchedulingTrajectory:
        """Return a trajectory on the line as one of the box."""
        return SchedulingTrajectory(found.time, self.back(found.p))


def directions(m: int) -> list[Array]:
    """Return the diagonals of a box of m parameters, and its axes where there are several."""
    if not m:
        return []
    diagonals = [np.array((1.0, *signs)) for signs in product((1.0, -1.0), repeat=m - 1)]
    return diagonals + (list(np.eye(m)) if m > 1 else [])


def alone(p: Array) -> Array:
    """Return p (k,) where there is one parameter (k, 1)."""
    return p[:, 0] if p.shape[1] == 1 else p


def shared(lines: Iterable[Line], search: Search | None) -> Iterator[tuple[Line, Search]]:
    """Yield every line with its share of the remaining time, while there is time; none without a
    search.
    """
    if search is None:
        return
    budget, lines = Budget(search.seconds), list(lines)
    for k, line in enumerate(tracked("searching along lines", lines)):
        if budget.over:
            return
        yield line, replace(search, seconds=budget.left / (len(lines) - k))


def growing_on(lines: Iterable[Line], search: Search | None) -> SchedulingTrajectory | None:
    """Return a p(t) on one of the lines along which the free state grows, None where none was
    found.
    """
    for line, share in shared(lines, search):
        found = growing_trajectory(line.model, line.rate, share)
        if found is not None:
            return line.in_box(found)
    return None
