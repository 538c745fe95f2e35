"""symheli campaign: the study's identification over many seeds."""

from __future__ import annotations

import argparse

from studies.commands.options import at_least_one
from studies.output import Output

HELP = "repeat the identification over many seeds: how much do the numbers scatter"


def configure(parser: argparse.ArgumentParser) -> None:
    """How many, of which airframe."""
    parser.add_argument(
        "--vehicle",
        default="xcell60",
        metavar="NAME",
        help="packaged airframe or TOML file (default: %(default)s)",
    )
    parser.add_argument(
        "--seeds",
        type=at_least_one,
        default=20,
        metavar="N",
        help="number of seeds (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> Output:
    """Run the campaign; it shows its own progress."""
    from studies.transition.campaign import run_campaign

    result = run_campaign(seeds=arguments.seeds, vehicle=arguments.vehicle)
    return Output(result.summary(), result.to_dict())
