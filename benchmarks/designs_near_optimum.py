"""Least gamma of scheduled output feedback beside the worst optimum of the frozen models, which no
controller beats, for random plants of 1 to 8 states at rate zero and at a slow one.

Then what the settled controller promises by that least gamma, and what is proven of it by its
promise.
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[0] = str(ROOT)  # this folder holds scripts named like the packages they measure

from studies.threads import one_thread  # noqa: E402

one_thread()

import numpy as np  # noqa: E402

from benchmarks.race import Ratio, present, table  # noqa: E402
from benchmarks.random_plants import Drawn, random_plant  # noqa: E402
from benchmarks.timing import arguments  # noqa: E402
from symheli.errors import SymheliError  # noqa: E402
from symheli.progress import tracked  # noqa: E402
from synthesis import output_feedback  # noqa: E402

PLANTS, PROOFS = 40, 10
"""Seeds, and those of them whose loops are proven."""
WITHIN, SETTLED, PROVEN = 1.02, 1.05, 1.05
"""Goals: least gamma by the worst frozen optimum, promise by least gamma, proof by promise."""


class Measured(NamedTuple):
    """The three ratios, inf for what was refused or not proven, and the seconds of the design."""

    least: float
    settled: float
    proven: float
    seconds: float


def measured(drawn: Drawn, moving: bool, prove: bool) -> Measured:
    """Of this plant."""
    rate = drawn.slow if moving else 0.0
    begin = time.perf_counter()
    try:
        made = output_feedback(drawn.plant, rate)
    except SymheliError:
        return Measured(math.inf, math.inf, math.inf, time.perf_counter() - begin)
    seconds = time.perf_counter() - begin
    least = math.inf if made.optimum is None else made.optimum
    proof = made.certify(rate, search=None).gamma if prove else math.nan
    return Measured(least / drawn.worst, made.promised / least, proof / made.promised, seconds)


def row(found: np.ndarray, goal: float) -> tuple[str, ...]:
    """Of one ratio, over all plants."""
    good = found[np.isfinite(found)]
    far = f"{len(found) - (found <= goal).sum()} of {len(found)}"
    return f"{np.median(good):.4f}", f"{good.max():.4f}", far


def main() -> None:
    options = arguments(__doc__, write=True)
    count, proofs = (1, 1) if options.quick else (PLANTS, PROOFS)
    rows, ratios = [], []
    drawn = [random_plant(seed) for seed in tracked("drawing plants", range(count))]
    for moving in (False, True):
        name = "a thousandth of its range per time constant" if moving else "0"
        plants = tracked(f"plants, rate {name}", drawn)
        every = [measured(each, moving, k < proofs) for k, each in enumerate(plants)]
        least, settled, proven, seconds = map(np.array, zip(*every, strict=True))
        for what, found, goal in (
            ("least gamma by worst frozen optimum", least, WITHIN),
            ("promise by least gamma", settled, SETTLED),
            ("proof by promise", proven[:proofs], PROVEN),
        ):
            rows.append((name, what, *row(found, goal)))
            ratios.append(
                Ratio(f"{what} at rate {name}, median", float(np.median(found)), goal, True)
            )
        rows.append((name, "seconds", f"{np.median(seconds):.1f}", f"{seconds.max():.1f}", ""))
    head = ("rate of p", "of", "median", "worst that is finite", "missed")
    present("designs near the optimum", options, [table("### Designs", rows, head)], ratios, [])


if __name__ == "__main__":
    main()
