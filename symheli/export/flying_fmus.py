"""The helicopter and a controller in a table as FMUs."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from symheli.export import c
from symheli.export import controller as controllers
from symheli.export.c_text import literals, table
from symheli.export.fmu import Fmu, Variable
from symheli.flight.table_controller import TableController
from symheli.helicopter import Helicopter
from symheli.physics.attitude import flight_state
from symheli.steady.equilibrium import TrimPoint
from symheli.steady.equilibrium import trim as trimmed
from symheli.values.signal import Signal, signals

HERE = Path(__file__).parent
"""fmu_helicopter.c and fmu_controller.c lie here."""

LONGEST_STEP = 0.005
"""Longest Runge-Kutta step of the helicopter, s: that of `fly`."""


def write_helicopter_fmu(
    heli: Helicopter,
    path: str | os.PathLike[str],
    trim: TrimPoint | None = None,
    name: str = "helicopter",
) -> Path:
    """Write the equations of motion as an FMU of FMI 3.0 for co-simulation.

    Inputs: controls and wind (north east down), held over a step. Outputs: the states of the
    quaternion form, attitude and airspeed. Every step is cut into Runge-Kutta steps of 5 ms at
    most, those of `symheli.fly`; controls are cut to their travel.

    Parameters
    ----------
    heli : Helicopter
        The model.
    path : path
        Of the archive, ending in .fmu.
    trim : TrimPoint, optional
        Start of states and controls; default hover.
    name : str
        A C identifier: of the model and its library.

    Returns
    -------
    Path
        The archive. Without a C compiler it holds the sources only.

    Raises
    ------
    InputError
        For a name that is no C identifier and a path that does not end in .fmu.
    SymheliError
        Where the file cannot be written.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_helicopter_fmu
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> folder = tempfile.TemporaryDirectory()
    >>> write_helicopter_fmu(heli, f"{folder.name}/heli.fmu").name
    'heli.fmu'
    >>> folder.cleanup()
    """
    point = trimmed(heli, 0.0) if trim is None else trim
    x, u = flight_state(point.x.array), point.u.array
    files = c.program(heli, "helicopter").files
    variables = [
        *(Variable(s, "input", v) for s, v in zip(heli.inputs, u.tolist(), strict=True)),
        *(Variable(s, "input") for s in c.EARTH_WIND),
        *(Variable(s, "state", v) for s, v in zip(heli.flight_states, x.tolist(), strict=True)),
        *(Variable(s, "output") for s in signals(("phi", "theta", "psi", "airspeed"))),
    ]
    travel = table("double", "travel", literals(heli.travel, np.float64))
    return Fmu(
        name=name,
        about=f"{heli.vehicle.title}, {heli.governor} governor",
        variables=variables,
        source=HERE / "fmu_helicopter.c",
        parts={
            **{key: files[key] for key in ("helicopter.h", "helicopter.c")},
            "travel.h": f"{travel}\n",
        },
        constants={"LONGEST": LONGEST_STEP},
        step=0.02,
    ).write(path)


def write_controller_fmu(
    controller: TableController, path: str | os.PathLike[str], name: str = "controller"
) -> Path:
    """Write a controller as an FMU of FMI 3.0 for co-simulation: the C code of `write_controller`.

    Inputs: measured_NAME, reference_NAME, trim_NAME and the parameter. Outputs: the commands, the
    parameter in use and `status`, the bits of `StepEvents`. It is sampled at the start time and
    every `dt` after it, with the inputs of the step in which that time lies.

    Parameters
    ----------
    controller : TableController
        What is written.
    path : path
        Of the archive, ending in .fmu.
    name : str
        A C identifier: of the model and its library.

    Returns
    -------
    Path
        The archive. Without a C compiler it holds the sources only.

    Raises
    ------
    InputError
        For a name that is no C identifier and a path that does not end in .fmu.
    SymheliError
        Where the file cannot be written.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_controller_fmu
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> lqr = symheli.flight.gain_scheduled_lqr(heli, 0.0, 8.0, dt=0.02, points=5)
    >>> controller = symheli.TableController.of(lqr.scheduled_controller.model)
    >>> folder = tempfile.TemporaryDirectory()
    >>> write_controller_fmu(controller, f"{folder.name}/lqr.fmu").name
    'lqr.fmu'
    >>> folder.cleanup()
    """
    files = controllers.program(controller, "controller").files
    middle = 0.5 * float(controller.knots[0] + controller.knots[-1])
    parameter = controller.parameter
    variables = [
        *(
            Variable(Signal(f"{group}_{s}", s.unit), "input", steps=True)
            for group, read in (
                ("measured", controller.inputs),
                ("reference", controller.inputs),
                ("trim", controller.outputs),
            )
            for s in read
        ),
        Variable(parameter, "input", middle, steps=True),
        *(Variable(s, "output", steps=True) for s in controller.outputs),
        Variable(Signal(f"{parameter}_used", parameter.unit), "output", steps=True),
        Variable(Signal("status"), "whole", about="bits: see the header of the controller"),
    ]
    return Fmu(
        name=name,
        about=f"Controller in a table over {parameter}, every {controller.dt:g} s",
        variables=variables,
        source=HERE / "fmu_controller.c",
        parts={key: files[key] for key in ("controller.h", "controller.c")},
        constants={"PERIOD": controller.dt},
        step=controller.dt,
    ).write(path)
