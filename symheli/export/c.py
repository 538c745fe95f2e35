"""The equations of motion as C99 without dependencies: source, header with names and units, a check
and a CMake stub.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from symheli.errors import InputError
from symheli.export.c_check import cases
from symheli.helicopter import Helicopter
from symheli.values import Signal
from symheli.values.c_text import define, index_macros
from symheli.values.signal import signals
from symheli.values.template import filled
from symheli.values.whole_files import write_own, write_text

HERE = Path(__file__).parent
"""heli.c, heli.h, heli_check.c and CMakeLists.txt lie here, with marked places for one model."""

EARTH_WIND = signals(("w_n", "w_e", "w_d"), dict.fromkeys(("w_n", "w_e", "w_d"), "m/s"))


def write_c(heli: Helicopter, path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Write the equations of motion as C99 source with a header, a check and a CMake stub.

    The source needs the C library's mathematics only. The header gives the index, the unit and
    where it applies the travel of every state, input and wind component. NAME_check.c is a program
    that carries cases computed here and exits with 0 where the compiled code reproduces them to
    1e-12.

    Parameters
    ----------
    heli : Helicopter
        The model; its governor and air density are those of the code.
    path : path
        Of the source, ending in .c; folders are made as needed. NAME.h, NAME_check.c and
        CMakeLists.txt are written beside it.

    Returns
    -------
    tuple of Path
        The files written. A CMakeLists.txt that this function did not write is left alone.

    Raises
    ------
    InputError
        Where `path` does not end in .c.
    SymheliError
        Where a file cannot be written.

    Examples
    --------
    >>> import symheli, tempfile
    >>> from symheli.export import write_c
    >>> heli = symheli.Helicopter.load("xcell60", governor="ideal")
    >>> folder = tempfile.TemporaryDirectory()
    >>> [file.name for file in write_c(heli, f"{folder.name}/heli.c")]
    ['heli.c', 'heli.h', 'heli_check.c', 'CMakeLists.txt']
    >>> folder.cleanup()
    """
    path = Path(path)
    if path.suffix != ".c":
        raise InputError(f"{path}: expected a name that ends in .c")
    stem, include = path.stem, {'"heli.h"': f'"{path.stem}.h"'}
    guard = re.sub(r"\W", "_", f"{stem}_h").upper()
    project = re.sub(r"[^A-Za-z0-9_]", "_", stem)
    written = (
        write_text(path, filled(HERE / "heli.c", _source(heli), include)),
        write_text(
            path.with_suffix(".h"), filled(HERE / "heli.h", _declarations(heli), {"HELI_H": guard})
        ),
        write_text(
            path.with_name(f"{stem}_check.c"),
            filled(HERE / "heli_check.c", {"cases": cases(heli)}, include),
        ),
        write_own(
            path.with_name("CMakeLists.txt"),
            filled(HERE / "CMakeLists.txt", {"project": project, "stem": stem}),
        ),
    )
    return tuple(file for file in written if file is not None)


def _source(heli: Helicopter) -> dict[str, str]:
    """`heli.rhs` and `heli.flight_rhs` as CasADi writes them, doubles throughout."""
    import casadi

    generator = casadi.CodeGenerator("rhs.c", {"with_header": False, "verbose": False})
    generator.add(heli.rhs)
    generator.add(heli.flight_rhs)
    return {"title": _title(heli), "generated": generator.dump()}


def _declarations(heli: Helicopter) -> dict[str, str]:
    """Index and unit of every state, input and wind component."""
    return {
        "title": _title(heli),
        "source": heli.vehicle.source,
        "density": f"{heli.density:g}",
        "governor": heli.governor,
        "states": _indices("X", heli.states),
        "flight": _indices("FLIGHT", heli.flight_states),
        "inputs": _indices("U", heli.inputs, heli.travel.tolist()),
        "wind": _indices("WIND", heli.wind),
        "earth": _indices("EARTH", EARTH_WIND),
    }


def _title(heli: Helicopter) -> str:
    return f"{heli.vehicle.title}, {heli.governor} governor"


def _indices(prefix: str, names: Sequence[Signal], travel: Sequence[float] | None = None) -> str:
    notes = [f"+-{size:g}" for size in travel or ()]
    lines = index_macros(f"RHS_{prefix}_", names, notes)
    return "\n".join([*lines, define(f"RHS_N_{prefix}", len(names))])
