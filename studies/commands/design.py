"""symheli design: which excitation and which transition tell most, within limits."""

from __future__ import annotations

import argparse

from studies.commands import options
from studies.output import Output

HELP = (
    "design an experiment, not a controller (symheli synthesize does that): compare excitations and"
    " airspeed schedules by what an identification would learn from them"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Axis, limits, how many flights."""
    parser.add_argument(
        "--vehicle",
        default="xcell60",
        metavar="NAME",
        help="packaged airframe or TOML file (default: %(default)s)",
    )
    parser.add_argument(
        "--axis",
        choices=("longitudinal", "lateral", "all"),
        default="longitudinal",
        help="default: %(default)s",
    )
    parser.add_argument(
        "--flights",
        type=options.at_least_one,
        default=3,
        metavar="N",
        help="to choose (default: %(default)s)",
    )
    parser.add_argument(
        "--attitude-deg",
        type=options.positive,
        default=28.6,
        metavar="DEG",
        help="largest roll and pitch (default: 28.6)",
    )
    parser.add_argument(
        "--rate",
        type=options.positive,
        default=2.0,
        metavar="RAD/S",
        help="largest roll and pitch rate (default: 2)",
    )


def run(arguments: argparse.Namespace) -> Output:
    """Fly every candidate in the model; it shows its own progress."""
    import math

    from studies.campaigns import experiments
    from studies.transition.axes import ALL, LATERAL, LONGITUDINAL

    axis = {"longitudinal": LONGITUDINAL, "lateral": LATERAL, "all": ALL}[arguments.axis]
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
    return Output(f"{axis.name}, order 3, degree 2\n{found.table()}", data)
