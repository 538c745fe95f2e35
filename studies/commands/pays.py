"""symheli pays: where a scheduled model beats a constant one, on flights in wind and noise."""

from __future__ import annotations

import argparse

from studies.commands.options import count
from studies.output import Output

HELP = (
    "where scheduling pays: LPV beside LTI on transitions in wind and noise, two inputs and all"
    " inputs"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """How many flights, of which airframe."""
    parser.add_argument(
        "--vehicle",
        default="xcell60",
        metavar="NAME",
        help="packaged airframe or TOML file (default: %(default)s)",
    )
    parser.add_argument(
        "--seeds",
        type=count,
        default=20,
        metavar="N",
        help="seeds beside the default one (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> Output:
    """Fly, fit, judge; it shows its own progress."""
    from studies.campaigns import pays

    lines = list(pays.where_scheduling_pays(arguments.seeds, arguments.vehicle))
    return Output(pays.table(lines), {"lines": pays.data(lines)})
