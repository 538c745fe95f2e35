"""The recursive estimator of a rigid vehicle as C99 for an autopilot: increments beyond the known
kinematics, handed to the exported regression.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.export.checked import ORDINARY, TOLERANCE, samples
from identification.export.estimator import write_estimator
from identification.export.rigid_body import rigid_body_files
from identification.recursive.recursive_least_squares import RecursiveLeastSquares
from identification.structure.kinematic_arx import INCREMENTS, KinematicARX
from symheli.errors import InputError
from symheli.export.c_program import CProgram
from symheli.export.c_text import blocks, check_data, define, index_macros
from symheli.values.kinematics import RIGID_BODY
from symheli.values.signal import signals

HERE = Path(__file__).parent
"""kinematic_estimator.c, .h and _check.c lie here, with marked places."""


def write_kinematic_estimator(
    rls: RecursiveLeastSquares,
    units: Mapping[str, str],
    dt: float,
    folder: str | os.PathLike[str],
    name: str = "estimator",
) -> tuple[Path, ...]:
    """Write the recursive estimator of a `KinematicARX` as C99: no allocation, of a library only
    sin, cos and tan.

    NAME_check.c is a program that carries a record and exits with 0 where the compiled estimator
    reproduces the innovations and coefficients that come out here.

    Parameters
    ----------
    rls : RecursiveLeastSquares
        Of a `KinematicARX`.
    units : mapping of str to str
        The unit of every input and scheduling signal, for the header; states have theirs.
    dt : float
        Sample period, s.
    folder : path
        Where the files go; made as needed.
    name : str
        A C identifier: of the files and functions, in capitals of the macros.

    Returns
    -------
    tuple of Path
        NAME.h, NAME.c, NAME_check.c; NAME_body.h, NAME_body.c, the kinematics; and what
        `write_estimator` writes for the regression, NAME_aero.h, ..

    Raises
    ------
    InputError
        For a structure without kinematics, and as `write_estimator`.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import identification as idn, tempfile
    >>> from identification.export import write_kinematic_estimator
    >>> kin = idn.KinematicARX("d_lon", "airspeed", basis=idn.Polynomial(1, 0.0, 13.0))
    >>> folder = tempfile.TemporaryDirectory()
    >>> units = {"d_lon": "rad", "airspeed": "m/s"}
    >>> rls = idn.RecursiveLeastSquares(kin)
    >>> files = write_kinematic_estimator(rls, units, 0.02, folder.name)
    >>> [file.name for file in files][:3]
    ['estimator.h', 'estimator.c', 'estimator_check.c']
    >>> folder.cleanup()
    """
    kin = rls.structure
    if not isinstance(kin, KinematicARX):
        raise InputError("known kinematics need a KinematicARX; write_estimator takes an LPVARX")
    known = {str(s): s.unit for s in (*RIGID_BODY, *INCREMENTS)}
    up = f"{name.upper()}_"
    sizes = blocks(
        [define(f"{up}NY", len(RIGID_BODY)), define(f"{up}NU", len(kin.inputs))],
        index_macros(f"{up}Y_", RIGID_BODY),
        index_macros(f"{up}U_", signals(kin.inputs, units)),
    )
    program = CProgram(
        template=HERE / "kinematic_estimator",
        name=name,
        word="estimator",
        header={"dt": f"{dt:.9g}", "sizes": sizes},
        check={"cases": _cases(rls, kin, dt, up)},
        after=rigid_body_files(name, dt, rls.precision),
    )
    regression = replace(rls, structure=kin.aerodynamics)
    inner = write_estimator(regression, {**units, **known}, folder, f"{name}_aero")
    return (*program.write(folder), *inner)


def _cases(rls: RecursiveLeastSquares, kin: KinematicARX, dt: float, up: str) -> str:
    """A record of a fixed seed with a gap and a missing sample, with what comes out here."""
    wide = len(RIGID_BODY) + len(kin.inputs)
    count = kin.memory + 3 * kin.basis.size + 40
    dtype = rls.configuration.dtype
    given = samples(wide, kin.basis.ranges, count, ORDINARY)
    given = given.astype(dtype).astype(float)
    online, gap = rls.online(dt=dt), count // 3
    parts = []
    for part in (given[:gap], given[gap:]):
        online.forget_past()
        parts.append(online.run(part))
    learnt, innovations, coefficients = (
        np.concatenate([np.asarray(part[i]) for part in parts]) for i in range(3)
    )
    return check_data(
        {
            "SAMPLES": count,
            "GAP": gap,
            "LEARNT": int(learnt.sum()),
            "TOLERANCE": TOLERANCE[rls.precision],
        },
        "rls_real",
        dtype,
        samples=(str(given.shape[1]), given),
        innovations=(f"{up}AERO_NY", innovations[learnt]),
        coefficients=(f"{up}AERO_NY", coefficients[-1]),
    )
