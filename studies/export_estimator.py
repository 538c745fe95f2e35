"""The recursive estimator of one structure as C99 for an autopilot: sizes fixed, names and units in
the header, a check, a CMake stub.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from identification import RecursiveLeastSquares
from identification.recursive import kernel
from identification.recursive.forgetting import numbers
from identification.recursive.kernel.configuration import KINDS
from studies import c_text
from studies.c_text import identifier, literals, require_identifier, table
from studies.files import write_text
from symheli.errors import InputError
from symheli.values.arrays import Array

_CMAKE_MARK = "# Written by symheli export estimator; rewritten by it while this line stays."
TOLERANCE = {"double": 1e-9, "single": 1e-3}
"""What another compiler or processor may differ by, relative to max(1, size): it may contract
products and sums.
"""


def write_estimator(
    rls: RecursiveLeastSquares, units: Mapping[str, str], folder: Path, name: str = "estimator"
) -> tuple[Path, ...]:
    """Write rls.h, rls.c, NAME.h, NAME.c, NAME_check.c and CMakeLists.txt into `folder`; returns
    the paths written.

    `units` of every signal. A CMakeLists.txt of somebody else is left alone. Raises `InputError`
    for a name that is no C identifier, a signal without unit and functions of p that are not
    piecewise polynomial.
    """
    require_identifier(name)
    arx = rls.structure
    if missing := [s for s in (*arx.outputs, *arx.inputs, *arx.parameters) if s not in units]:
        raise InputError(f"units: none given for {', '.join(missing)}")
    if not rls.configuration.factors:
        raise InputError(
            "functions brought along cannot be written in C; identify with a polynomial or spline"
            " basis"
        )
    source = Path(kernel.__file__).parent
    precision = "#define RLS_H\n" + (
        "#ifndef RLS_SINGLE\n#define RLS_SINGLE /* chosen at export */\n#endif\n"
        * (rls.precision == "single")
    )
    files = {
        "rls.h": (
            (source / "rls.h").read_text(encoding="utf-8").replace("#define RLS_H\n", precision)
        ),
        "rls.c": (source / "rls.c").read_text(encoding="utf-8"),
        f"{name}.h": header(rls, units, name),
        f"{name}.c": implementation(rls, name),
        f"{name}_check.c": check_program(rls, name),
    }
    cmake = folder / "CMakeLists.txt"
    if not cmake.exists() or cmake.read_text(encoding="utf-8").startswith(_CMAKE_MARK):
        files["CMakeLists.txt"] = _CMAKE.format(mark=_CMAKE_MARK, name=name)
    return tuple(write_text(folder / file, content) for file, content in files.items())


def header(rls: RecursiveLeastSquares, units: Mapping[str, str], name: str) -> str:
    """Sizes, the index of every signal and regressor, and the functions."""
    arx, c, up = rls.structure, rls.configuration, name.upper()
    ranges = dict(zip(arx.parameters, arx.basis.ranges, strict=True))
    groups = [
        f"   {', '.join(arx.outputs[j] for j in layout.group.outputs)}: {layout.n} regressors,"
        f" factor of order {layout.n + layout.m}"
        for layout in c.groups
    ]
    blocks = [
        [f"#define {up}_Y_{s} {i} /* {units[s]} */" for i, s in enumerate(arx.outputs)],
        [f"#define {up}_U_{s} {i} /* {units[s]} */" for i, s in enumerate(arx.inputs)],
        [
            f"#define {up}_P_{s} {i} /* {units[s]}, {low:g} to {high:g} */"
            for i, (s, (low, high)) in enumerate(ranges.items())
        ],
        [
            f"#define {up}_R_{identifier(r)} {i} /* {r} */"
            for i, r in enumerate(arx.regressor_names)
        ],
    ]
    state, work = c.sizes
    return _HEADER.format(
        name=name,
        up=up,
        ny=arx.ny,
        nu=arx.nu,
        np=len(arx.parameters),
        n=arx.n_regressors,
        memory=arx.memory,
        state=state,
        work=work,
        bytes=(state + work) * np.dtype(c.dtype).itemsize,
        precision=rls.precision,
        forgetting=c.forgetting,
        basis=arx.basis,
        at="its own lag" if arx.scheduling_at == "lag" else "the present",
        groups="\n".join(groups),
        signals="\n\n".join("\n".join(block) for block in blocks if block),
    )


def implementation(rls: RecursiveLeastSquares, name: str) -> str:
    """The configuration as constants, and the memory."""
    c, arx = rls.configuration, rls.structure
    kind, *values = numbers(c.forgetting)
    entries = ", ".join(
        f"{{RLS_{KINDS[k].upper()}, {channel}, {lag}, {p_lag}}}"
        for k, channel, lag, p_lag in c.entries.tolist()
    )
    lines = [f"static const rls_entry entries[] = {{{entries}}};"]
    for g, layout in enumerate(c.groups):
        lines.append(table("int", f"outputs_{g}", layout.group.outputs))
        lines.append(table("int", f"entries_{g}", layout.group.entries))
    groups = ", ".join(
        f"{{{y.m}, {len(y.group.entries)}, outputs_{g}, entries_{g}}}"
        for g, y in enumerate(c.groups)
    )
    lines.append(f"static const rls_group groups[] = {{{groups}}};")
    factors = []
    for i, factor in enumerate(c.factors):
        functions, degree, pieces, slack, knots, bernstein = factor.arguments
        lines.append(table("rls_real", f"knots_{i}", literals(knots, c.dtype)))
        lines.append(table("rls_real", f"bernstein_{i}", literals(bernstein.reshape(-1), c.dtype)))
        factors.append(
            f"{{{functions}, {degree}, {pieces}, {literals([slack], c.dtype)[0]}, knots_{i},"
            f" bernstein_{i}}}"
        )
    lines.append(f"static const rls_factor factors[] = {{{', '.join(factors)}}};")
    lines.append(table("int", "products", c.index.reshape(-1).tolist()))
    lines.append(table("rls_real", "largest", literals(c.largest, c.dtype)))
    kinds = ("RLS_CONSTANT", "RLS_VARIABLE", "RLS_DIRECTIONAL")
    return _IMPLEMENTATION.format(
        name=name,
        up=name.upper(),
        tables="\n".join(lines),
        memory=arx.memory,
        entries=len(c.entries),
        groups=len(c.groups),
        functions=arx.basis.size,
        factors=len(factors),
        forgetting=f"{{{kinds[kind]}, {', '.join(literals(values, c.dtype))}}}",
    )


def check_program(rls: RecursiveLeastSquares, name: str) -> str:
    """A record of a fixed seed, one sample missing, with the innovations and coefficients that come
    out here.
    """
    c, arx = rls.configuration, rls.structure
    rows = samples(arx.ny + arx.nu, arx.basis.ranges, arx.memory + 3 * arx.basis.size + 20)
    learnt, *history = rls.online().run(rows)
    innovations, coefficients = map(np.asarray, history)
    return _CHECK.format(
        name=name,
        up=name.upper(),
        rows=len(rows),
        tolerance=TOLERANCE[rls.precision],
        learnt=int(learnt.sum()),
        samples=c_text.rows(rows, c.dtype),
        innovations=c_text.rows(innovations[learnt], c.dtype),
        theta=c_text.rows(coefficients[-1], c.dtype),
    )


def samples(signals: int, ranges: Iterable[tuple[float, float]], count: int) -> Array:
    """Rows of `signals` normal numbers and a point of the ranges, the sample in the middle missing:
    numbers to compute with, no flight.
    """
    rng = np.random.default_rng(0)
    points = [low + (high - low) * rng.uniform(size=count) for low, high in ranges]
    rows = np.column_stack([rng.standard_normal((count, signals)), *points])
    rows[count // 2, 0] = np.nan
    return rows


_HEADER = """/* Recursive estimator of an LPV input-output model, {precision} precision, {bytes} bytes of memory; see rls.h.

     y(k) = theta' phi(k) + e(k); phi: -y, u, 1 and the change of p at the lags below, times the functions of p at {at}
     functions {basis}
     forgetting {forgetting}

   Outputs that share a triangular factor:
{groups}

   Call {name}_init() once, then {name}_update(y, u, p) every sample. NaN marks what is missing.
*/
#ifndef {up}_H
#define {up}_H

