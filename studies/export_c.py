"""The equations of motion as C code without dependencies, with a header that names every entry."""

from __future__ import annotations

import re
from pathlib import Path

from studies.files import write_text
from symheli import Helicopter, Signal
from symheli.errors import InputError


def write_c(heli: Helicopter, path: Path) -> tuple[Path, ...]:
    """Write (x, u, wind) -> xdot of `heli` to `path` (ending in .c) and its header beside it; returns both paths."""
    if path.suffix != ".c":
        raise InputError(f"{path}: expected a name that ends in .c")
    header = path.with_suffix(".h")
    return write_text(path, source(heli, header.name)), write_text(header, declarations(heli, header.stem))


def source(heli: Helicopter, header: str) -> str:
    """C code of `heli.rhs`, doubles throughout."""
    import casadi

    generator = casadi.CodeGenerator("rhs.c", {"with_header": False, "verbose": False})
    generator.add(heli.rhs)
    return f"/* {_title(heli)}: equations of motion; see {header} for the meaning of every entry. */\n{generator.dump()}"


def declarations(heli: Helicopter, stem: str) -> str:
    """The header: index and unit of every state, input, wind component, and how to call the function."""
    guard = re.sub(r"\W", "_", f"{stem}_h").upper()
    rhs = heli.rhs
    return f"""/* {_title(heli)}
   source: {heli.vehicle.source}

   xdot = f(x, u, wind), continuous time, SI units and radians, body axes x forward, y right, z down.
   Air density {heli.density:g} kg/m^3, governor "{heli.governor}". d_ped is the total tail blade pitch.

     const double* arg[RHS_SZ_ARG] = {{x, u, wind}};  double* res[RHS_SZ_RES] = {{xdot}};
     int iw[RHS_SZ_IW > 0 ? RHS_SZ_IW : 1];  double w[RHS_SZ_W > 0 ? RHS_SZ_W : 1];
     rhs(arg, res, iw, w, 0);
*/
#ifndef {guard}
#define {guard}

#define RHS_SZ_ARG {rhs.sz_arg()}
#define RHS_SZ_RES {rhs.sz_res()}
#define RHS_SZ_IW {rhs.sz_iw()}
#define RHS_SZ_W {rhs.sz_w()}

/* states x, and their derivatives xdot (unit per second) */
{_indices("X", heli.states)}

/* inputs u; travel of each: symmetric */
{_indices("U", heli.inputs, heli.travel.tolist())}

/* wind, body axes */
{_indices("WIND", heli.wind)}

#ifdef __cplusplus
extern "C" {{
#endif
int rhs(const double** arg, double** res, int* iw, double* w, int mem);
#ifdef __cplusplus
}}
#endif
#endif
"""


def _title(heli: Helicopter) -> str:
    return f"{heli.vehicle.title}, {heli.governor} governor"


def _indices(prefix: str, signals: tuple[Signal, ...], travel: list[float] | None = None) -> str:
    lines = [f"#define RHS_{prefix}_{s} {i} /* {s.unit}{f', +-{travel[i]:g}' if travel else ''} */" for i, s in enumerate(signals)]
    return "\n".join([*lines, f"#define RHS_N_{prefix} {len(signals)}"])
