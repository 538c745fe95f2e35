"""The recursive estimator of one structure as C99 for an autopilot: sizes fixed, names and units in
the header, a check, a CMake stub.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from identification.export.checked import TOLERANCE, samples
from identification.recursive import kernel
from identification.recursive.forgetting import numbers
from identification.recursive.kernel.configuration import KINDS
from identification.recursive.recursive_least_squares import RecursiveLeastSquares
from symheli.errors import InputError
from symheli.export.c_program import CProgram
from symheli.export.c_text import (
    blocks,
    check_data,
    define,
    identifier,
    index_macros,
    literals,
    table,
)
from symheli.values import Signal

HERE = Path(__file__).parent
"""estimator.c, estimator.h, estimator_check.c and CMakeLists.txt lie here, with marked places."""

KERNEL = Path(kernel.__file__).parent
"""rls.c and rls.h lie there, and are written out as they are."""

_GUARD = "#define RLS_H\n"
_SINGLE = "#ifndef RLS_SINGLE\n#define RLS_SINGLE /* chosen at export */\n#endif\n"
_FORGETTING = ("RLS_CONSTANT", "RLS_VARIABLE", "RLS_DIRECTIONAL")


def write_estimator(
    rls: RecursiveLeastSquares,
    units: Mapping[str, str],
    folder: str | os.PathLike[str],
    name: str = "estimator",
) -> tuple[Path, ...]:
    """Write a recursive estimator as C99 for an autopilot: no allocation, no library.

    NAME_check.c is a program that carries a record and exits with 0 where the compiled estimator
    reproduces the innovations and coefficients that come out here.

    Parameters
    ----------
    rls : RecursiveLeastSquares
        Structure, forgetting and precision of the estimator.
    units : mapping of str to str
        The unit of every output, input and scheduling signal, for the header.
    folder : path
        Where the files go; made as needed.
    name : str
        A C identifier: of the files and functions, in capitals of the macros.

    Returns
    -------
    tuple of Path
        rls.h, rls.c, NAME.h, NAME.c, NAME_check.c and CMakeLists.txt. A CMakeLists.txt that this
        function did not write is left alone.

    Raises
    ------
    InputError
        For a name that is no C identifier, a signal without unit, and functions of p that are not
        piecewise polynomial.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import identification as idn, tempfile
    >>> from identification.export import write_estimator
    >>> arx = idn.LPVARX(
    ...     "q", "d_lon", "airspeed", na=2, nb=2, delay=1, basis=idn.Polynomial(2, 0.0, 13.0))
    >>> folder = tempfile.TemporaryDirectory()
    >>> units = {"q": "rad/s", "d_lon": "rad", "airspeed": "m/s"}
    >>> files = write_estimator(idn.RecursiveLeastSquares(arx), units, folder.name)
    >>> [file.name for file in files][2:5]
    ['estimator.h', 'estimator.c', 'estimator_check.c']
    >>> folder.cleanup()
    """
    return program(rls, units, name).write(folder)


def program(rls: RecursiveLeastSquares, units: Mapping[str, str], name: str) -> CProgram:
    """Return the files of `write_estimator`."""
    if rls.structure is not rls.regression:
        raise InputError("a KinematicARX is written by write_kinematic_estimator, with its dt")
    arx = rls.regression
    if missing := [s for s in (*arx.outputs, *arx.inputs, *arx.parameters) if s not in units]:
        raise InputError(f"units: none given for {', '.join(missing)}")
    if not rls.configuration.factors:
        raise InputError(
            "user-supplied functions cannot be written in C; identify with a polynomial or spline"
            " basis"
        )
    up = f"{name.upper()}_"
    return CProgram(
        template=HERE / "estimator",
        name=name,
        word="estimator",
        header=_header(rls, units, up),
        source={"configuration": _configuration(rls, up)},
        check={"cases": _cases(rls, up)},
        before={
            "rls.h": _rls_header(rls.precision),
            "rls.c": (KERNEL / "rls.c").read_text(encoding="utf-8"),
        },
        cmake=(HERE / "CMakeLists.txt", {"name": name}),
    )


def _rls_header(precision: str) -> str:
    text = (KERNEL / "rls.h").read_text(encoding="utf-8")
    return text.replace(_GUARD, _GUARD + _SINGLE) if precision == "single" else text


def _header(rls: RecursiveLeastSquares, units: Mapping[str, str], up: str) -> dict[str, object]:
    """Sizes, the index of every signal and regressor, and what is estimated in words."""
    arx, c = rls.regression, rls.configuration
    ranges = [f"{low:g} to {high:g}" for low, high in arx.basis.ranges]
    outputs, inputs, parameters = (
        [Signal(s, units[s]) for s in group] for group in (arx.outputs, arx.inputs, arx.parameters)
    )
    state, work = c.sizes
    sections = [
        [
            define(f"{up}NY", arx.ny),
            define(f"{up}NU", arx.nu),
            define(f"{up}NP", len(arx.parameters)),
            define(f"{up}N", arx.n_regressors, "regressors"),
            define(f"{up}MEMORY", arx.memory, "samples a regressor reaches back"),
            define(f"{up}STATE", state, "numbers to save and restore"),
            define(f"{up}WORK", work, "numbers of scratch"),
        ],
        index_macros(f"{up}Y_", outputs),
        index_macros(f"{up}U_", inputs),
        index_macros(f"{up}P_", parameters, ranges),
        [define(f"{up}R_{identifier(r)}", i, r) for i, r in enumerate(arx.regressor_names)],
    ]
    groups = [
        f"   {', '.join(arx.outputs[j] for j in layout.group.outputs)}: {layout.n} regressors,"
        f" factor of order {layout.n + layout.m}"
        for layout in c.groups
    ]
    return {
        "precision": rls.precision.capitalize(),
        "bytes": (state + work) * np.dtype(c.dtype).itemsize,
        "at": "its own lag" if arx.scheduling_at == "lag" else "the present",
        "basis": arx.basis,
        "forgetting": c.forgetting,
        "groups": "\n".join(groups),
        "sizes": blocks(*sections),
    }


def _configuration(rls: RecursiveLeastSquares, up: str) -> str:
    """Arrays that `rls_config` points to, as constants."""
    c = rls.configuration
    entries = [
        f"{{RLS_{KINDS[k].upper()}, {channel}, {lag}, {p_lag}}}"
        for k, channel, lag, p_lag in c.entries.tolist()
    ]
    lines, groups, factors = [table("rls_entry", "entries", entries)], [], []
    for g, layout in enumerate(c.groups):
        lines.append(table("int", f"outputs_{g}", layout.group.outputs))
        lines.append(table("int", f"entries_{g}", layout.group.entries))
        groups.append(f"{{{layout.m}, {len(layout.group.entries)}, outputs_{g}, entries_{g}}}")
    lines.append(table("rls_group", "groups", groups))
    for i, factor in enumerate(c.factors):
        functions, degree, pieces, slack, knots, bernstein = factor.arguments
        lines.append(table("rls_real", f"knots_{i}", literals(knots, c.dtype)))
        lines.append(table("rls_real", f"bernstein_{i}", literals(bernstein.reshape(-1), c.dtype)))
        size = f"{functions}, {degree}, {pieces}, {literals([slack], c.dtype)[0]}"
        factors.append(f"{{{size}, knots_{i}, bernstein_{i}}}")
    lines.append(table("rls_factor", "factors", factors))
    lines.append(table("int", "products", c.index.reshape(-1).tolist()))
    lines.append(table("rls_real", "largest", literals(c.largest, c.dtype)))
    kind, *values = numbers(c.forgetting)
    counts = f"{rls.regression.memory}, {len(c.entries)}, {len(c.groups)}"
    basis = f"{rls.regression.basis.size}, {len(factors)}, factors, products, largest"
    return "\n".join(
        [
            *lines,
            "static const rls_config config = {",
            f"    {up}NY, {up}NU, {up}NP, {counts}, entries, groups,",
            f"    {{{basis}}},",
            f"    {{{_FORGETTING[kind]}, {', '.join(literals(values, c.dtype))}}},",
            "};",
        ]
    )


def _cases(rls: RecursiveLeastSquares, up: str) -> str:
    """A record of a fixed seed, one sample missing, with the innovations and coefficients that come
    out here.
    """
    c, arx = rls.configuration, rls.regression
    given = samples(arx.ny + arx.nu, arx.basis.ranges, arx.memory + 3 * arx.basis.size + 20)
    learnt, *history = rls.online().run(given)
    innovations, coefficients = map(np.asarray, history)
    return check_data(
        {
            "SAMPLES": len(given),
            "LEARNT": int(learnt.sum()),
            "TOLERANCE": TOLERANCE[rls.precision],
        },
        "rls_real",
        c.dtype,
        samples=(f"{up}NY + {up}NU + {up}NP", given),
        innovations=(f"{up}NY", innovations[learnt]),
        coefficients=(f"{up}NY", coefficients[-1]),
    )
