"""A controller as C99 for an autopilot: the bits that were analysed and flown in simulation, with a
check of what Python computed.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from symheli.errors import InputError
from symheli.export.controller_check import cases
from symheli.flight.table_controller import TableController
from symheli.values.c_text import (
    define,
    in_comment,
    index_macros,
    literals,
    require_identifier,
    rows,
    table,
)
from symheli.values.template import filled_module
from symheli.values.units import per_second
from symheli.values.whole_files import write_text

HERE = Path(__file__).parent
"""controller.c, .h and _check.c lie here, with marked places for one controller."""


def write_controller(
    controller: TableController, folder: str | os.PathLike[str], name: str = "controller"
) -> tuple[Path, ...]:
    """Write a controller as C99 in 32-bit arithmetic: no allocation, no library.

    Compiled with -ffp-contract=off it gives the bits of the `TableController`. NAME_check.c is a
    program that carries a flight and exits with 0 where the compiled controller gives the commands
    computed here.

    Parameters
    ----------
    controller : TableController
        What is written; how far it has flown does not matter.
    folder : path
        Where the files go; made as needed.
    name : str
        A C identifier: of the files and functions, in capitals of the macros.

    Returns
    -------
    tuple of Path
        NAME.h, NAME.c and NAME_check.c.

    Raises
    ------
    InputError
        For a name that is no C identifier.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_controller
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> lqr = symheli.gain_scheduled_lqr(heli, 0.0, 8.0, dt=0.02, points=5)
    >>> controller = symheli.TableController.of(lqr.scheduled_controller.model)
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_controller(controller, folder.name, "lqr")]
    ['lqr.h', 'lqr.c', 'lqr_check.c']
    >>> folder.cleanup()
    """
    if not isinstance(controller, TableController):
        raise InputError(
            f"expected a TableController, got {type(controller).__name__}; make one with"
            " TableController.of(model)"
        )
    require_identifier(name)
    up = f"{name.upper()}_"
    files = filled_module(
        HERE / "controller",
        name,
        _header(controller, up),
        {"tables": _tables(controller)},
        {"cases": cases(controller, up)},
    )
    return tuple(write_text(Path(folder) / file, content) for file, content in files.items())


def _header(controller: TableController, up: str) -> dict[str, object]:
    """Sizes, the index of every signal with its unit, and what the controller is in words."""
    sizes = [
        define(f"{up}NX", controller.order, "states"),
        define(f"{up}NU", len(controller.inputs)),
        define(f"{up}NY", len(controller.outputs)),
        define(f"{up}DT", f"{controller.dt:.9g}f", "s between two samples"),
    ]
    blocks = [
        sizes,
        index_macros(
            f"{up}U_", controller.inputs, [_read(controller, s) for s in controller.inputs]
        ),
        index_macros(
            f"{up}Y_", controller.outputs, [_said(controller, y) for y in controller.outputs]
        ),
    ]
    (scheduling,) = controller.model.parameters
    unit = in_comment(scheduling.unit)
    return {
        "parameter": in_comment(scheduling.name),
        "unit": unit,
        "per_second": in_comment(per_second(scheduling.unit)),
        "dt": f"{controller.dt:.9g}",
        "knots": len(controller.knots),
        "low": f"{controller.knots[0]:g}",
        "high": f"{controller.knots[-1]:g}{'' if unit == '1' else f' {unit}'}",
        "rate": f"{scheduling.limit:g}",
        "fade": f"{controller.fade:g}",
        "follow": "as its sensor reads it"
        if controller.follow == "reading"
        else "as it is commanded",
        "sizes": "\n\n".join("\n".join(b) for b in blocks),
    }


def _read(controller: TableController, name: str) -> str:
    """What is given where a controller reads a command of its own."""
    own = name in controller.own_commands
    return "in force, its trim before one is; reference: the trim" if own else ""


def _said(controller: TableController, output: str) -> str:
    """Limits of a command, and whether it integrates."""
    ends = controller.limits.get(output)
    said = [f"{ends[0]:g} to {ends[1]:g}"] if ends else []
    return ", ".join([*said, *(["integrates"] if output in controller.integrates else [])])


def _tables(controller: TableController) -> str:
    n = controller.numbers
    scalars = {
        "fade": n.fade,
        "step": n.step,
        "gain": n.gain,
        "fallback": n.fallback,
    }
    return "\n".join(
        [
            f"enum {{ KNOTS = {len(n.knots)}, SEARCHES = {n.searches} }};",
            table("float", "knots", literals(n.knots, np.float32)),
            table("float", "matrices", literals(n.matrices.ravel(), np.float32)),
            rows("float", "limits", "2", np.column_stack([n.low, n.high]), np.float32),
            table("int", "integrates", n.integrates.astype(int).tolist()),
            table("float", "plausible", literals(map(float, n.plausible), np.float32)),
            f"static const int32_t frozen = {n.frozen}, hold = {n.hold};",
            *(
                f"static const float {key} = {literals([float(value)], np.float32)[0]};"
                for key, value in scalars.items()
            ),
        ]
    )
