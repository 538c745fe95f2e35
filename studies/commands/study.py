"""symheli study: the transition study, from equations to a report."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import Argument, flag, option, positional
from studies.commands.options import count
from studies.output import Output

if TYPE_CHECKING:
    from studies.transition.configuration import Configuration

HELP = "the main job: model, identification, guarantees, report"
OVERRIDE = ("vehicle", "seed", "out", "quick")
"""Options that take precedence over the file."""

ARGUMENTS = (
    positional(
        "file",
        "TOML file with the options; see --write-config",
        nargs="?",
        type=Path,
        metavar="FILE",
    ),
    *options.vehicle(None, "packaged airframe or TOML file (default: xcell60)", in_place=False),
    option("--out", "DIR", "folder of report and numbers (default: study)", Path),
    Argument(
        "--quick",
        {
            "action": argparse.BooleanOptionalAction,
            "help": "fly shorter and fewer flights: a quick look, not the full result",
        },
    ),
    option("--seed", "N", "excitation and noise (default: 0)", count),
    flag(
        "--resume",
        "take the stages that an earlier run has finished from DIR/stages, where version, vehicle,"
        " seed and what they read of the effort are the same; others, and damaged ones, are"
        " computed again",
    ),
    options.write_config("a configuration"),
)


def run(arguments: argparse.Namespace) -> Output:
    """Run the study; it shows its own progress and writes into the folder."""
    options.file_or_vehicle(arguments)
    configuration = _configuration(arguments)
    if arguments.write_config is not None:
        options.refuse(arguments, ["resume"], "on --write-config, which runs nothing")
        return options.choices_written(configuration.text, arguments.write_config)
    from studies.transition.study import run_study

    result = run_study(configuration, resume=arguments.resume)
    report = configuration.out / "report.html"
    written = f"\nnumbers: {configuration.out / 'results.json'}\nreport: {report}"
    return Output(f"{result.summary()}\n{written}", result.to_dict())


def _configuration(arguments: argparse.Namespace) -> Configuration:
    from studies.transition.configuration import Configuration

    given = {name: getattr(arguments, name) for name in OVERRIDE}
    return Configuration.read(arguments.file, {k: v for k, v in given.items() if v is not None})


def kept(arguments: argparse.Namespace) -> str:
    """Return a message on the finished part of an interrupted run."""
    if arguments.write_config is not None:
        return "nothing was written, files that were there are unchanged"
    return f"what was finished is in {_configuration(arguments).out}; --resume goes on from there"
