"""Command symheli design: the most informative excitation and transition, within limits."""

from __future__ import annotations

import argparse

from studies.commands import options
from studies.commands.arguments import option
from studies.output import Output

HELP = (
    "design an experiment, not a controller (symheli synthesize does that): compare excitations and"
    " airspeed schedules by what an identification would learn from them"
)

ARGUMENTS = (
    options.VEHICLE,
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
