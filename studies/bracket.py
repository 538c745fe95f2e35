"""The lateral loop closed from both sides: gain and stability against permitted acceleration, proven above and flown below.

P(p) is the ordinary proof; P(p, lag) remembers where the airspeed came from; the lower bound is an explicit airspeed and gust.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import synthesis
from studies.lateral_loop import lateral_loop
from studies.output import as_json, columns, progress
from symheli import Helicopter, LPVStateSpace
from synthesis import Relaxation, Search, Solver

SLOW = Relaxation(memory=1.2, segments=(12,), grading=1.5, memory_segments=4, memory_degree=2)
FAST = Relaxation(memory=0.6, segments=(12,), grading=1.5, memory_segments=4, memory_degree=3)
FASTEST = Relaxation(memory=0.5, segments=(12,), grading=1.5, memory_segments=6, memory_degree=3)
FURTHEST = Relaxation(memory=0.45, segments=(12,), grading=1.5, memory_segments=8, memory_degree=3)
"""The faster the airspeed turns round, the shorter the lag that tells most, and the finer P has to be across."""

GAINS = {0.01: SLOW, 0.1: SLOW, 0.3: SLOW, 1.0: SLOW, 2.0: FAST, 3.0: FAST, 3.5: FAST, 4.0: FAST, 4.5: FAST, 5.0: FAST, 6.0: FASTEST}
"""Accelerations (m/s^2) at which gains are bracketed, and the memory that proves them."""

STABLE = {
    "P(p)": (Relaxation(), (4.5, 5.0)),
    "V of degree four": (Relaxation(order=2, segments=(4,)), (6.0, 6.5)),
    "P(p, lag)": (FURTHEST, (7.1, 7.2)),
}
"""Forms of V, and accelerations (m/s^2) at which each is tried: the second is beyond it."""

GROWING = (7.5, 7.52, 7.54, 7.6)
"""Accelerations (m/s^2) at which growth is looked for."""

PATIENT = Solver(time_limit=3600.0)


class Bracket(NamedTuple):
    """Gains at one acceleration (m/s^2): flown, proven with a memory, proven with P(p); inf: nothing proven, or growth."""

    rate: float
    lower: float
    memory: float
    plain: float
    exact: bool

    @property
    def gap(self) -> float:
        """Best proven gain over the flown one."""
        return min(self.memory, self.plain) / self.lower


def bracket(loop: LPVStateSpace, rate: float, relaxation: Relaxation, search: Search | None = None) -> Bracket:
    """The gain at one acceleration from both sides; `exact`: the better proof passes rational arithmetic."""
    plain = synthesis.l2_gain(loop, rate, search=None)
    memory = synthesis.l2_gain(loop, rate, relaxation=relaxation, search=search or Search(), solver=PATIENT)
    better = min(plain, memory, key=lambda c: c.gamma)
    return Bracket(rate, memory.lower, memory.gamma, plain.gamma, better.verify(rigorous=True))


def proves(loop: LPVStateSpace, rate: float, relaxation: Relaxation) -> bool:
    """Whether this form of V proves stability at this acceleration, in exact arithmetic."""
    return synthesis.stability(loop, rate, relaxation=relaxation, search=None, solver=PATIENT).verify(rigorous=True)


def measure(loop: LPVStateSpace, gains: dict[float, Relaxation], stable: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """(what, result) of everything the page shows, as it is found."""
    for rate in GROWING:
        found = synthesis.lower_bound(loop, rate)
        yield f"growth at {rate:g} m/s^2", found.growth if math.isinf(found.gamma) else "none found"
    for rate, relaxation in gains.items():
        found = bracket(loop, rate, relaxation)
        yield f"gain at {rate:g} m/s^2", {**found._asdict(), "gap": found.gap}
    for name, (relaxation, rates) in stable.items():
        for rate in rates:
            yield f"stable at {rate:g} m/s^2 by {name}", proves(loop, rate, relaxation)


def main() -> None:
    """Print the bracket of the X-Cell's lateral loop."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="growth, the gain at 3 m/s^2 and P(p) only")
    parser.add_argument("--json", action="store_true", help="print what a program would read")
    options = parser.parse_args()
    gains, stable = ({3.0: GAINS[3.0]}, {"P(p)": STABLE["P(p)"]}) if options.quick else (GAINS, STABLE)
    found: dict[str, Any] = {}
    for what, result in measure(lateral_loop(Helicopter.load("xcell60", governor="ideal")), gains, stable):
        progress(f"{what}: {_words(result)}")
        found[what] = result
    print(as_json(found) if options.json else columns([[what, _words(result)] for what, result in found.items()], left=2))


def _words(result: Any) -> str:
    if isinstance(result, dict):
        return ", ".join(f"{key} {_words(value)}" for key, value in result.items() if key != "rate")
    return f"{result:.6g}" if isinstance(result, float) else str(result)


if __name__ == "__main__":
    main()
