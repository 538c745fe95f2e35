"""symheli study: the transition study, from equations to a report."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands.options import count
from studies.output import Output

HELP = "the main job: model, identification, guarantees, report"


def configure(parser: argparse.ArgumentParser) -> None:
    """Vehicle, folder, length."""
    parser.add_argument(
        "--vehicle",
        default="xcell60",
        metavar="NAME",
        help="packaged airframe or TOML file (default: %(default)s)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("study"),
        metavar="DIR",
        help="folder of report and numbers (default: %(default)s)",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="shorter flights and fewer of them: a look, not the result",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="N",
        help="excitation and noise (default: %(default)s)",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help=(
            "take the stages that an earlier run has finished from DIR/stages, where version,"
            " vehicle, effort and seed are the same; others, and damaged ones, are computed again."
            " They are Python pickles: resume only folders of your own"
        ),
    )
    parser.set_defaults(
        kept=lambda arguments: (
            f"what was finished is in {arguments.out}; --resume goes on from there"
        )
    )


def run(arguments: argparse.Namespace) -> Output:
    """Run the study; it shows its own progress and writes into the folder."""
    from studies.transition.study import run_study

    result = run_study(
        vehicle=arguments.vehicle,
        out=arguments.out,
        quick=arguments.quick,
        seed=arguments.seed,
        resume=arguments.resume,
    )
    return Output(result.summary(), result.to_dict())
