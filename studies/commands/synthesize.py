"""symheli synthesize: a controller designed, certified as it flies, and flown."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.output import Output
from symheli.errors import InputError

if TYPE_CHECKING:
    from studies.controllers.asked import Asked

HELP = (
    "design a scheduled controller, prove its gain as it flies (reduced, sampled, tabulated, behind"
    " servos and delay), fly it in turbulence"
)
OVERRIDE = ("vehicle", "model", "out")
"""Options that win over the file."""
STANDARD_OUTPUT = "-"


def configure(parser: argparse.ArgumentParser) -> None:
    """Configuration file, what wins over it."""
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="TOML file with the choices; see --write-config (default: its defaults)",
    )
    parser.add_argument(
        "--vehicle", metavar="NAME", help="packaged airframe or TOML file (default: xcell60)"
    )
    parser.add_argument(
        "--model",
        metavar="FILE",
        help=(
            "design for this model instead: of symheli identify --save, or a family of linear"
            " models; it is flown in the vehicle"
        ),
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder of table, certificate, numbers and page (default: controller)",
    )
    parser.add_argument(
        "--write-config",
        nargs="?",
        const=STANDARD_OUTPUT,
        metavar="FILE",
        help="write the choices with their defaults (default: to standard output); run nothing",
    )


def run(arguments: argparse.Namespace) -> Output:
    """Everything, and what came of it; status 1 where nothing is proven or a flight was lost."""
    from studies.controllers.asked import Asked

    given = {name: getattr(arguments, name) for name in OVERRIDE}
    asked = Asked.read(arguments.file, {k: v for k, v in given.items() if v is not None})
    if arguments.write_config is not None:
        return _configuration(asked, arguments.write_config)
    from studies.controllers import synthesized_report as report
    from studies.controllers.synthesized import synthesized

    found = synthesized(asked, _given(asked))
    written = report.write(found)
    failed = not found.flown.certificate.verified or found.lost > 0
    data = {**report.data(found), "written": written}
    return Output(report.text(found, written), data, status=int(failed))


def _given(asked: Asked):
    """The model of a file that is designed for."""
    from studies.commands.given_model import read
    from symheli.lpv import LinearGrid

    if not asked.model:
        return None
    given = read(Path(asked.model))
    if isinstance(given, LinearGrid):
        raise InputError(f"{asked.model}: expected a model over airspeed, got one over more")
    return given


def _configuration(asked: Asked, target: str) -> Output:
    from symheli.values.whole_files import write_text

    if target == STANDARD_OUTPUT:
        return Output(asked.text().rstrip("\n"), {"configuration": asked.text()})
    path = Path(target)
    if path.exists():
        raise InputError(f"{path} is there; give another name, or remove it")
    write_text(path, asked.text())
    return Output(f"wrote {path}", {"written": path})
