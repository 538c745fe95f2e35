"""A controller as C99 for an autopilot: the bits that were analysed and flown in simulation, with a
check of what Python computed.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from symheli.errors import InputError
from symheli.export.c_program import CProgram
from symheli.export.c_text import (
    blocks,
    define,
    in_comment,
    index_macros,
    literals,
    rows,
    table,
)
from symheli.flight.table_controller import TableController
from symheli.values.arrays import Array
from symheli.values.units import per_second

HERE = Path(__file__).parent
"""controller.c, .h and _check.c lie here, with marked places for one controller."""


SAMPLES = 240
"""Length of the flight in the check program, samples."""

TOLERANCE = 1e-5
"""Of the largest command of an axis: what a compiler that contracts products and sums may make of
32-bit numbers.
"""
SIZES = (0.01, 0.1, 10.0)
"""Sizes of what is measured, in turn: far within the limits of a command, about them, beyond them.
"""

RESET, ENTER = 1, 2
"""Events of the flight, as controller_check.c knows them."""


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
    >>> lqr = symheli.flight.gain_scheduled_lqr(heli, 0.0, 8.0, dt=0.02, points=5)
    >>> controller = symheli.TableController.of(lqr.scheduled_controller.model)
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_controller(controller, folder.name, "lqr")]
    ['lqr.h', 'lqr.c', 'lqr_check.c']
    >>> folder.cleanup()
    """
    return program(controller, name).write(folder)


def program(controller: TableController, name: str) -> CProgram:
    """Return the files of `write_controller`."""
    if not isinstance(controller, TableController):
        raise InputError(
            f"expected a TableController, got {type(controller).__name__}; make one with"
            " TableController.of(model)"
        )
    up = f"{name.upper()}_"
    return CProgram(
        template=HERE / "controller",
        name=name,
        word="controller",
        header=_header(controller, up),
        source={"tables": _tables(controller)},
        check={"cases": _cases(controller, up)},
    )


def _header(controller: TableController, up: str) -> dict[str, object]:
    """Sizes, the index of every signal with its unit, and what the controller is in words."""
    sizes = [
        define(f"{up}NX", controller.order, "states"),
        define(f"{up}NU", len(controller.inputs)),
        define(f"{up}NY", len(controller.outputs)),
        define(f"{up}DT", f"{controller.dt:.9g}f", "s between two samples"),
    ]
    sections = [
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
        "sizes": blocks(*sections),
    }


def _read(controller: TableController, name: str) -> str:
    """Value that is given where a controller reads a command of its own."""
    own = name in controller.own_commands
    return "in force, its trim before one is; reference: the trim" if own else ""


def _said(controller: TableController, output: str) -> str:
    """Limits of a command, and whether it integrates."""
    ends = controller.limits.get(output)
    notes = [f"{ends[0]:g} to {ends[1]:g}"] if ends else []
    return ", ".join([*notes, *(["integrates"] if output in controller.integrates else [])])


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


def _cases(controller: TableController, up: str) -> str:
    """A flight from a fixed seed as C tables: any size of error, jumps of the parameter and bad
    ones, resets, entries, axes flown by others.
    """
    own, state, rng = controller, controller.init(), np.random.default_rng(0)
    nu, ny = len(own.inputs), len(own.outputs)
    events, axes, valid, status = (np.zeros(SAMPLES, int) for _ in range(4))
    given = np.zeros((SAMPLES, 2 * nu + 2 * ny + 1), np.float32)
    expected = np.zeros((SAMPLES, ny), np.float32)
    parameter = _parameter(rng, float(own.knots[0]), float(own.knots[-1]))
    for k in range(SAMPLES):
        block = k // 20
        draw = SIZES[block % len(SIZES)] * rng.standard_normal(2 * nu)
        given[k] = *draw, *(0.1 * rng.standard_normal(2 * ny)), parameter[k]
        events[k] = {0: RESET, 1: ENTER}.get(k % 47, 0)
        axes[k] = (1 << ny) - 1 if block % 4 else rng.integers(1 << ny)
        valid[k] = rng.random() > 0.05
        if k % 71 == 70:
            given[k, 0] = np.nan
        measured, reference, trim, others = np.split(given[k, :-1], np.cumsum([nu, nu, ny]))
        if events[k]:
            state = own.init(others if events[k] == ENTER else None)
        state = own.fly_axes(state, [y for i, y in enumerate(own.outputs) if axes[k] >> i & 1])
        expected[k], state = own.update(
            state, measured, reference, trim, given[k, -1], valid=bool(valid[k]), others=others
        )
        status[k] = state.status
    return "\n".join(
        [
            define("SAMPLES", SAMPLES),
            define("TOLERANCE", f"{TOLERANCE:g}"),
            *(
                table("int", name, values.tolist())
                for name, values in (
                    ("events", events),
                    ("axes", axes),
                    ("valid", valid),
                    ("status", status),
                )
            ),
            rows("float", "given", str(given.shape[1]), given, np.float32),
            rows("float", "expected", f"{up}NY", expected, np.float32),
        ]
    )


def _parameter(rng: np.random.Generator, low: float, high: float) -> Array:
    """Over the whole range and beyond its ends, slow, stuck and fast, and none."""
    wave = np.sin(0.05 * np.arange(SAMPLES)) + 0.02 * rng.standard_normal(SAMPLES)
    p = 0.5 * (low + high) + 0.6 * (high - low) * wave
    p[40:60] = p[40]
    p[100:130] = np.nan
    p[160] = high + 10 * (high - low)
    p[200:] = rng.uniform(low, high, SAMPLES - 200)
    return p
