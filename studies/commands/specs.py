"""Command symheli specs: the specification sheet of a vehicle over airspeed, for the controllers of
the study and others.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.commands import options
from studies.commands.arguments import flag, option, several
from studies.output import Output, columns, progress
from symheli.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from studies.controllers.designs import Design
    from studies.specs.of_vehicle import OfVehicle
    from synthesis.sheet.evaluation import SpecificationTable

HELP = "specification sheet over airspeed: design margins of controllers, frozen, proven and flown"

PAGE = "specs.html"
"""Page of the sheet in the folder of a study."""

LEGEND = """\
margin: 0 % at the boundary of Level 1, -100 % at that of Levels 2 and 3, at most 100 %; in
  brackets, and where the source is "not confirmed", it does not count
worst: over all airspeeds; of an entry without boundaries, the range; flown: what 95 % of the
  flights keep to"""

ARGUMENTS = (
    *options.vehicle(
        None, "packaged airframe or TOML file (default: xcell60, or that of the study)"
    ),
    option(
        "--controller",
        "FILE",
        "table of a controller, of symheli synthesize or TableController.save; may be repeated, and"
        " is evaluated instead of those of the study",
        Path,
        [],
        action="append",
    ),
    option(
        "--only",
        "NAME",
        "only the controllers whose names begin so, of the study or of 'regulator behind servos',"
        " 'LQG' and 'H-infinity of one airspeed'; may be repeated",
        None,
        [],
        action="append",
    ),
    option(
        "--study",
        "DIR",
        "the controllers of this finished study, as they are there; the page goes beside its"
        " report, as specs.html",
        Path,
    ),
    option("--sheet", "FILE", "specification sheet (default: that of a small helicopter)", Path),
    option("--axes", "A,B", "axes of the sheet (default: all)", options.names),
    several("--airspeeds", ("LOW", "HIGH"), "range, m/s (default: 0 13)", type=options.number),
    option("--points", "N", "airspeeds at which the models are frozen", options.at_least_one, 14),
    flag("--proven", "prove peaks and disk margins for every airspeed in between"),
    option("--rate", "M/S^2", "largest |dV/dt| of the proofs; 0: airspeed held", options.rate, 0.0),
    flag("--flown", "fly transitions in turbulence, and steps of attitude"),
    option(
        "--flights", "N", "of each transition, each with its own seed", options.at_least_one, 20
    ),
    option("--out", "DIR", "folder where designs, proofs and flights are kept", Path),
    option("--figure", "FILE", "picture of the margins (.png, .svg or .pdf)", options.picture),
    option("--page", "FILE", "page (.html) with the picture, the margins and the sources", Path),
    flag("--whole", "print the whole sheet of every controller, not only of one"),
)


def run(arguments: argparse.Namespace) -> Output:
    """Design, evaluate frozen, and prove and fly where that is asked for."""
    from studies.specs import page
    from studies.specs.of_vehicle import OfVehicle
    from synthesis.sheet.sheet import Sheet

    low, high = arguments.airspeeds or (0.0, 13.0)
    if not 0 <= low < high or arguments.points < 2:
        raise InputError("expected 0 <= LOW < HIGH and at least two points")
    if not arguments.flown:
        options.refuse(arguments, ["flights"], "without --flown")
    if not arguments.proven:
        options.refuse(arguments, ["rate"], "without --proven")
    sheet = Sheet.load(arguments.sheet).select(arguments.axes)
    vehicle, of_study = _study(arguments)
    of = OfVehicle(
        name=vehicle,
        sheet=sheet,
        airspeeds=(low, high),
        points=arguments.points,
        folder=arguments.out,
    )
    begin = time.perf_counter()
    progress(f"controllers of {vehicle}")
    controllers, missing = _controllers(arguments, of, of_study)
    designing = time.perf_counter() - begin
    progress(f"{len(controllers)} controllers at {arguments.points} airspeeds")
    table = of.frozen(controllers)
    if arguments.proven:
        begin = time.perf_counter()
        proven = of.proven(controllers, arguments.rate, arguments.axes)
        table = table.with_proven(proven, time.perf_counter() - begin)
    if arguments.flown:
        from studies.specs.flown import flown

        begin = time.perf_counter()
        table = table.with_flown(
            flown(of, controllers, arguments.flights), time.perf_counter() - begin
        )
    lead = (
        f"{vehicle}, {low:g} to {high:g} m/s, {arguments.points} airspeeds, servos, 20 ms"
        " of delay, 50 Hz"
    )
    head = f"{sheet.title}: {lead}"
    table = replace(table, seconds={"controllers": designing, **table.seconds})
    written = _written(arguments, table, lead, missing)
    shown = table.controllers if arguments.whole else table.controllers[:1]
    lines = [head, ""]
    if len(table.controllers) > 1:
        lines += [_beside(table), ""]
    for name in shown:
        lines += [table.text(name), ""]
    lines += [LEGEND, ""]
    if table.proven:
        rows = [page.PROOFS, *page.proofs(table)]
        lines += [_about(arguments.rate), "", columns(rows, left=4), ""]
    lines += [f"{name}: {reason}" for name, reason in missing.items()]
    progress("; ".join(f"{what} {s:.1f} s" for what, s in table.seconds.items()))
    lines += [f"wrote {path}" for path in written]
    return Output("\n".join(lines).rstrip("\n"), _data(table, missing))


def kept(arguments: argparse.Namespace) -> str:
    """Files that are left of an interrupted run."""
    if arguments.out:
        return f"what was finished is in {arguments.out}: the same command goes on from there"
    return "nothing was kept; with --out DIR what is finished is"


def _study(arguments: argparse.Namespace) -> tuple[str, tuple[Design, ...] | None]:
    """Return the vehicle, and the designs of the study that is asked about, if one is."""
    if arguments.study is None:
        return arguments.vehicle or "xcell60", None
    if arguments.vehicle or arguments.controller:
        raise InputError("--study has its own vehicle and controllers: leave out others")
    from studies.transition.study import designs_of

    configuration, found = designs_of(arguments.study)
    return configuration.vehicle, found.designs


def _controllers(
    arguments: argparse.Namespace, of: OfVehicle, of_study: tuple[Design, ...] | None
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the controllers by name, and why others are missing."""
    from studies.controllers.designs import FURTHER, NAMES
    from symheli import TableController

    if arguments.controller:
        if arguments.only:
            raise InputError("--only is about the controllers of the study: leave out --controller")
        tables = {path.stem: TableController.load(path) for path in arguments.controller}
        return {name: table.model for name, table in tables.items()}, {}
    known = (*NAMES, *FURTHER) if arguments.only and of_study is None else NAMES
    for start in arguments.only:
        if not any(name.startswith(start) for name in known):
            raise UnknownNameError("controller of the study", start, known)
    names = [n for n in known if not arguments.only or any(n.startswith(s) for s in arguments.only)]
    made = [d for d in of_study if d.name in names] if of_study else list(of.designs(names))
    missing = {d.name: d.reason for d in made if d.controller is None}
    found = {d.name: d.controller for d in made if d.controller is not None}
    if not found:
        raise InputError("; ".join(f"{n}: {reason}" for n, reason in missing.items()))
    return found, missing


