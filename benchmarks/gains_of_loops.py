"""Proven gain beside the norm, known in forty digits, of random loops with poles over seven
decades, in any units.

As they are, with a dependence on p that leaves the gain as it is, and with one of a thousandth of
an entry, which is beside the worst frozen gain.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

from benchmarks.loops_over_decades import loop  # noqa: E402
from benchmarks.race import Ratio, present, table  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from synthesis import l2_gain  # noqa: E402

RATE = 0.1
"""Of p, whose range is one, 1/s."""
WITHIN = 1.01
"""Goal for every loop whose gain is its norm."""


class Measured(NamedTuple):
    """Proven gain by what no proof undercuts, and the seconds it took."""

    excess: float
    seconds: float


def measured(seed: int, dependence: str) -> Measured:
    """Of the loop of this seed."""
    own = loop(seed)
    model = own.scheduled(dependence, RATE, seed)
    begin = time.perf_counter()
    found = l2_gain(model, search=None)
    seconds = time.perf_counter() - begin
    return Measured(found.gamma / (found.frozen if dependence == "entry" else own.norm), seconds)


def main() -> None:
    options = arguments(__doc__, write=True)
    plan = (
        {"none": 12, "hidden": 4, "entry": 2}
        if options.quick
        else {
            "none": 1000,
            "hidden": 200,
            "entry": 100,
        }
    )
    rows, ratios = [], []
    for dependence, count in plan.items():
        found = [measured(seed, dependence) for seed in range(count)]
        excess, seconds = (np.array(column) for column in zip(*found, strict=True))
        rows.append(
            (
                dependence,
                str(count),
                f"{np.median(excess):.6f}",
                f"{excess.max():.6f}",
                f"{(excess > WITHIN).sum()}",
                f"{np.median(seconds):.2f} s",
                f"{seconds.max():.1f} s",
            )
        )
        name = f"dependence on p: {dependence}, proven by what no proof undercuts"
        goal = None if dependence == "entry" else WITHIN
        ratios += [
            Ratio(f"{name}, median", float(np.median(excess))),
            Ratio(f"{name}, worst", float(excess.max()), goal, True),
        ]
    head = ("dependence on p", "loops", "median", "worst", "over 1 %", "time, median", "longest")
    present("gains of loops", options, [table("### Gains of loops", rows, head)], ratios, [])


if __name__ == "__main__":
    main()
