"""The equations of motion as C99 without dependencies: source, header with names and units, a check
and a CMake stub.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from studies.export_c_check import check_program
from studies.files import write_text
from symheli import Helicopter, Signal
from symheli.errors import InputError
from symheli.values.signal import signals

EARTH_WIND = signals(("w_n", "w_e", "w_d"), dict.fromkeys(("w_n", "w_e", "w_d"), "m/s"))
_CMAKE_MARK = "# Written by symheli export c; rewritten by it while this line stays."


def write_c(heli: Helicopter, path: Path) -> tuple[Path, ...]:
    """Write `heli` to `path` (ending in .c), its header, NAME_check.c and CMakeLists.txt beside it;
    returns what was written.

    A CMakeLists.txt of somebody else is left alone.
    """
    if path.suffix != ".c":
        raise InputError(f"{path}: expected a name that ends in .c")
    header, check, cmake = (
        path.with_suffix(".h"),
        path.with_name(f"{path.stem}_check.c"),
        path.with_name("CMakeLists.txt"),
    )
    written = [
        write_text(path, source(heli, header.name)),
        write_text(header, declarations(heli, path.stem)),
        write_text(check, check_program(heli, header.name)),
    ]
    if not cmake.exists() or cmake.read_text(encoding="utf-8").startswith(_CMAKE_MARK):
        written.append(write_text(cmake, cmake_stub(path.stem)))
    return tuple(written)


def source(heli: Helicopter, header: str) -> str:
    """C code of `heli.rhs` and `heli.flight_rhs`, doubles throughout, and one Runge-Kutta step."""
    import casadi

    generator = casadi.CodeGenerator("rhs.c", {"with_header": False, "verbose": False})
    generator.add(heli.rhs)
    generator.add(heli.flight_rhs)
    return _SOURCE.format(
        title=_title(heli), header=header, generated=generator.dump(), n=len(heli.flight_states)
    )


_SOURCE = """/* {title}: equations of motion; see {header} for the meaning of every entry. */
#include "{header}"
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the generated functions take work arrays that they do not need */
#endif

{generated}
void heli_rhs(const double *x, const double *u, const double *wind, double *xdot)
{{
    const double *arg[3];
    double *res[1];
    arg[0] = x; arg[1] = u; arg[2] = wind; res[0] = xdot;
    rhs(arg, res, 0, 0, 0);
}}

void heli_flight_rhs(const double *x, const double *u, const double *wind, double *xdot)
{{
    const double *arg[3];
    double *res[1];
    arg[0] = x; arg[1] = u; arg[2] = wind; res[0] = xdot;
    flight_rhs(arg, res, 0, 0, 0);
}}

void heli_flight_step(double *x, const double *u, const double *wind, double h)
{{
    double k1[{n}], k2[{n}], k3[{n}], k4[{n}], z[{n}], norm;
    int i;
    heli_flight_rhs(x, u, wind, k1);
    for (i = 0; i < {n}; i++) z[i] = x[i] + h / 2 * k1[i];
    heli_flight_rhs(z, u, wind, k2);
    for (i = 0; i < {n}; i++) z[i] = x[i] + h / 2 * k2[i];
    heli_flight_rhs(z, u, wind, k3);
    for (i = 0; i < {n}; i++) z[i] = x[i] + h * k3[i];
    heli_flight_rhs(z, u, wind, k4);
    for (i = 0; i < {n}; i++) x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    norm = sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9]);
    for (i = 6; i < 10; i++) x[i] /= norm;
}}
"""


def declarations(heli: Helicopter, stem: str) -> str:
    """The header: index and unit of every state, input, wind component, and the functions."""
    return _HEADER.format(
        title=_title(heli),
        source=heli.vehicle.source,
        density=heli.density,
        governor=heli.governor,
        guard=re.sub(r"\W", "_", f"{stem}_h").upper(),
        states=_indices("X", heli.states),
        flight=_indices("FLIGHT", heli.flight_states),
        inputs=_indices("U", heli.inputs, heli.travel.tolist()),
        wind=_indices("WIND", heli.wind),
        earth=_indices("EARTH", EARTH_WIND),
    )


_HEADER = """/* {title}
   source: {source}

   Continuous time, SI units and radians, body axes x forward, y right, z down.
   Air density {density:g} kg/m^3, governor "{governor}". d_ped is the total tail blade pitch.
*/
#ifndef {guard}
#define {guard}

/* states x of heli_rhs, and their derivatives xdot (unit per second) */
{states}

/* states x of heli_flight_rhs: scalar-first quaternion, position north east down */
{flight}

/* inputs u; travel of each: symmetric */
{inputs}

/* wind of heli_rhs, body axes */
{wind}

/* wind of heli_flight_rhs, north east down */
{earth}

#ifdef __cplusplus
extern "C" {{
#endif
/* xdot[RHS_N_X] from x[RHS_N_X], u[RHS_N_U], wind[RHS_N_WIND]: the Euler form */
void heli_rhs(const double *x, const double *u, const double *wind, double *xdot);
/* xdot[RHS_N_FLIGHT] from x[RHS_N_FLIGHT], u[RHS_N_U], wind[RHS_N_EARTH]: the quaternion form */
void heli_flight_rhs(const double *x, const double *u, const double *wind, double *xdot);
/* x[RHS_N_FLIGHT] after h seconds (5 ms or less) with u and wind held: one classical Runge-Kutta step, quaternion of length 1 */
void heli_flight_step(double *x, const double *u, const double *wind, double h);
#ifdef __cplusplus
}}
#endif
#endif
"""


def cmake_stub(stem: str) -> str:
    """A library target and the check as its test."""
    return f"""{_CMAKE_MARK}
cmake_minimum_required(VERSION 3.10)
project({re.sub(r"[^A-Za-z0-9_]", "_", stem)} C)
set(CMAKE_C_STANDARD 99)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)

add_library(helicopter "{stem}.c")
target_include_directories(helicopter PUBLIC "${{CMAKE_CURRENT_SOURCE_DIR}}")
if(UNIX)
  target_link_libraries(helicopter PUBLIC m)
endif()

enable_testing()
add_executable(helicopter_check "{stem}_check.c")
target_link_libraries(helicopter_check PRIVATE helicopter)
add_test(NAME helicopter_check COMMAND helicopter_check)
"""


def _title(heli: Helicopter) -> str:
    return f"{heli.vehicle.title}, {heli.governor} governor"


def _indices(prefix: str, names: Sequence[Signal], travel: Sequence[float] | None = None) -> str:
    lines = [
        f"#define RHS_{prefix}_{s} {i} /* {s.unit}{f', +-{travel[i]:g}' if travel else ''} */"
        for i, s in enumerate(names)
    ]
    return "\n".join([*lines, f"#define RHS_N_{prefix} {len(names)}"])
