"""symheli export: models and controllers for other programs, as C code, a MATLAB file, or
equations in print.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands import fmu, given_model, identifier, monitor, options
from studies.commands.arguments import group, option, positional, renamed, several
from studies.output import Output
from symheli.errors import InputError

HELP = (
    "C code of the equations of motion, of a recursive identification, of an identified model, of a"
    " controller or of the monitor of its certificate, FMUs, a MATLAB file, or equations in print"
)

ARGUMENTS = (
    positional(
        "format",
        "c: equations of motion and header; identifier: recursive identification as C for an"
        " autopilot; model: an identified model (--model) as C; controller: one in a table over"
        " airspeed (--model) as C; monitor: whether the hypotheses of its certificate are met, as"
        " C; fmu: the helicopter, a controller or an identifier for co-simulation; mat: linear"
        " models along airspeed, or what --model holds; latex,"
        " markdown: every component's equations to read",
        type=renamed({"estimator": "identifier"}, "symheli export"),
        choices=(
            "c",
            "identifier",
            "model",
            "controller",
            "monitor",
            "fmu",
            "mat",
            "latex",
            "markdown",
        ),
    ),
    *options.HELICOPTER,
    option(
        "--out",
        "PATH",
        "file (default: NAME_rhs.c, NAME_family.mat, NAME_equations.tex or .md, helicopter.fmu,"
        " ...) or folder (identifier, model, controller, monitor)",
        Path,
    ),
    option(
        "--target",
        ("cortex-m4", "cortex-m7"),
        "identifier, model, controller, monitor: a Makefile for this bare core beside the C code,"
        " with a check in qemu-system-arm",
    ),
    several(
        "--airspeeds",
        ("LOW", "HIGH"),
        "range, m/s (default: 0 13)",
        type=options.number,
        default=(0.0, 13.0),
    ),
    option("--points", "N", "airspeeds of the family", options.at_least_one, 14),
    *identifier.ARGUMENTS,
    *monitor.ARGUMENTS,
    *fmu.ARGUMENTS,
    group(
        "model, controller, monitor, fmu, mat",
        "C code that predicts and simulates what symheli identify --save kept (--single applies),"
        " or that flies what TableController.save kept; a MATLAB file of an identified model or a"
        " family of linear models",
        option(
            "--model",
            "FILE",
            "the identified model, the controller, or the family of linear models",
            Path,
        ),
    ),
)


MONITOR = {"certificate", "reading_error", "rate_window", "jitter"}
EFFECTIVE: dict[str, set[str]] = {
    "c": {*options.OF_A_VEHICLE},
    "identifier": {*options.OF_A_VEHICLE, *identifier.OPTIONS, "airspeeds", "target"},
    "model": {"single", "target"},
    "controller": {"target"},
    "monitor": {*MONITOR, "target"},
    "fmu": {"of"},
    "mat": {*options.OF_A_VEHICLE, "airspeeds", "points"},
    "latex": {*options.OF_A_VEHICLE},
    "markdown": {*options.OF_A_VEHICLE},
}
"""Options that have an effect on a format, beside --out and --model."""
OPTIONS = set[str]().union(*EFFECTIVE.values(), *fmu.EFFECTIVE.values())


def run(arguments: argparse.Namespace) -> Output:
    """Write the file(s) and list them; raises `InputError` for an option that has no effect on
    them.
    """
    idle = OPTIONS - EFFECTIVE[arguments.format] - {"model"}
    if arguments.format == "fmu" and arguments.of:
        idle = OPTIONS - {"of"} - fmu.EFFECTIVE[arguments.of]
    if arguments.model and arguments.format == "mat":
        idle |= {*options.OF_A_VEHICLE, "airspeeds", "points"}
    options.refuse(arguments, sorted(idle), f"on the format {arguments.format}")
    if arguments.format == "fmu":
        return _list(fmu.write(arguments))
    if arguments.format in OF_A_FILE:
        return _list(_on_board(arguments, OF_A_FILE[arguments.format](arguments)))
    if arguments.model and arguments.format == "mat":
        return _list(_mat(arguments))
    if arguments.model:
        raise InputError(
            "--model applies to the formats model, controller, monitor, fmu and mat;"
            f" {arguments.format} is written for a vehicle"
        )
    heli = options.helicopter(arguments)
    name = Path(arguments.vehicle).stem
    if arguments.format == "c":
        from symheli.export import write_c

        written = write_c(heli, arguments.out or Path(f"{name}_rhs.c"))
    elif arguments.format == "identifier":
        written = _on_board(arguments, identifier.write(arguments, heli))
    elif arguments.format == "mat":
        from symheli.export import write_mat

        written = write_mat(
            heli,
            arguments.out or Path(f"{name}_family.mat"),
            *arguments.airspeeds,
            points=arguments.points,
        )
    else:
        from symheli.equations import markdown
        from symheli.values.whole_files import write_text

        content, suffix = (
            (heli.latex(standalone=True), "tex")
            if arguments.format == "latex"
            else (markdown(heli), "md")
        )
        written = (write_text(arguments.out or Path(f"{name}_equations.{suffix}"), content),)
    return _list(written)


def _model(arguments: argparse.Namespace) -> tuple[Path, ...]:
    from identification.export import write_kinematic_model, write_model
    from identification.model import KinematicModel, LPVARXModel

    given = given_model.read(
        _named(arguments, "as symheli identify LOG --save FILE.json writes it")
    )
    folder = arguments.out or Path("model")
    precision = "single" if arguments.single else "double"
    if isinstance(given, KinematicModel):
        return write_kinematic_model(given, folder, precision=precision)
    if isinstance(given, LPVARXModel):
        return write_model(given, folder, precision=precision)
    raise InputError(
        f"{arguments.model}: a family of linear models cannot be exported as C; symheli export mat"
        " writes it for MATLAB"
    )


def _mat(arguments: argparse.Namespace) -> tuple[Path, ...]:
    """The model of --model for MATLAB."""
    from symheli import LinearFamily
    from symheli.export import write_family_mat

    given, path = given_model.read(arguments.model), arguments.out
    path = path or Path(f"{arguments.model.stem}.mat")
    if isinstance(given, LinearFamily):
        return write_family_mat(given, path, arguments.model.name)
    return (given.save_mat(path),)


def _controller(arguments: argparse.Namespace) -> tuple[Path, ...]:
    from symheli.export import write_controller
    from symheli.flight import TableController

    controller = TableController.load(_named(arguments, "as TableController.save writes it"))
    return write_controller(controller, arguments.out or Path("controller"))


def _monitor(arguments: argparse.Namespace) -> tuple[Path, ...]:
    return monitor.write(arguments, _named(arguments, "as TableController.save writes it"))


OF_A_FILE = {"model": _model, "controller": _controller, "monitor": _monitor}
"""Writers of the formats of C code that --model is for."""


def _on_board(arguments: argparse.Namespace, written: tuple[Path, ...]) -> tuple[Path, ...]:
    """The files, with what --target adds beside them."""
    if arguments.target is None:
        return written
    from symheli.export import write_board

    return (*written, *write_board(written[0].parent, arguments.target))


def _named(arguments: argparse.Namespace, how: str) -> Path:
    """The file of --model."""
    if arguments.model is None:
        what = "controller" if arguments.format == "monitor" else arguments.format
        raise InputError(f"name the {what}: --model FILE.json, {how}")
    return arguments.model


def _list(written: tuple[Path, ...]) -> Output:
    return Output("\n".join(f"wrote {path}" for path in written), {"written": written})
