"""An identified rigid vehicle as C99 for an autopilot or a simulator: known kinematics around the
exported aerodynamics, with a check of what Python computed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from identification.export.checked import model_cases
from identification.export.model import write_model
from identification.export.rigid_body import rigid_body_files
from identification.model.kinematic_model import KinematicModel
from symheli.export.c_program import CProgram
from symheli.export.c_text import blocks, define, index_macros

HERE = Path(__file__).parent
"""kinematic_model.c, .h and model_check.c lie here, with marked places for one model."""


def write_kinematic_model(
    model: KinematicModel,
    folder: str | os.PathLike[str],
    name: str = "model",
    precision: Literal["double", "single"] = "double",
) -> tuple[Path, ...]:
    """Write an identified rigid vehicle as C99 that predicts and simulates: no allocation, of a
    library only sin, cos and tan.

    NAME_check.c is a program that carries a record and exits with 0 where the compiled model gives
    the predictions and the free run computed here.

    Parameters
    ----------
    model : KinematicModel
        The identified model.
    folder : path
        Where the files go; made as needed.
    name : str
        A C identifier: of the files and functions, in capitals of the macros.
    precision : {"double", "single"}
        Of every number in the C code.

    Returns
    -------
    tuple of Path
        NAME.h, NAME.c, NAME_check.c; NAME_body.h, NAME_body.c, the kinematics; NAME_aero.h,
        NAME_aero.c and NAME_aero_check.c, the aerodynamics as `write_model` writes them.

    Raises
    ------
    InputError
        For a name that is no C identifier, another precision, and functions of p that are not
        piecewise polynomial.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import identification as idn, symheli, tempfile
    >>> from identification.export import write_kinematic_model
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> plan = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))
    >>> kin = idn.KinematicARX(
    ...     heli.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    >>> model = idn.fit(kin, symheli.fly(heli, plan, excitation=excitation))
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_kinematic_model(model, folder.name, "heli")][:3]
    ['heli.h', 'heli.c', 'heli_check.c']
    >>> folder.cleanup()
    """
    model.structure.require_plain("C code")
    program = CProgram(
        template=HERE / "kinematic_model",
        name=name,
        word="model",
        header=_header(model, f"{name.upper()}_"),
        check={"present": "p", "past": ", u", "cases": model_cases(model, name, precision)},
        check_template=HERE / "model_check.c",
        after=rigid_body_files(name, model.dt, precision),
    )
    inner = write_model(model.aerodynamics, folder, f"{name}_aero", precision)
    return (*program.write(folder), *inner)


def _header(model: KinematicModel, up: str) -> dict[str, object]:
    ranges = [f"{low:g} to {high:g}" for low, high in model.structure.basis.ranges]
    sections = [
        [
            define(f"{up}NY", len(model.outputs)),
            define(f"{up}NU", len(model.inputs)),
            define(f"{up}NP", len(model.parameters)),
            define(f"{up}MEMORY", model.structure.memory, "samples the model reaches back"),
        ],
        index_macros(f"{up}Y_", model.outputs),
        index_macros(f"{up}U_", model.inputs),
        index_macros(f"{up}P_", model.parameters, ranges),
    ]
    return {
        "dt": f"{model.dt:.9g}",
        "method": model.method,
        "sizes": blocks(*sections),
    }
