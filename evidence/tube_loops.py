"""Tubes of loops with the parts of a real one: governor, observer, servos, a sampled controller.

The table of `python -m evidence.tubes --only loops`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evidence.tables import chosen, markdown, renewed
from evidence.tube_flights import WIDTHS, cells_of
from symheli import Helicopter
from symheli.dynamics import Governor
from symheli.flight import XCELL_SERVOS
from symheli.values.kinematics import RIGID_BODY
from synthesis.tubes import Tube, tube

Array = np.ndarray

EIGHT = tuple(map(str, RIGID_BODY))
"""States that are measured."""
TEN = (*EIGHT, "a1", "b1")
TWELVE = (*TEN, "Om", "om_i")
FINE = {name: replace(servo, steps=None) for name, servo in XCELL_SERVOS.items()}
"""The servos of the X-Cell without the steps of their commands."""
PERIOD = 0.02
"""s"""
ALL_PARTS = {"known": EIGHT, "servos": FINE, "period": PERIOD, "delay": 1}
"""Observer, servos, sampling and delay together."""
LIMITS: Mapping[str, Any] = {"acceleration": 1.0, "jerk": 1.0, "snap": 1.0}
"""Of commands along a range, m/s^2, m/s^3, m/s^4."""
SECONDS = 0.25
"""How long each flight from the border lasts: what leaves it leaves at once."""


@dataclass(frozen=True)
class Case:
    """A loop: words, vehicle, governor, airspeed or range, gusts in m/s, arguments of `tube`, and
    how many flights are flown from the border of its tube.
    """

    words: str
    vehicle: str
    governor: Governor
    airspeed: Any
    gust: float
    given: Mapping[str, Any] = field(default_factory=dict)
    flights: int = 500

    def found(self) -> Tube:
        """The tube."""
        heli = Helicopter.load(self.vehicle, governor=self.governor)
        return tube(heli, self.airspeed, gust=self.gust, **self.given)


CASES = (
    Case("ten states", "xcell60", "pi", 3.0, 0.25),
    Case("twelve states", "xcell60", "pi", 3.0, 0.25, {"known": TWELVE}),
    Case("ten states", "xcell60", "pi", (3.0, 4.0), 0.25, LIMITS),
    Case("eight states, observer", "xcell60", "ideal", 3.0, 0.25, {"known": EIGHT}),
    Case("eight states, observer", "xcell60", "pi", 3.0, 0.25, {"known": EIGHT}),
    Case(
        "eight states, observer",
        "xcell60",
        "ideal",
        (0.0, 13.0),
        0.25,
        {"known": EIGHT, **LIMITS},
        10_000,
    ),
    Case("ten states, servos", "xcell60", "ideal", 3.0, 0.25, {"servos": FINE}),
    Case("ten states, servos with steps", "xcell60", "ideal", 3.0, 0.25, {"servos": XCELL_SERVOS}),
    Case("ten states, 50 Hz", "xcell60", "ideal", 3.0, 0.25, {"period": PERIOD}),
    Case("ten states, 50 Hz, delay", "xcell60", "ideal", 3.0, 0.25, {"period": PERIOD, "delay": 1}),
    Case("eight states, observer, servos, 50 Hz, delay", "xcell60", "pi", 3.0, 0.1, ALL_PARTS),
)
"""Delay: one period from the sample to the command."""
GOVERNED = (Case("eight states, observer", "xcell_kahn_hudson", "pi", 3.0, 0.25, {"known": EIGHT}),)
"""Another helicopter, whose governor is slow."""


def row(case: Case) -> list[str]:
    """What its row of the table says after its name."""
    found = case.found()
    return [str(len(found.deviations.states)), *cells_of(found, case.flights, SECONDS)]


def table(cases: Sequence[Case], asked: Sequence[str], shown: Sequence[Sequence[str]]) -> str:
    """The table in Markdown, a row for each loop; rows asked for are found now, of the others those
    `shown` before stay.
    """
    names = [[c.vehicle, c.governor, c.words, _airspeed(c.airspeed), f"{c.gust:g}"] for c in cases]
    head = ["helicopter", "governor", "the controller knows", "airspeed, m/s", "gusts, m/s"]
    head += ["states", *WIDTHS]
    run = chosen(asked, [name[:4] for name in names])
    rows = renewed(names, lambda k: row(cases[k]), run, shown)
    return markdown([*head, "worst gust found", "furthest flight", "of"], rows)


def _airspeed(p: Any) -> str:
    return f"{p:g}" if np.ndim(p) == 0 else f"{p[0]:g} to {p[1]:g}"