#include "rls.h"

#define {up}_NY {ny}
#define {up}_NU {nu}
#define {up}_NP {np}
#define {up}_N {n} /* regressors */
#define {up}_MEMORY {memory} /* samples a regressor reaches back */
#define {up}_STATE {state} /* numbers to save and restore */
#define {up}_WORK {work} /* numbers of scratch */

/* indices of y, u, p, and of the regressors: row i of theta, column j the output */
{signals}

#ifdef __cplusplus
extern "C" {{
#endif
/* The state that knows nothing; 0, or 1 where the sizes above are not those of rls.c, which then must not be used. */
int {name}_init(void);
/* y[{up}_NY], u[{up}_NU], p[{up}_NP] of one instant; returns the bits of rls.h: RLS_LEARNT, RLS_DETERMINED, ... */
int {name}_update(const rls_real *y, const rls_real *u, const rls_real *p);
/* theta[{up}_N * {up}_NY], row by row */
void {name}_coefficients(rls_real *theta);
/* [{up}_NY], of the last sample that was learnt */
const rls_real *{name}_innovation(void);
/* [{up}_STATE], all that is remembered: save it, and write it back to go on to the last bit */
rls_real *{name}_state(void);
#ifdef __cplusplus
}}
#endif
#endif
"""

_IMPLEMENTATION = """/* See {name}.h. */
#include "{name}.h"

