"""symheli campaign: any trial over a grid and draws; the study's identification over many seeds."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands.arguments import flag, option, positional
from studies.commands.options import (
    ON_A_RUNNER,
    at_least_one,
    file_or_vehicle,
    kept_on_a_runner,
    vehicle,
)
from studies.output import Output
from symheli.errors import InputError

HELP = "a grid and draws of cases from a TOML file; without one the identification over many seeds"

ARGUMENTS = (
    positional(
        "file",
        "TOML file that declares the campaign (docs/campaigns.md)",
        nargs="?",
        type=Path,
        metavar="FILE",
    ),
    *vehicle(
        None, "(without FILE) packaged airframe or TOML file (default: xcell60)", in_place=False
    ),
    option("--seeds", "N", "(without FILE) seeds beside the default one, 20", at_least_one),
    option(
        "--show",
        "QUANTITY",
        "(with FILE) quantity to show in the table; may be repeated (default: the first ones)",
        action="append",
    ),
    flag("--again", "(with FILE) compute failed cases again"),
    *ON_A_RUNNER,
)
kept = kept_on_a_runner


def run(arguments: argparse.Namespace) -> Output:
    """Run the campaign; it shows its own progress."""
    from studies.campaigns.runners import runner

    file_or_vehicle(arguments)
    if arguments.file is not None:
        return _declared(arguments)
    if arguments.show or arguments.again:
        raise InputError("--show and --again need a campaign from a file: give the file")
    from studies.transition.campaign import run_campaign

    with runner(arguments.workers, arguments.scheduler) as on:
        result = run_campaign(
            seeds=arguments.seeds or 20,
            vehicle=arguments.vehicle or "xcell60",
            on=on,
            path=arguments.out,
        )
    return Output(result.summary(), result.to_dict())


def _declared(arguments: argparse.Namespace) -> Output:
    from studies.campaigns import summary
    from studies.campaigns.campaign_file import read_campaign
    from studies.campaigns.run import run as run_declared
    from studies.campaigns.runners import runner

    if arguments.vehicle or arguments.seeds:
        raise InputError(
            "--vehicle and --seeds apply to the built-in campaign; a campaign file sets both itself"
        )
    campaign = read_campaign(arguments.file)
    arguments.out = arguments.out or Path(f"{arguments.file.stem}.zarr")
    with runner(arguments.workers, arguments.scheduler) as on:
        dataset = run_declared(campaign, arguments.out, on, again=arguments.again)
    found = summary.data(campaign, dataset)
    nothing = found["failed"] == len(campaign.cases)
    return Output(summary.table(campaign, dataset, arguments.show), found, status=int(nothing))
