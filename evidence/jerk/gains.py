"""Bounds of the gain of a loop for a bounded acceleration and a bounded jerk: the upper one is
proven, the lower one is the gain of a computed trajectory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import synthesis
from symheli import LPVStateSpace, Scheduling
from synthesis.analysis import LowerBoundSearch
from synthesis.forms import Spline


class Knots(NamedTuple):
    """Degree in airspeed and acceleration, and segments in airspeed, of the P of one loop."""

    degree: tuple[int, int]
    segments: int

    @property
    def alone(self) -> Spline:
        """P(V) on these knots."""
        return Spline(degree=self.degree[0], segments=self.segments)

    def both(self, jerk: float) -> Spline:
        """P(V, a), constant in an acceleration that may jump."""
        across = self.degree[1] if math.isfinite(jerk) else 0
        return Spline(degree=(self.degree[0], across), segments=((self.segments, 1),))


class Cell(NamedTuple):
    """Gains for one acceleration (m/s^2) and jerk (m/s^3); inf: nothing proven, or growth.

    `lower` is at least the gain at an airspeed held, and that without a search.
    """

    acceleration: float
    jerk: float
    proven: float
    lower: float


class Loop(NamedTuple):
    """One loop: its frozen gain, {acceleration: gain of P(V)} on the knots of the cells and on
    those that `l2_gain` chooses, and the cells.
    """

    frozen: float
    same_knots: dict[float, float]
    chosen_knots: dict[float, float]
    cells: list[Cell]


def carried_over(cells: Sequence[Cell]) -> list[Cell]:
    """The same cells, each with the best of all: what is proven for more acceleration and jerk
    holds for less, and a trajectory that keeps to less keeps to more.
    """
    out = []
    for c in cells:
        above = [o for o in cells if o.acceleration >= c.acceleration and o.jerk >= c.jerk]
        below = [o for o in cells if o.acceleration <= c.acceleration and o.jerk <= c.jerk]
        proven, lower = min(o.proven for o in above), max(o.lower for o in below)
        out.append(c._replace(proven=proven, lower=lower))
    return out


def with_jerk(loop: LPVStateSpace, acceleration: float, jerk: float) -> LPVStateSpace:
    """The loop over airspeed and its rate: |dV/dt| <= acceleration (m/s^2), |d2V/dt2| <= jerk
    (m/s^3).
    """
    a = Scheduling("acceleration", "m/s^2", -acceleration, acceleration, jerk)
    return loop.with_parameter(a).with_rate({loop.scheduling.name: "acceleration"})


def cell(
    loop: LPVStateSpace,
    acceleration: float,
    jerk: float,
    knots: Knots,
    search: LowerBoundSearch | None,
) -> Cell:
    """Proven gain and lower bound of one acceleration and jerk."""
    found = synthesis.l2_gain(
        with_jerk(loop, acceleration, jerk), form=knots.both(jerk), search=search
    )
    return Cell(acceleration, jerk, found.gamma, found.lower)


def measure(
    loop: LPVStateSpace,
    knots: Knots,
    accelerations: Sequence[float],
    jerks: Sequence[float],
    search: LowerBoundSearch | None,
) -> Iterator[tuple[str, Any]]:
    """(what, result) of everything the page shows for one loop, as it is found."""
    yield "frozen", synthesis.frozen_gain(loop).gain
    for what, form in (("same_knots", knots.alone), ("chosen_knots", Spline())):
        yield (
            what,
            {a: synthesis.l2_gain(loop, a, form=form, search=None).gamma for a in accelerations},
        )
    for a in accelerations:
        for jerk in jerks:
            yield f"{a:g} m/s^2, {jerk:g} m/s^3", cell(loop, a, jerk, knots, search)
