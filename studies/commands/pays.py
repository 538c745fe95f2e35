"""symheli pays: where a scheduled model beats a constant one, on flights in wind and noise."""

from __future__ import annotations

import argparse

from studies.commands.options import count, on_a_runner
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
    on_a_runner(parser)


def run(arguments: argparse.Namespace) -> Output:
    """Fly, fit, judge; it shows its own progress."""
    from studies.campaigns import pays
    from studies.campaigns.runners import runner

    with runner(arguments.workers, arguments.scheduler) as on:
        lines = list(
            pays.where_scheduling_pays(
                arguments.seeds, arguments.vehicle, on=on, path=arguments.out
            )
        )
    return Output(pays.table(lines), {"lines": pays.data(lines)})
