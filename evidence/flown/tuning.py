"""`python -m evidence.flown.tuning`: sizes of the scheduled LQR and of the LPV controller by one
search: as many numbers, evaluations and flights, the same seeds, which judge nothing.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from evidence.flown import designs
from evidence.tables import DOCS, keep, markdown
from studies.controllers.design_choices import PERIOD
from studies.controllers.flown import BEYOND, WINDS, measures, plan
from symheli import Helicopter, LPVStateSpace
from symheli.errors import SymheliError

PAGE, SECTION = DOCS / "flown.md", "tuning"
SEEDS = range(10000, 10010)
EVALUATIONS = 40
STEP = 1.0
"""Of the first simplex of Nelder and Mead's search, in powers of 2."""
SIZES_OF_GUSTS = tuple(sorted((*WINDS, *BEYOND)))
WORST = 10.0
"""Objective of a design that fails or loses a flight."""


class Evaluation(NamedTuple):
    """A point of a search: powers of 2, median energy ratio at each size of gusts (empty where
    there is no controller), and mean of their logarithms.
    """

    powers: designs.Powers
    ratios: tuple[float, ...]
    objective: float


def searched(
    make: Callable[[designs.Powers], LPVStateSpace],
    heli: Helicopter,
    evaluations: int = EVALUATIONS,
    seeds: Sequence[int] = SEEDS,
    winds: Sequence[float] = SIZES_OF_GUSTS,
) -> list[Evaluation]:
    """Every evaluation of a search from no change, in order."""
    found: list[Evaluation] = []

    def objective(x: np.ndarray) -> float:
        powers = tuple(round(float(v), 3) for v in x)
        found.append(_evaluated(make, heli, powers, seeds, winds))
        print(*found[-1], flush=True)
        return found[-1].objective

    numbers = len(designs.LQR_GROUPS)
    simplex = np.vstack([np.zeros(numbers), STEP * np.eye(numbers)])
    minimize(
        objective,
        simplex[0],
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": evaluations},
    )
    return found


def best(found: Sequence[Evaluation]) -> Evaluation:
    """The evaluation of least objective."""
    return min(found, key=lambda e: e.objective)


def lpv(heli: Helicopter, powers: designs.Powers) -> LPVStateSpace:
    """The LPV controller of all states, sampled."""
    return designs.lpv_for_slow(heli, powers).discretize(PERIOD).model


def _evaluated(
    make: Callable[[designs.Powers], LPVStateSpace],
    heli: Helicopter,
    powers: designs.Powers,
    seeds: Sequence[int],
    winds: Sequence[float],
) -> Evaluation:
    try:
        controller = make(powers)
    except SymheliError:
        return Evaluation(powers, (), WORST)
    flown = measures(heli, [plan(controller, wind) for wind in winds], seeds)
    if any(one.lost for one in flown):
        return Evaluation(powers, (), WORST)
    ratios = np.array([one.ratio for one in flown]).reshape(len(winds), len(seeds))
    medians = np.median(ratios, axis=1)
    return Evaluation(powers, tuple(medians.tolist()), float(np.log(medians).mean()))


def main() -> None:
    """Print the searches, or keep what they found in docs/flown.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"keep the table in {PAGE.name}")
    parser.add_argument("--evaluations", type=int, default=EVALUATIONS)
    given = parser.parse_args()
    ideal = Helicopter.load(designs.VEHICLE, governor="ideal")
    heli = Helicopter.load(designs.VEHICLE, governor="pi")
    ways = {
        designs.RETUNED: lambda powers: designs.retuned(ideal, powers),
        designs.SLOW: lambda powers: lpv(ideal, powers),
    }
    rows = []
    for name, make in ways.items():
        found = searched(make, heli, given.evaluations)
        for which, one in (("first", found[0]), ("best", best(found))):
            powers = ", ".join(f"{k:g}" for k in one.powers)
            rows.append([name, which, powers, *(f"{r:.3f}" for r in one.ratios)])
    head = ["controller", "", "powers of 2", *(f"{w:g} m/s" for w in SIZES_OF_GUSTS)]
    text = f"{given.evaluations} evaluations each.\n\n{markdown(head, rows)}"
    print(text)
    if given.write:
        keep(PAGE, SECTION, text)


if __name__ == "__main__":
    main()
