"""symheli study: the transition study, from equations to a report."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.options import count
from studies.output import Output

if TYPE_CHECKING:
    from studies.transition.configuration import Configuration

HELP = "the main job: model, identification, guarantees, report"
OVERRIDE = ("vehicle", "seed", "out", "quick")
"""Options that win over the file."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Configuration file, and what wins over it."""
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="TOML file with the options; see --write-config",
    )
    parser.add_argument(
        "--vehicle", metavar="NAME", help="packaged airframe or TOML file (default: xcell60)"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of report and numbers (default: study)"
    )
    parser.add_argument(
        "--quick",
        action=argparse.BooleanOptionalAction,
        help="fly shorter and fewer flights: a quick look, not the full result",
    )
    parser.add_argument("--seed", type=count, metavar="N", help="excitation and noise (default: 0)")
    parser.add_argument(
        "--resume",
        action="store_true",
        help=(
            "take the stages that an earlier run has finished from DIR/stages, where version,"
            " vehicle, seed and what they read of the effort are the same; others, and damaged"
            " ones, are computed again"
        ),
    )
    options.write_config(
        parser,
        "write a configuration with the defaults (default: to standard output); run nothing",
    )
    parser.set_defaults(kept=_kept)


def run(arguments: argparse.Namespace) -> Output:
    """Run the study; it shows its own progress and writes into the folder."""
    configuration = _asked(arguments)
    if arguments.write_config is not None:
        return options.choices_written(configuration.text, arguments.write_config)
    from studies.transition.study import run_study

    result = run_study(configuration, resume=arguments.resume)
    report = configuration.out / "report.html"
    told = f"\nnumbers: {configuration.out / 'results.json'}\nreport: {report}"
    return Output(f"{result.summary()}\n{told}", result.to_dict())


def _asked(arguments: argparse.Namespace) -> Configuration:
    from studies.transition.configuration import Configuration

    given = {name: getattr(arguments, name) for name in OVERRIDE}
    return Configuration.read(arguments.file, {k: v for k, v in given.items() if v is not None})


def _kept(arguments: argparse.Namespace) -> str:
    if arguments.write_config is not None:
        return "nothing was written, files that were there are unchanged"
    return f"what was finished is in {_asked(arguments).out}; --resume goes on from there"
