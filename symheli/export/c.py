"""The equations of motion as C99 without dependencies: source, header with names and units, a check
and a CMake stub.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from symheli.errors import InputError
from symheli.export.c_program import CProgram
from symheli.export.c_text import define, index_macros, rows
from symheli.helicopter import Helicopter
from symheli.values import Signal
from symheli.values.signal import signals

HERE = Path(__file__).parent
"""heli.c, heli.h, heli_check.c and CMakeLists.txt lie here, with marked places for one model."""

EARTH_WIND = signals(("w_n", "w_e", "w_d"), dict.fromkeys(("w_n", "w_e", "w_d"), "m/s"))


CASES = 12
"""Number of cases of each function in the check program."""

STEP = 0.005
"""Length of the Runge-Kutta step of the check program, s."""

_SIZE = {
    "u": 6.0,
    "v": 1.5,
    "w": 1.0,
    "p": 0.5,
    "q": 0.5,
    "r": 0.5,
    "phi": 0.3,
    "theta": 0.3,
    "a1": 0.03,
    "b1": 0.03,
    "om_i": 20.0,
}
"""Spread of each state (SI) over the cases; what is not named here (quaternion, position) has 1."""


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
    header, source, *others = program(heli, path.stem).write(path.parent)
    return (source, header, *others)


def program(heli: Helicopter, stem: str) -> CProgram:
    """Return the files of `write_c`, the source called STEM.c."""
    guard = re.sub(r"\W", "_", f"{stem}_h").upper()
    project = re.sub(r"[^A-Za-z0-9_]", "_", stem)
    return CProgram(
        template=HERE / "heli",
        name=stem,
        header={"guard": guard, **_declarations(heli)},
        source={"stem": stem, **_source(heli)},
        check={"stem": stem, "cases": _cases(heli)},
        cmake=(HERE / "CMakeLists.txt", {"project": project, "stem": stem}),
    )


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


def _cases(heli: Helicopter) -> str:
    """Cases of `heli_rhs`, `heli_flight_rhs` and `heli_flight_step` as C tables, drawn from a fixed
    seed: flight, wind, saturations.
    """
    rng = np.random.default_rng(0)
    found = {"rhs_cases": [], "flight_cases": [], "step_cases": []}
    middle = np.array([0, 0, 1, 1])
    for _ in range(CASES):
        inputs = 0.5 * heli.travel * (rng.uniform(-1, 1, len(heli.inputs)) + middle)
        wind = 2.0 * rng.standard_normal(3)
        x, flight = _state(heli, heli.states, rng), _state(heli, heli.flight_states, rng)
        flight[6:10] /= np.linalg.norm(flight[6:10])
        rhs, flight_rhs = heli.numeric("rhs"), heli.numeric("flight_rhs")
        found["rhs_cases"].append((x, inputs, wind, rhs(x, inputs, wind)[0]))
        found["flight_cases"].append((flight, inputs, wind, flight_rhs(flight, inputs, wind)[0]))
        found["step_cases"].append((flight, inputs, wind, _step(heli, flight, inputs, wind)))
    tables = (
        rows("double", name, str(sum(map(len, given[0]))), np.array([*map(np.concatenate, given)]))
        for name, given in found.items()
    )
    return "\n".join([define("CASES", CASES), define("STEP", STEP, "s"), *tables])


def _state(heli: Helicopter, names: tuple, rng: np.random.Generator) -> np.ndarray:
    x = np.array([_SIZE.get(s, 1.0) for s in names]) * rng.standard_normal(len(names))
    x[0] = abs(x[0])
    for i, s in enumerate(names):
        if s == "Om":
            x[i] = heli.nominal_speed * (1 + 0.02 * rng.standard_normal())
    return x


def _step(heli: Helicopter, x: np.ndarray, u: np.ndarray, wind: np.ndarray) -> np.ndarray:
    """One classical Runge-Kutta step of `STEP` seconds, quaternion brought back to length 1."""

    def f(z: np.ndarray) -> np.ndarray:
        return heli.numeric("flight_rhs")(z, u, wind)[0]

    k1 = f(x)
    k2 = f(x + STEP / 2 * k1)
    k3 = f(x + STEP / 2 * k2)
    k4 = f(x + STEP * k3)
    end = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    end[6:10] /= np.linalg.norm(end[6:10])
    return end
