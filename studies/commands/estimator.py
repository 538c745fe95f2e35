"""Options of `symheli export estimator`: which model an autopilot shall identify in flight."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from studies.commands import options

if TYPE_CHECKING:
    from symheli import Helicopter


def configure(parser: argparse.ArgumentParser) -> None:
    """Signals, orders, forgetting, precision."""
    group = parser.add_argument_group(
        "estimator", "C code that identifies the coefficients over airspeed in flight"
    )
    add = group.add_argument
    add(
        "--outputs",
        type=options.names,
        default=("theta", "w", "u"),
        metavar="A,B",
        help="states to predict (default: theta,w,u)",
    )
    add(
        "--inputs",
        type=options.names,
        default=("d_lon", "d_col"),
        metavar="C,D",
        help="inputs that drive them (default: d_lon,d_col)",
    )
    add(
        "--na",
        type=options.count,
        default=3,
        metavar="N",
        help="lags of the outputs (default: %(default)s)",
    )
    add(
        "--nb",
        type=options.count,
        default=3,
        metavar="N",
        help="lags of the inputs (default: %(default)s)",
    )
    add(
        "--delay",
        type=options.count,
        default=1,
        metavar="N",
        help="first lag of the inputs (default: %(default)s)",
    )
    add(
        "--degree",
        type=options.count,
        default=2,
        metavar="N",
        help="polynomial degree in airspeed (default: %(default)s)",
    )
    add(
        "--offset",
        action="store_true",
        help="include a trim c(p) that varies with p, for outputs that are not deviations",
    )
    add(
        "--forgetting",
        type=options.number,
        default=1.0,
        metavar="L",
        help="factor a sample, in (0, 1] (default: 1)",
    )
    add(
        "--directional",
        action="store_true",
        help="forget in the direction of the new regressor only",
    )
    add("--single", action="store_true", help="use single instead of double precision")


def write(arguments: argparse.Namespace, heli: Helicopter) -> tuple[Path, ...]:
    """Write the files into the folder --out (default: estimator)."""
    from identification import LPVARX, Constant, Directional, Polynomial, RecursiveLeastSquares
    from identification.export import write_estimator
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
    rls = RecursiveLeastSquares(arx, way, precision="single" if arguments.single else "double")
    return write_estimator(rls, units, arguments.out or Path("estimator"))
