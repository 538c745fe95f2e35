"""A recursive estimator as an FMU of FMI 3.0 for co-simulation."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from identification.export.estimator import program
from identification.recursive.recursive_least_squares import RecursiveLeastSquares
from symheli.export.fmu import Fmu, Variable
from symheli.values import Signal
from symheli.values.numbers import positive
from symheli.values.signal import signals

HERE = Path(__file__).parent
"""fmu_identifier.c lies here."""


def write_identifier_fmu(
    rls: RecursiveLeastSquares,
    units: Mapping[str, str],
    dt: float,
    path: str | os.PathLike[str],
    name: str = "identifier",
) -> Path:
    """Write a recursive estimator as an FMU of FMI 3.0 for co-simulation: the C code of
    `write_estimator`.

    Inputs: outputs, inputs and scheduling signals of the model. Outputs: innovation_NAME, the
    coefficients theta_I_NAME of regressor I and `status`, the bits of rls.h. It learns at the start
    time and every `dt` after it, from the inputs of the step in which that time lies.

    Parameters
    ----------
    rls : RecursiveLeastSquares
        Structure, forgetting and precision of the estimator.
    units : mapping of str to str
        The unit of every output, input and scheduling signal.
    dt : float
        Sample period, s.
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
        As `write_estimator`, for a period that is not positive and a path that does not end in
        .fmu.
    SymheliError
        Where the file cannot be written.

    Examples
    --------
    >>> import identification as idn, tempfile
    >>> from identification.export import write_identifier_fmu
    >>> arx = idn.LPVARX(
    ...     "q", "d_lon", "airspeed", na=2, nb=2, delay=1, basis=idn.Polynomial(2, 0.0, 13.0))
    >>> folder = tempfile.TemporaryDirectory()
    >>> units = {"q": "rad/s", "d_lon": "rad", "airspeed": "m/s"}
    >>> rls = idn.RecursiveLeastSquares(arx)
    >>> write_identifier_fmu(rls, units, 0.02, f"{folder.name}/q.fmu").name
    'q.fmu'
    >>> folder.cleanup()
    """
    positive(dt, "dt")
    arx, files = rls.regression, program(rls, units, "estimator").files
    middles = [0.5 * (low + high) for low, high in arx.basis.ranges]
    outputs, inputs, scheduling = (
        signals(group, units) for group in (arx.outputs, arx.inputs, arx.parameters)
    )
    variables = [
        *(Variable(s, "input", steps=True) for s in (*outputs, *inputs)),
        *(
            Variable(s, "input", middle, steps=True)
            for s, middle in zip(scheduling, middles, strict=True)
        ),
        *(Variable(Signal(f"innovation_{y}", y.unit), "output", steps=True) for y in outputs),
        *(
            Variable(Signal(f"theta_{i}_{y}"), "output", about=f"{y} by {r}", steps=True)
            for i, r in enumerate(arx.regressor_names)
            for y in outputs
        ),
        Variable(Signal("status"), "whole", about="bits: see rls.h"),
    ]
    return Fmu(
        name=name,
        about=f"Recursive identification of {', '.join(arx.outputs)}, every {dt:g} s",
        variables=variables,
        source=HERE / "fmu_identifier.c",
        parts={key: files[key] for key in ("rls.h", "rls.c", "estimator.h", "estimator.c")},
        constants={"PERIOD": dt},
        step=dt,
    ).write(path)
