"""Options of `symheli export fmu`: what the FMU is of, and where it starts."""

from __future__ import annotations

import argparse
from pathlib import Path

from studies.commands import identifier, options
from studies.commands.arguments import group, option
from symheli.errors import InputError

MODELS = ("helicopter", "identifier", "controller")

ARGUMENTS = (
    group(
        "fmu",
        "FMI 3.0 for co-simulation, with C sources, and the library of this platform where a C"
        " compiler is found",
        option("--of", MODELS, "the equations of motion, or what is written as C by this name"),
        option(
            "--airspeed",
            "V",
            "airspeed of the trim at which the helicopter starts, m/s (default: 0)",
            options.number,
            0.0,
        ),
        option(
            "--period",
            "S",
            "sample period of the identifier, s (default: 0.02)",
            options.number,
            0.02,
        ),
    ),
)

EFFECTIVE: dict[str, set[str]] = {
    "helicopter": {*options.OF_A_VEHICLE, "airspeed"},
    "identifier": {*options.OF_A_VEHICLE, *identifier.OPTIONS, "airspeeds", "period"},
    "controller": {"model"},
}
"""Options that have an effect on each, beside --of and --out."""


def write(arguments: argparse.Namespace) -> tuple[Path, ...]:
    """Write the FMU to --out (default: its model's name)."""
    if arguments.of is None:
        raise InputError(f"name the model of the FMU: --of, one of {', '.join(MODELS)}")
    path = arguments.out or Path(f"{arguments.of}.fmu")
    if arguments.of == "controller":
        return (_controller(arguments.model, path),)
    heli = options.helicopter(arguments)
    if arguments.of == "identifier":
        from identification.export import write_identifier_fmu

        rls, units = identifier.estimator(arguments, heli)
        return (write_identifier_fmu(rls, units, arguments.period, path),)
    from symheli import trim
    from symheli.export import write_helicopter_fmu

    return (write_helicopter_fmu(heli, path, trim(heli, arguments.airspeed)),)


def _controller(file: Path | None, path: Path) -> Path:
    from symheli.export import write_controller_fmu
    from symheli.flight import TableController

    if file is None:
        raise InputError(
            "name the controller: --model FILE.json, as TableController.save writes it"
        )
    return write_controller_fmu(TableController.load(file), path)
