"""symheli experiment: the most informative excitation and transition, within limits."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands import options
from studies.commands.arguments import flag, option
from studies.output import Output
from symheli.errors import InputError

HELP = (
    "design an experiment, not a controller (symheli synthesize does that): compare excitations and"
    " airspeed schedules by what an identification would learn from them"
)

ARGUMENTS = (
    *options.vehicle(),
    option(
        "--axis",
        ("longitudinal", "lateral", "all"),
        "outputs and inputs of the model",
        default="longitudinal",
    ),
    option("--flights", "N", "to choose", options.at_least_one, 3),
    option(
        "--attitude-deg", "DEG", "largest roll and pitch (default: 28.6)", options.positive, 28.6
    ),
    option("--rate", "RAD/S", "largest roll and pitch rate (default: 2)", options.positive, 2.0),
    option(
        "--write",
        "DIR",
        "write what is flown: tables (CSV), sweeps for ArduPilot's SystemID mode (.param), a"
        " player, and plan.json",
        Path,
    ),
    option(
        "--flown",
        "LOG",
        "after the flight: are these records enough? .npz, or by --map; with --plan, which holds"
        " everything else",
        Path,
        nargs="+",
    ),
    option("--plan", "FILE", "the plan.json that --write wrote, for --flown", Path),
    flag("--sweeps", "with --flown: hold the records against the sweeps of the plan"),
    option("--map", "FILE", "signal map of the logs of --flown (docs/identify.md)", Path),
)


def run(arguments: argparse.Namespace) -> Output:
    """Fly every candidate in the model; it shows its own progress."""
    import math

    from studies.campaigns import experiments
    from studies.campaigns.flyable import write
    from studies.setup.axes import CHOICES

    if arguments.flown or arguments.plan:
        return _flown(arguments)
    options.refuse(arguments, ("sweeps", "map"), "without --flown")
    axis = CHOICES[arguments.axis]
    attitude = math.radians(arguments.attitude_deg)
    limits = {"phi": attitude, "theta": attitude, "p": arguments.rate, "q": arguments.rate}
    found = experiments.design(arguments.vehicle, axis, arguments.flights, limits)
    data = {
        "axis": axis.name,
        "limits": limits,
        "lost": found.lost,
        "plan": [e.name for e in found.plan.experiments],
        "candidates": [
            {
                "name": e.name,
                "seconds": e.duration,
                "bounds": e.bounds,
                "exceeded": dict(e.exceeded),
            }
            for e in found.experiments
        ],
    }
    text = f"{axis.name}, order 3, degree 2\n{found.table()}"
    if arguments.write:
        written, words = write(arguments.write, arguments.vehicle, axis, found, limits)
        data["written"] = written
        text = "\n".join([text, "", words, *(f"wrote {path}" for path in written)])
    return Output(text, data)


def _table(log: Path) -> Path:
    """Return a log that is a table; raise `InputError` for one of a format that a map reads."""
    from symheli.logs.format import format_named, format_of

    if not format_named(kind := format_of(log)).any_text:
        raise InputError(f"{log}: a log of the format {kind} needs a signal map, --map FILE.toml")
    return log


def _flown(arguments: argparse.Namespace) -> Output:
    """Hold records against a plan."""
    from studies.campaigns.flyable import flown
    from symheli import FlightRecord

    if not (arguments.flown and arguments.plan):
        raise InputError("give --flown LOG together with --plan plan.json")
    held = ("vehicle", "axis", "flights", "attitude_deg", "rate", "write")
    options.refuse(arguments, held, "on --flown, for which --plan holds everything")
    records = [
        FlightRecord.load(log)
        if log.suffix == ".npz"
        else FlightRecord.from_map(log, arguments.map)
        if arguments.map
        else FlightRecord.from_csv(_table(log))
        for log in arguments.flown
    ]
    found = flown(arguments.plan, records, sweeps=arguments.sweeps)
    data = {
        "enough": found.enough,
        "median_ratio": found.median,
        "ratios": dict(zip(found.names, found.ratio, strict=True)),
        "seconds": found.seconds,
        "airspeed": list(found.covered),
        "airspeed_planned": list(found.planned),
    }
    return Output(str(found), data)
