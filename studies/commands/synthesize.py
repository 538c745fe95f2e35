"""Command symheli synthesize: a controller designed, certified as implemented, and simulated."""

from __future__ import annotations

import argparse
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import option, positional
from studies.output import Output, progress
from symheli.errors import InputError

if TYPE_CHECKING:
    from studies.controllers.design_choices import DesignChoices

HELP = (
    "design a scheduled controller, prove its gain as it flies (reduced, sampled, tabulated, behind"
    " servos and delay), fly it in turbulence"
)
OVERRIDE = ("vehicle", "model", "out")
"""Options that take precedence over the file."""

ARGUMENTS = (
    positional(
        "file",
        "TOML file with the choices; see --write-config (default: its defaults)",
        nargs="?",
        type=Path,
        metavar="FILE",
    ),
    *options.vehicle(None, "packaged airframe or TOML file (default: xcell60)", in_place=False),
    option(
        "--model",
        "FILE",
        "design for this model instead, written by symheli identify --save, or a family of linear"
        " models; the controller is flown in the vehicle",
    ),
    option(
        "--out", "DIR", "folder of table, certificate, numbers and page (default: controller)", Path
    ),
    options.write_config("the choices"),
    *options.page("sliders for the sizes, what they do to frozen loops, and a button that proves"),
)


def run(arguments: argparse.Namespace) -> Output:
    """Everything, and what came of it; status 1 where nothing is proven or a flight was lost."""
    from studies.controllers.design_choices import DesignChoices

    options.file_or_vehicle(arguments)
    given = {name: getattr(arguments, name) for name in OVERRIDE}
    choices = DesignChoices.read(arguments.file, {k: v for k, v in given.items() if v is not None})
    if arguments.file is None:
        choices = _starting(choices, arguments.vehicle)
    if arguments.write_config is not None and arguments.page is not None:
        raise InputError("--page shows sizes, --write-config writes them: give one of the two")
    if arguments.write_config is not None:
        return options.choices_written(choices.text, arguments.write_config)
    if arguments.page is not None:
        return _page(choices, arguments.page)
    from studies.controllers import synthesized_report as report
    from studies.controllers.synthesized import synthesized

    found = synthesized(choices, _given(choices))
    written = report.write(found)
    failed = not found.sampled.certificate.verified or found.lost > 0
    data = {**report.data(found), "written": written}
    return Output(report.text(found, written), data, status=int(failed))


def _page(choices: DesignChoices, port: int) -> Output:
    """Show the sizes in a browser until Ctrl-C."""
    from studies.page.sizes_page import sizes_page

    title = f"Sizes of a controller for {choices.vehicle or choices.model}"
    with sizes_page(choices, _given(choices), title, port) as (page, session):
        progress(f"page: {page.address}\nCtrl-C ends")
        with suppress(KeyboardInterrupt):
            while True:
                time.sleep(0.2)
        said = session.saved or "nothing was saved"
    return Output(said, {"saved": session.saved})


def _starting(choices: DesignChoices, vehicle: str | None) -> DesignChoices:
    """The choices with what follows from the vehicle or from the model."""
    from studies.controllers import starting

    if (given := _given(choices)) is None:
        return starting.for_vehicle(choices)
    return starting.for_model(choices, starting.state_space(given), given, vehicle or "")


def _given(choices: DesignChoices):
    """The model of a file that is designed for."""
    from studies.commands.given_model import read
    from symheli import LinearFamily

    if not choices.model:
        return None
    path = Path(choices.model)
    if not path.is_file():
        raise InputError(
            f"model: there is no file {path}, neither beside the file of choices nor here; symheli"
            " identify --save FILE writes one"
        )
    given = read(path)
    if isinstance(given, LinearFamily) and given.axes != ("airspeed",):
        over = ", ".join(f"{axis} ({axis.unit})" for axis in given.axes)
        raise InputError(
            f"{path}: expected a family over airspeed in m/s alone, got one over {over};"
            " LinearFamily.fix at one value of every other axis makes one"
        )
    return given