{tables}
static const rls_config config = {{
    {up}_NY, {up}_NU, {up}_NP, {memory}, {entries}, {groups}, entries, groups, {{{functions}, {factors}, factors, products, largest}},
    {forgetting},
}};
static rls_real state[{up}_STATE], work[{up}_WORK];

int {name}_init(void)
{{
    if (rls_state_size(&config) != {up}_STATE || rls_work_size(&config) != {up}_WORK) return 1;
    rls_init(&config, state, work);
    return 0;
}}

int {name}_update(const rls_real *y, const rls_real *u, const rls_real *p) {{ return rls_update(&config, state, work, y, u, p); }}

void {name}_coefficients(rls_real *theta) {{ rls_coefficients(&config, state, theta); }}

const rls_real *{name}_innovation(void) {{ return rls_innovation(&config, work); }}

rls_real *{name}_state(void) {{ return state; }}
"""

_CHECK = """/* Does the estimator reproduce what Python computed? Exit status 0: every number to {tolerance:g} of max(1, its size). */
#include <math.h>
#include <stdio.h>
#include "{name}.h"

/* y, u, p */
static const rls_real samples[{rows}][{up}_NY + {up}_NU + {up}_NP] = {{
{samples}
}};
/* of the samples with a complete regressor */
static const rls_real innovations[{learnt}][{up}_NY] = {{
{innovations}
}};
/* after the last sample */
static const rls_real coefficients[{up}_N][{up}_NY] = {{
{theta}
}};

static double worst;

static void compare(const rls_real *got, const rls_real *expected, int count)
{{
    for (int i = 0; i < count; i++) {{
        const double size = fabs((double)expected[i]), error = fabs((double)got[i] - (double)expected[i]) / (size > 1 ? size : 1);
        if (!(error <= worst)) worst = error; /* a NaN stays */
    }}
}}

int main(void)
{{
    rls_real theta[{up}_N * {up}_NY];
    int learnt = 0;
    if ({name}_init()) {{
        printf("{name}: the sizes in {name}.h are not those of rls.c\\n");
        return 1;
    }}
    for (int k = 0; k < {rows}; k++) {{
        const rls_real *y = samples[k], *u = y + {up}_NY, *p = u + {up}_NU;
        if (!({name}_update(y, u, p) & RLS_LEARNT)) continue;
        if (learnt < {learnt}) compare({name}_innovation(), innovations[learnt], {up}_NY);
        learnt++;
    }}
    {name}_coefficients(theta);
    compare(theta, coefficients[0], {up}_N * {up}_NY);
    printf("{name}: %d of {learnt} updates, largest difference %.2e%s\\n", learnt, worst, worst == 0 ? ", the same to the last bit" : "");
    return !(learnt == {learnt} && worst <= {tolerance:g});
}}
"""

_CMAKE = """{mark}
cmake_minimum_required(VERSION 3.10)
project({name} C)
set(CMAKE_C_STANDARD 99)
set(CMAKE_C_STANDARD_REQUIRED ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

add_library({name} {name}.c rls.c)
target_include_directories({name} PUBLIC "${{CMAKE_CURRENT_SOURCE_DIR}}")
if(NOT MSVC)
  target_compile_options({name} PRIVATE -ffp-contract=off)
endif()

enable_testing()
add_executable({name}_check {name}_check.c)
target_link_libraries({name}_check PRIVATE {name})
if(UNIX)
  target_link_libraries({name}_check PRIVATE m)
endif()
add_test(NAME {name}_check COMMAND {name}_check)
"""
