"""An identified model as C99 for an autopilot or a simulator: one step ahead or in free run, with a
check of what Python computed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np

from identification.export.checked import model_cases, number_type
from identification.model.lpvarx_model import LPVARXModel
from identification.recursive.forgetting import Constant
from identification.recursive.kernel.configuration import KINDS, KernelConfiguration
from symheli.errors import InputError
from symheli.export.c_program import CProgram
from symheli.export.c_text import blocks, define, index_macros, literals, rows, table

HERE = Path(__file__).parent
"""model.c, model.h and model_check.c lie here, with marked places for one model."""


def write_model(
    model: LPVARXModel,
    folder: str | os.PathLike[str],
    name: str = "model",
    precision: Literal["double", "single"] = "double",
) -> tuple[Path, ...]:
    """Write an identified model as C99 that predicts and simulates: no allocation, no library.

    NAME_check.c is a program that carries a record and exits with 0 where the compiled model gives
    the predictions and the free run computed here.

    Parameters
    ----------
    model : LPVARXModel
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
        NAME.h, NAME.c and NAME_check.c.

    Raises
    ------
    InputError
        For a name that is no C identifier, another precision, and functions of p that are not
        piecewise polynomial.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli, tempfile
    >>> from identification.export import write_model
    >>> rng = np.random.default_rng(0)
    >>> columns = {"y": rng.standard_normal(200), "u": rng.standard_normal(200),
    ...            "p": rng.uniform(size=200)}
    >>> units = dict.fromkeys(columns, "1")
    >>> record = symheli.FlightRecord.from_arrays(0.1 * np.arange(200), units, **columns)
    >>> arx = idn.LPVARX(
    ...     "y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, 0.0, 1.0))
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_model(idn.fit(arx, record), folder.name, "roll")]
    ['roll.h', 'roll.c', 'roll_check.c']
    >>> folder.cleanup()
    """
    c = KernelConfiguration(model.structure, Constant(1.0), number_type(precision))
    if not c.factors:
        raise InputError(
            "user-supplied functions cannot be written in C; identify with a polynomial or spline"
            " basis"
        )
    return CProgram(
        template=HERE / "model",
        name=name,
        word="model",
        header=_header(model, c, name),
        source={"tables": _tables(model, c, f"{name.upper()}_")},
        check={"present": "u, p", "past": "", "cases": model_cases(model, name, precision)},
    ).write(folder)


def _header(model: LPVARXModel, c: KernelConfiguration, name: str) -> dict[str, object]:
    """Sizes, the index of every signal with its unit, and what the model is in words."""
    arx, up = model.structure, f"{name.upper()}_"
    ranges = [f"{low:g} to {high:g}" for low, high in arx.basis.ranges]
    sections = [
        [f"typedef {'float' if c.dtype is np.float32 else 'double'} {name}_real;"],
        [
            define(f"{up}NY", arx.ny),
            define(f"{up}NU", arx.nu),
            define(f"{up}NP", len(arx.parameters)),
            define(f"{up}NF", arx.basis.size, "functions of p"),
            define(f"{up}ENTRIES", len(c.entries), "signals in phi"),
            define(f"{up}MEMORY", arx.memory, "samples the model reaches back"),
        ],
        index_macros(f"{up}Y_", model.outputs),
        index_macros(f"{up}U_", model.inputs),
        index_macros(f"{up}P_", model.parameters, ranges),
    ]
    return {
        "dt": f"{model.dt:.9g}",
        "method": model.method,
        "at": "of their lag" if arx.scheduling_at == "lag" else "now",
        "basis": arx.basis,
        "sizes": blocks(*sections),
    }


def _tables(model: LPVARXModel, c: KernelConfiguration, up: str) -> str:
    """The coefficients and the functions of p."""
    factors = [f.arguments for f in c.factors]
    starts = np.cumsum([[0, 0], *([f[4].size, f[5].size] for f in factors[:-1])], axis=0)
    sizes = {
        "ENTRIES": len(c.entries),
        "FACTORS": len(factors),
        "ORDER": max(f[1] for f in factors) + 1,
        "MOST": max(f[0] for f in factors),
    }
    each = [
        _braced((functions, degree, pieces, *start))
        for (functions, degree, pieces, *_), start in zip(factors, starts.tolist(), strict=True)
    ]
    knots = np.concatenate([f[4] for f in factors])
    bernstein = np.concatenate([f[5].reshape(-1) for f in factors])
    return "\n".join(
        [
            f"enum {{ {', '.join(k.upper() for k in KINDS)} }};",
            f"enum {{ {', '.join(f'{key} = {n}' for key, n in sizes.items())} }};",
            "typedef struct { int kind, channel, lag, p_lag; } entry;",
            "typedef struct { int functions, degree, pieces, knot, bernstein; } factor;",
            table("entry", "entries", map(_braced, c.entries.tolist())),
            rows("real", "theta", f"{up}NY", model.theta, c.dtype),
            table("factor", "factors", each),
            table("real", "slack", literals([f[3] for f in factors], c.dtype)),
            table("real", "knots", literals(knots, c.dtype)),
            table("real", "bernstein", literals(bernstein, c.dtype)),
            table("int", "products", c.index.reshape(-1).tolist()),
        ]
    )


def _braced(values: Iterable[int]) -> str:
    return f"{{{', '.join(map(str, values))}}}"
