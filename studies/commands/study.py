"""symheli study: the transition study, from equations to a report."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.options import count
from studies.output import Output, columns

if TYPE_CHECKING:
    from studies.transition.configuration import Configuration

HELP = "the main job: model, identification, guarantees, report"
OVERRIDE = ("vehicle", "seed", "out", "quick")
"""Options that win over the file."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Configuration file, what wins over it, stages."""
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
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--only",
        type=options.names,
        default=(),
        metavar="STAGE,...",
        help="compute these stages; their inputs are read from DIR/stages, or computed if absent",
    )
    which.add_argument(
        "--from",
        dest="since",
        default="",
        metavar="STAGE",
        help="compute this stage and all that depend on it; the others are read from DIR/stages",
    )
    which.add_argument(
        "--list-stages",
        action="store_true",
        help="list name, dependencies and state of every stage; run none",
    )
    options.write_config(
        which,
        "write a configuration with the defaults (default: to standard output); run nothing",
    )
    parser.set_defaults(kept=_kept)


def run(arguments: argparse.Namespace) -> Output:
    """Run the study; it shows its own progress and writes into the folder."""
    configuration = _asked(arguments)
    if arguments.write_config is not None:
        return options.choices_written(configuration.text, arguments.write_config)
    if arguments.list_stages:
        return _listed(configuration)
    from studies.transition.study import run_study

    result = run_study(
        configuration, resume=arguments.resume, only=arguments.only, since=arguments.since
    )
    report = configuration.out / "report.html"
    told = f"\nnumbers: {configuration.out / 'results.json'}\nreport: {report}"
    return Output(f"{result.summary()}\n{told}", result.to_dict())


def _asked(arguments: argparse.Namespace) -> Configuration:
    from studies.transition.configuration import Configuration

    given = {name: getattr(arguments, name) for name in OVERRIDE}
    return Configuration.read(arguments.file, {k: v for k, v in given.items() if v is not None})


def _kept(arguments: argparse.Namespace) -> str:
    if arguments.write_config is not None or arguments.list_stages:
        return "nothing was written, files that were there are unchanged"
    return f"what was finished is in {_asked(arguments).out}; --resume goes on from there"


def _listed(configuration: Configuration) -> Output:
    from studies.transition.stages import stages
    from studies.transition.stored_stages import stored_stages

    every = stages(configuration.effort)
    stored = stored_stages(configuration, every)
    entries = [
        {
            "name": stage.name,
            "title": stage.title,
            "needs": stage.needs,
            "state": stored.state(stage.name, stage.kind),
        }
        for stage in every
    ]
    rows = [["stage", "state", "needs", "what it does"]]
    rows += [[e["name"], e["state"], ", ".join(e["needs"]) or "-", e["title"]] for e in entries]
    return Output(columns(rows, left=4), {"folder": stored.folder, "stages": entries})
