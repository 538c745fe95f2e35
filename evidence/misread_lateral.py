"""How wrong the airspeed may be read: `python -m evidence.misread_lateral`.

The designed lateral controller as a table, its sampled plant from the cubic fits: the largest error
for which the loop is proven stable, beside what is asked for, the proven gain there, and where the
airspeed may go when its reading freezes. Minutes.
"""

from __future__ import annotations

import numpy as np

import symheli
from evidence.designed_lateral import ACCELERATION, DT, designed, sampled_plant
from symheli import LPVStateSpace, TableController
from synthesis import Plant, l2_gain, stability
from synthesis.analysis import proven_around, with_scheduling_error
from synthesis.design.loops.frozen_reading import largest
from synthesis.forms import Spline

KNOTS = 3
"""Of the table: as few as cost the frozen gain nothing."""
PROOF = Spline(degree=1, segments=2)
BIAS, LAG = 1.0, 0.5
"""DesignChoices for: m/s, and seconds at the certified acceleration."""
MOST = 6.0
"""Largest error that is tried, m/s."""


def errors() -> dict[str, float]:
    """What is asked for, m/s."""
    late = LAG * ACCELERATION
    return {
        f"bias of {BIAS:g} m/s": BIAS,
        f"lag of {LAG:g} s": late,
        "both": BIAS + late,
    }


def worst_frozen_pole(
    plant: Plant, table: TableController, error: float, points: int = 14
) -> float:
    """Largest modulus of a pole of the frozen loops K(p + b), |b| <= `error`, on a grid: a check
    that knows nothing of the proof.
    """
    (s,) = plant.parameters
    grid = np.linspace(s.low, s.high, points)
    worst = 0.0
    for read in grid:
        true = grid[np.abs(grid - read) <= error]
        loop = plant.close(table.model.at(float(read)))
        assert isinstance(loop, LPVStateSpace)
        A = loop.matrices(true).A
        worst = max(worst, float(np.abs(np.linalg.eigvals(A)).max()))
    return worst


def main() -> None:
    """Prints as it goes."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal")
    controller, plant = designed(heli), sampled_plant(heli)
    table = TableController.of(controller.discretize(DT).model, KNOTS)

    def proves(error: float) -> bool:
        wrong = with_scheduling_error(plant, table, error)
        return stability(wrong, form=PROOF, search=None).verified

    found = largest(proves, MOST, 0.1)
    print(f"proven stable for every error within {found.bound:.3g} m/s, not for {found.failed:.3g}")
    for name, asked in errors().items():
        print(f"  {name}: {asked:g} m/s, {'met' if found.bound >= asked else 'MISSED'}")
    print(f"  largest frozen pole there {worst_frozen_pole(plant, table, found.bound):.5f}")
    for at in (plant.parameters[0].low, plant.parameters[0].middle, plant.parameters[0].high):
        low, high = proven_around(plant, table, at, tolerance=0.1, form=PROOF, search=None)
        print(f"reading frozen at {at:g} m/s: proven stable from {low:.3g} to {high:.3g} m/s")
    both = max(errors().values())
    for error in (0.0, both):
        gain = l2_gain(with_scheduling_error(plant, table, error), form=PROOF, search=None)
        print(f"gain with errors within {error:g} m/s: {gain.gamma:.4g} (frozen {gain.frozen:.4g})")


if __name__ == "__main__":
    main()
