"""`python -m evidence.specs`: what the controllers of the study reach of the specification sheet,
frozen at airspeeds from hover on.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from evidence.tables import DOCS, keep, markdown
from studies.controllers.designs import NAMES
from studies.specs.of_vehicle import OfVehicle
from synthesis.sheet.evaluation import SpecificationTable

PAGE, SECTION = DOCS / "controllers.md", "specification sheet"
POINTS = 14
AXES = ("roll", "pitch", "yaw", "heave")


def frozen(names: Sequence[str] = NAMES, folder: Path | None = None) -> SpecificationTable:
    """Return the frozen specifications of these controllers of the study on the X-Cell .60."""
    vehicle = OfVehicle(name="xcell60", points=POINTS, folder=folder)
    made = {d.name: d.controller for d in vehicle.designs(names) if d.controller is not None}
    return vehicle.frozen(made)


def row(table: SpecificationTable, name: str) -> list[str]:
    """Return how many entries that count are in Level 1, and the least margin of each axis."""
    counted = [
        r for r in table.reached(name) if r.specification.counts and not math.isnan(r.margin)
    ]
    inside = sum(r.margin >= 0 for r in counted)
    least = [
        min((r for r in counted if r.specification.axis == axis), key=lambda r: r.margin)
        for axis in AXES
    ]
    worst = [f"{r.margin:.0f} ({r.specification.name})" for r in least]
    return [name, f"{inside} of {len(counted)}", *worst]


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; --write: into the page; --out DIR: keep the designs there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"keep it in {PAGE.name}")
    parser.add_argument("--out", type=Path, help="folder of the designs")
    arguments = parser.parse_args(argv)
    table = frozen(folder=arguments.out)
    head = ["controller", "in Level 1", *(f"{axis}, least margin (%)" for axis in AXES)]
    text = markdown(head, [row(table, name) for name in table.controllers])
    seconds = table.seconds["frozen"]
    print(f"{text}\n\n{seconds:.0f} s for {len(table.controllers)} controllers")
    if arguments.write:
        about = (
            f"{len(table.frozen)} frozen entries at {POINTS} airspeeds from 0 to 13 m/s, of"
            f" {len(table.controllers)} controllers in {seconds:.0f} s on one core."
        )
        keep(PAGE, SECTION, f"{about}\n\n{text}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
