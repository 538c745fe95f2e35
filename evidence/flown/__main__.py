"""`python -m evidence.flown`: the campaign, its tables, and where the specifications conflict.

--write puts the tables into docs/flown.md; --out keeps designs and finished cases: the same command
goes on after a stop.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from evidence.flown import campaign as flown
from evidence.flown import designs
from evidence.flown.tuning import SIZES_OF_GUSTS
from evidence.tables import DOCS, keep, markdown
from studies.campaigns.dataset import CampaignDataset
from studies.campaigns.run import run
from studies.campaigns.runners import Here
from studies.controllers.certified import proofs
from studies.controllers.designs import LQR, Design
from studies.controllers.flown import BEYOND, WINDS
from studies.controllers.plant import baseline, closed, flown_plant
from studies.specs.flown import ACCELERATIONS, OF_A_SWITCH, SHARE, in_still_air
from studies.specs.of_vehicle import OfVehicle, digest_of
from symheli import Helicopter, LPVStateSpace
from synthesis import Plant
from synthesis.sheet.evaluation import Reached, SpecificationTable, margin, worst
from synthesis.sheet.sheet import Sheet, Specification

PAGE = DOCS / "flown.md"
POINTS = 14
"""Airspeeds of the frozen entries."""
COMPARED = (LQR, designs.RETUNED, designs.SLOW)
"""Controllers that fly in gusts of every size."""
PROVEN = (*COMPARED, designs.SLOW_IDENTIFIED)
"""Controllers that are proven here; those of the study are in its report."""
AGGRESSIVE = max(ACCELERATIONS)

Row = Mapping[str, float]
Calm = Mapping[tuple[str, str], float]


class Cases:
    """Results by controller, wind (m/s) and acceleration (m/s^2)."""

    def __init__(self, dataset: CampaignDataset, names: Mapping[str, str]):
        values, units = dataset.values, list(dataset.units)
        self._rows: dict[tuple[str, float, float], Row] = {}
        for case, row in zip(dataset.cases, values, strict=True):
            p = case.parameters
            if p["controller"] in names:
                key = (names[str(p["controller"])], float(p["wind"]), float(p["acceleration"]))
                self._rows[key] = dict(zip(units, row.tolist(), strict=True))

    def of(self, name: str, wind: float, acceleration: float = AGGRESSIVE) -> Row:
        """The quantities of a case."""
        return self._rows[name, wind, acceleration]

    def worst(self, name: str) -> float:
        """The largest energy ratio of all flights of a controller that were not lost."""
        own = [row["energy ratio, worst"] for (n, *_), row in self._rows.items() if n == name]
        return max(own)


def ratios(cases: Cases, names: Sequence[str]) -> str:
    """Median energy ratio by size of gusts, the least of a column without losses bold."""
    columns = []
    for wind in SIZES_OF_GUSTS:
        rows = {n: cases.of(n, wind) for n in names if n in COMPARED or wind in WINDS}
        safe = [r["energy ratio, median"] for r in rows.values() if not r["lost"]]
        least = min(safe, default=math.nan)
        columns.append({n: _ratio(row, least) for n, row in rows.items()})
    cells = [[name, *(column.get(name, "") for column in columns)] for name in names]
    return markdown(["controller", *(f"{w:g} m/s" for w in SIZES_OF_GUSTS)], cells)


def _ratio(row: Row, least: float) -> str:
    median = f"{row['energy ratio, median']:.2f}"  # the third digit depends on the processor
    if row["lost"]:
        return f"{median} ({row['lost']:.1%} lost)"
    bold = "**" if row["energy ratio, median"] == least else ""
    return f"{bold}{median}{bold}"


def certificates(
    made: Mapping[str, Design], table: SpecificationTable, cases: Cases, vehicle: OfVehicle
) -> str:
    """States, frozen and proven gain, the largest energy ratio flown, and how many frozen entries
    are met.
    """
    plant = flown_plant(baseline(vehicle.heli))
    rows = []
    for name, one in made.items():
        assert one.controller is not None
        counted = [r for r in table.reached(name) if _frozen_and_known(r)]
        inside = sum(r.margin >= 0 for r in counted)
        rows.append(
            [
                name,
                str(one.order),
                f"{one.frozen:.3g}",
                _proven(name, one.controller, plant, vehicle) if name in PROVEN else "",
                f"{cases.worst(name):.3f}",
                f"{inside} of {len(counted)}",
            ]
        )
    head = ["controller", "states", "frozen gain", "proven, to 3 m/s^2", "largest ratio flown"]
    return markdown([*head, "frozen entries in Level 1"], rows)


def _proven(name: str, controller: LPVStateSpace, plant: Plant, vehicle: OfVehicle) -> str:
    what = f"proof of {name}, {digest_of(controller)}"
    bounds = vehicle.kept("proof", what, lambda: proofs(name, closed(plant, controller)))
    verified = [b.certificate.gamma for b in bounds if b.certificate.verified]
    return f"{min(verified):.4g}" if verified else "none"


def _frozen_and_known(reached: Reached) -> bool:
    spec = reached.specification
    return spec.kind == "frozen" and spec.counts and not math.isnan(reached.margin)


def entries(cases: Cases, names: Sequence[str], winds: Sequence[float]) -> str:
    """What `SHARE` of the flights keep to, and how many flights meet every entry."""
    specs = flown.flown_entries(flown.of_the_vehicle())
    transition = [s for s in specs if s.axis == "transition"]
    controls = {m: [s for s in specs if s.measure == m] for m in ("effort", "stops")}
    rows = []
    for name in names:
        for a in ACCELERATIONS:
            for wind in winds:
                row = cases.of(name, wind, a)
                most = [
                    max(row[f"{flown.entry(s)}, {SHARE:.0%}"] for s in of)
                    for of in controls.values()
                ]
                kept = [row[f"{flown.entry(s)}, {SHARE:.0%}"] for s in transition]
                rows.append(
                    [
                        f"{name}, {a:g} m/s^2, {wind:g} m/s",
                        f"{row['lost']:.1%}",
                        # the third digit depends on the processor
                        *(f"{float(f'{v:.2g}'):g}" for v in (*kept, *most)),
                        f"{row['hypotheses']:.0%}",
                        f"{row['outside, median']:.0%}, {row['faster, median']:.0%}",
                        f"{row['every entry met']:.1%}",
                    ]
                )
    bounds = [f"{s.name.removesuffix(' error')} ({s.unit}) <= {s.level_1:.3g}" for s in transition]
    bounds += [f"{m} ({of[0].unit}) <= {of[0].level_1:.3g}" for m, of in controls.items()]
    head = [
        "controller, transition, wind",
        "lost",
        *bounds,
        "hypotheses hold",
        "samples outside, faster",
        "every entry met",
    ]
    return markdown(head, rows)


def conflicts(table: SpecificationTable, cases: Cases, calm: Mapping[str, Calm]) -> str:
    """Every counted entry that a controller misses: how many meet it, and who comes nearest."""
    rows = []
    for k, spec in enumerate(table.sheet.specifications):
        if spec.counts and spec.kind == "frozen":
            found = _frozen(table, k)
        elif spec in flown.flown_entries(table.sheet):
            found = _flown(spec, table.controllers, cases)
        elif spec.counts and spec.measure in OF_A_SWITCH:
            found = _of_values(spec, {n: [calm[n][spec.axis, spec.name]] for n in calm})
        else:
            continue
        if found.met < found.of:
            met = f"{found.met} of {found.of}"
            rows.append([spec.axis, spec.name, met, found.nearest, found.value, found.margin])
    return markdown(
        ["axis", "entry", "controllers that meet it", "nearest", "its value", "its margin, %"], rows
    )


class _Entry(NamedTuple):
    """How many controllers, `of` those it is defined for, meet an entry; the one nearest to it, its
    value and margin.
    """

    met: int
    of: int
    nearest: str = ""
    value: str = ""
    margin: str = ""


def _frozen(table: SpecificationTable, k: int) -> _Entry:
    each = {name: table.reached(name)[k] for name in table.controllers}
    each = {name: r for name, r in each.items() if not math.isnan(r.margin)}
    if not each:
        return _Entry(0, 0)
    best = max(each, key=lambda name: each[name].margin)
    met = sum(r.margin >= 0 for r in each.values())
    return _Entry(met, len(each), best, worst(each[best]), margin(each[best]))


def _flown(spec: Specification, names: Sequence[str], cases: Cases) -> _Entry:
    """Of the transition in which a controller does worse."""
    entry = f"{flown.entry(spec)}, {SHARE:.0%}"
    return _of_values(
        spec, {n: [cases.of(n, WINDS[0], a)[entry] for a in ACCELERATIONS] for n in names}
    )


def _of_values(spec: Specification, of: Mapping[str, Sequence[float]]) -> _Entry:
    """Of the largest value of each controller, where `spec` is an upper bound."""
    values = {name: max(each) for name, each in of.items()}
    met = sum(spec.design_margin(value) >= 0 for value in values.values())
    best = min(values, key=lambda name: values[name])
    value, off = values[best], spec.design_margin(values[best])
    return _Entry(met, len(of), best, f"{_short(value)} {spec.unit}", f"{off:.0f}")


def still_air(calm: Mapping[str, Calm], sheet: Sheet) -> str:
    """Every flown entry that needs no turbulence, a row a controller."""
    specs = {(s.axis, s.name): s for s in sheet.specifications}
    keys = list(next(iter(calm.values())))
    head = [
        f"{axis}, {name.removesuffix(', flown')} ({specs[axis, name].unit})"
        + (f" <= {specs[axis, name].level_1:.3g}" if specs[axis, name].counts else "")
        for axis, name in keys
    ]
    rows = [[name, *(_short(found[key]) for key in keys)] for name, found in calm.items()]
    return markdown(["controller", *head], rows)


def _short(value: float) -> str:
    return "inf" if math.isinf(value) else f"{value:.3g}"


def main(argv: Sequence[str] | None = None) -> int:
    """Fly what is missing, and print or keep the tables."""
    parser = argparse.ArgumentParser(prog="python -m evidence.flown", description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"keep the tables in {PAGE.name}")
    parser.add_argument("--out", type=Path, help="folder of designs and finished cases")
    parser.add_argument("--flights", type=int, default=flown.FLIGHTS)
    given = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as temporary:
        for name, text in tables(given.out or Path(temporary), given.flights):
            print(f"\n{name}\n\n{text}", flush=True)
            if given.write:
                keep(PAGE, name, text)
    return 0


def tables(folder: Path, flights: int) -> Iterator[tuple[str, str]]:
    """Every section with its table, as they are done: the proofs last."""
    vehicle = OfVehicle(name=designs.VEHICLE, points=POINTS, folder=folder / "designs")
    every = list(designs.every(folder / "designs"))
    made = {d.name: d for d in every if d.controller is not None}
    cases = fly(made, folder / "flights.zarr", flights)
    names = list(made)
    about = f"{flights} flights each, seeds from {flown.SEEDS_FROM} on."
    about += "".join(f" No {d.name}: {d.reason}." for d in every if d.controller is None)
    yield "energy ratios", f"{about}\n\n{ratios(cases, names)}"
    yield "flown entries", f"{about}\n\n{entries(cases, names, WINDS[:1])}"
    controllers = {name: d.controller for name, d in made.items() if d.controller is not None}
    heli = Helicopter.load(vehicle.name, governor="pi")
    calm = {
        name: vehicle.kept(
            "flown",
            f"in still air: {digest_of(K)}",
            lambda K=K: in_still_air(heli, K, vehicle.scaled),
        )
        for name, K in controllers.items()
    }
    yield "still air", still_air(calm, vehicle.scaled)
    table = vehicle.frozen(controllers)
    yield "conflicts", conflicts(table, cases, calm)
    yield "controllers", certificates(made, table, cases, vehicle)


def fly(made: Mapping[str, Design], path: Path, flights: int) -> Cases:
    """The campaign: the study's sizes of gusts at the permitted acceleration, the least of them at
    the gentle one; the sizes beyond for the controllers that are compared. A case is named after
    the controller and its matrices.
    """
    models: dict[str, LPVStateSpace] = {}
    names = {}
    for name, one in made.items():
        assert one.controller is not None
        key = f"{name} {digest_of(one.controller)[:8]}"
        models[key], names[key] = one.controller, name
    compared = [key for key, name in names.items() if name in COMPARED]
    asked = [
        (list(models), WINDS, AGGRESSIVE),
        (list(models), WINDS[:1], min(ACCELERATIONS)),
        (compared, BEYOND, AGGRESSIVE),
    ]
    with Here() as here:
        for keys, winds, acceleration in asked:
            of = {key: models[key] for key in keys}
            dataset = run(flown.cases(of, winds, [acceleration], flights), path, here)
    return Cases(dataset, names)


if __name__ == "__main__":
    raise SystemExit(main())