def _beside(table: SpecificationTable) -> str:
    """Return the worst design margin of every specification, a column a controller."""
    from synthesis.sheet.evaluation import margin

    each = {name: table.reached(name) for name in table.controllers}
    rows = [["axis", "specification", *each], ["", "margin, %"]]
    for k, spec in enumerate(table.sheet.specifications):
        cells = [_cell(reached[k]) for reached in each.values()]
        if any(cells):
            rows.append([spec.axis, spec.name, *(c or "-" for c in cells)])
    rows.append(["", "least that counts", *(margin(table.mark(name)) for name in each)])
    return columns(rows, left=2)


def _cell(reached: Any) -> str:
    from synthesis.sheet.evaluation import margin

    return reached.failure or margin(reached)


def _about(rate: float) -> str:
    """The statement of the proofs."""
    moving = f"changing at most at {rate:g} m/s^2" if rate else "held"
    return (
        f"Proven for every airspeed between the ends, {moving}, of the cubic interpolation of the"
        " vehicle, sampled with its servos and the delay."
    )


def _written(
    arguments: argparse.Namespace, table: SpecificationTable, lead: str, missing: dict[str, str]
) -> list[Path]:
    from studies.specs import page
    from synthesis.sheet.picture import save

    written = []
    if arguments.figure is not None:
        written.append(save(table, arguments.figure))
    path = arguments.page
    if path is None and arguments.study is not None:
        path = arguments.study / PAGE
    if path is not None:
        about = _about(arguments.rate)
        title = f"Specification sheet: {table.sheet.title}"
        written.append(page.write(table, path, title, f"{lead}.", missing, about))
    return written


def _data(table: SpecificationTable, missing: dict[str, str]) -> dict[str, Any]:
    return {
        "title": table.sheet.title,
        "parameter": str(table.parameter),
        "unit": table.parameter.unit,
        "at": table.at,
        "seconds": table.seconds,
        "missing": missing,
        "controllers": {
            name: {
                "verdict": table.verdict(name),
                "stable": table.stable[name],
                "specifications": table.entries(name),
                "proven": [
                    {
                        "axis": p.specification.axis,
                        "name": p.specification.name,
                        "unit": p.specification.unit,
                        "proven": p.value,
                        "frozen": p.frozen,
                        "margin": p.margin,
                        "seconds": p.seconds,
                    }
                    for p in table.proven.get(name, ())
                ],
            }
            for name in table.controllers
        },
    }
