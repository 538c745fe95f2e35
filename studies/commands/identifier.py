"""Options of `symheli export identifier`: which model an autopilot shall identify in flight."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options
from studies.commands.arguments import flag, group, option

if TYPE_CHECKING:
    from identification import RecursiveLeastSquares
    from symheli import Helicopter

ARGUMENTS = (
    group(
        "identifier",
        "C code that identifies the coefficients over airspeed in flight",
        option(
            "--outputs",
            "A,B",
            "states to predict (default: theta,w,u)",
            options.names,
            ("theta", "w", "u"),
        ),
        option(
            "--inputs",
            "C,D",
            "inputs that drive them (default: d_lon,d_col)",
            options.names,
            ("d_lon", "d_col"),
        ),
        option("--na", "N", "lags of the outputs", options.count, 3),
        option("--nb", "N", "lags of the inputs", options.count, 3),
        option("--delay", "N", "first lag of the inputs", options.count, 1),
        option("--degree", "N", "polynomial degree in airspeed", options.count, 2),
        flag(
            "--offset",
            "include a trim c(p) that varies with p, for outputs that are not deviations",
        ),
        option("--forgetting", "L", "factor a sample, in (0, 1] (default: 1)", options.number, 1.0),
        flag("--directional", "forget in the direction of the new regressor only"),
        flag("--single", "use single instead of double precision"),
    ),
)


OPTIONS = {
    *("outputs", "inputs", "na", "nb", "delay", "degree", "offset"),
    *("forgetting", "directional", "single"),
}


def write(arguments: argparse.Namespace, heli: Helicopter) -> tuple[Path, ...]:
    """Write the files into the folder --out (default: estimator)."""
    from identification.export import write_estimator

    return write_estimator(*estimator(arguments, heli), arguments.out or Path("estimator"))


def estimator(
    arguments: argparse.Namespace, heli: Helicopter
) -> tuple[RecursiveLeastSquares, dict[str, str]]:
    """The estimator that is asked for, and the units of its signals."""
    from identification import LPVARX, Polynomial, RecursiveLeastSquares
    from identification.forgetting import Constant, Directional
    from symheli.errors import UnknownNameError

    units = {str(s): s.unit for s in (*heli.states, *heli.inputs)} | {"airspeed": "m/s"}
    for name in (*arguments.outputs, *arguments.inputs):
        if name not in units:
            raise UnknownNameError("signal", name, units)
    arx = LPVARX(
        arguments.outputs,
        arguments.inputs,
        "airspeed",
        na=arguments.na,
        nb=arguments.nb,
        delay=arguments.delay,
        basis=Polynomial(arguments.degree, *arguments.airspeeds),
        offset=arguments.offset,
    )
    way = (
        Directional(arguments.forgetting)
        if arguments.directional
        else Constant(arguments.forgetting)
    )
    precision = "single" if arguments.single else "double"
    return RecursiveLeastSquares(arx, way, precision=precision), units
