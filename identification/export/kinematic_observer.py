"""The observer of a rigid vehicle with known kinematics as C99 for an autopilot, with a check of
what Python computed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

import numpy as np

from identification.export.checked import ORDINARY, TOLERANCE, number_type, samples
from identification.export.model import write_model
from identification.export.rigid_body import rigid_body_files
from identification.model.kinematic_observer import KinematicObserver
from symheli.export.c_program import CProgram
from symheli.export.c_text import (
    blocks,
    check_data,
    define,
    index_macros,
    literals,
    table,
)
from symheli.values.arrays import Array
from symheli.values.kinematics import GRAVITY

HERE = Path(__file__).parent
"""kinematic_observer.c, .h and _check.c lie here, with marked places for one observer."""

MISSING = 37
"""Every so many samples of the check a measurement is missing."""


def write_kinematic_observer(
    observer: KinematicObserver,
    folder: str | os.PathLike[str],
    name: str = "observer",
    precision: Literal["double", "single"] = "double",
) -> tuple[Path, ...]:
    """Write the observer of an identified rigid vehicle as C99: no allocation, of a library only
    sin, cos and tan.

    NAME_check.c is a program that carries a record and exits with 0 where the compiled observer
    gives the estimates computed here. Measurements are taken in one by one, which is the same but
    for rounding.

    Parameters
    ----------
    observer : KinematicObserver
        Of `KinematicModel.observer`; how far it has come does not matter.
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
        As `write_kinematic_model`.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import identification as idn, symheli, tempfile
    >>> from identification.export import write_kinematic_observer
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> plan = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    >>> excitation = symheli.Excitation(dict.fromkeys(heli.inputs, 0.01))
    >>> kin = idn.KinematicARX(
    ...     heli.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    >>> model = idn.fit(kin, symheli.fly(heli, plan, excitation=excitation))
    >>> observer = model.observer(dict.fromkeys(kin.outputs, 0.01), process=0.01)
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_kinematic_observer(observer, folder.name)][:3]
    ['observer.h', 'observer.c', 'observer_check.c']
    >>> folder.cleanup()
    """
    model = observer.model
    program = CProgram(
        template=HERE / "kinematic_observer",
        name=name,
        word="observer",
        header={"dt": f"{model.dt:.9g}", "sizes": _sizes(observer, f"{name.upper()}_")},
        source={"constants": _constants(observer, precision)},
        check={"cases": _cases(observer, f"{name.upper()}_", precision)},
        after=rigid_body_files(name, model.dt, precision),
    )
    inner = write_model(model.aerodynamics, folder, f"{name}_aero", precision)
    return (*program.write(folder), *inner)


def _sizes(observer: KinematicObserver, up: str) -> str:
    model = observer.model
    ranges = [f"{low:g} to {high:g}" for low, high in model.structure.basis.ranges]
    return blocks(
        [
            define(f"{up}NY", len(model.outputs)),
            define(f"{up}NU", len(model.inputs)),
            define(f"{up}NP", len(model.parameters)),
            define(f"{up}NX", len(model.realization.states), "y, and what is remembered"),
            define(f"{up}MEMORY", model.structure.memory, "samples that a start takes"),
        ],
        index_macros(f"{up}Y_", model.outputs),
        index_macros(f"{up}U_", model.inputs),
        index_macros(f"{up}P_", model.parameters, ranges),
    )


def _constants(observer: KinematicObserver, precision: Literal["double", "single"]) -> str:
    """Variances, and what the model remembers, as places in (x, u)."""
    dtype, model = number_type(precision), observer.model
    lagged, below = observer.selections
    kept = [f"{{{column}, {back}}}" for column, back in model.realization.memory]
    moving = len(model.parameters) if model.structure.offset_rate else 0
    numbers = {"GRAVITY": GRAVITY, "HALF_PERIOD": 0.5 * model.dt}
    sizes = {"LAGGED": len(lagged), "REMEMBERED": len(below), "MOVING": moving}
    return "\n".join(
        [
            f"enum {{ {', '.join(f'{key} = {n}' for key, n in sizes.items())} }};",
            *(
                f"static const real {key} = {literals([value], dtype)[0]};"
                for key, value in numbers.items()
            ),
            table("real", "sensor", literals(observer.variances[0], dtype)),
            table("real", "process", literals(observer.variances[1], dtype)),
            table("int", "lagged", lagged),
            # one more, for a model that remembers nothing
            table("int", "remembered", [*below, -1]),
            f"static const int kept[][2] = {{{', '.join([*kept, '{0, 0}'])}}};",
        ]
    )


def _cases(observer: KinematicObserver, up: str, precision: Literal["double", "single"]) -> str:
    """A record of a fixed seed, some measurements missing and one control, with what Python
    estimates.
    """
    model = observer.model
    ny, nu = len(model.outputs), len(model.inputs)
    count = 4 * MISSING + model.structure.memory
    given = samples(ny + nu, model.structure.basis.ranges, count, ORDINARY)
    given[count // 2, 0] = 0.0
    given[MISSING::MISSING, ny - 1] = np.nan
    given[2 * MISSING + 3, :ny] = np.nan
    given[3 * MISSING, ny] = np.nan
    given = given.astype(number_type(precision)).astype(float)
    expected, estimated = _estimates(observer, given)
    return check_data(
        {"SAMPLES": count, "ESTIMATED": estimated, "TOLERANCE": TOLERANCE[precision]},
        f"{up.lower()}real",
        number_type(precision),
        samples=(str(given.shape[1]), given),
        expected=(f"{up}NY", expected),
    )


def _estimates(observer: KinematicObserver, given: Array) -> tuple[Array, int]:
    """Return the answers of an observer of its own along the rows, and how often it estimates."""
    model = observer.model
    ny, nu = len(model.outputs), len(model.inputs)
    own = observer.anew()
    out, estimated = np.empty((len(given), ny)), 0
    for k, row in enumerate(given):
        y, u, p = np.split(row, [ny, ny + nu])
        running = own.running and bool(np.isfinite(u).all())
        out[k] = own.step(y, u, p)
        estimated += running
    return out, estimated
