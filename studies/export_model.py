"""An identified model as C99 for an autopilot or a simulator: one step ahead or in free run, with a
check of what Python computed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identification import Constant, LPVARXModel
from identification.recursive.kernel.configuration import KINDS, Configuration
from studies.c_text import identifier, literals, require_identifier, rows, table
from studies.export_estimator import TOLERANCE, samples
from studies.files import write_text
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array


def write_model(
    model: LPVARXModel, folder: Path, name: str = "model", precision: str = "double"
) -> tuple[Path, ...]:
    """Write NAME.h, NAME.c and NAME_check.c into `folder`; returns the paths written.

    No allocation, no library. Raises `InputError` for a name that is no C identifier, another
    precision than "double" or "single", and functions of p that are not piecewise polynomial.
    """
    require_identifier(name)
    if precision not in TOLERANCE:
        raise InputError(f'precision: expected "double" or "single", got {precision!r}')
    c = Configuration(
        model.structure, Constant(1.0), np.float32 if precision == "single" else np.float64
    )
    if not c.factors:
        raise InputError(
            "functions brought along cannot be written in C; identify with a polynomial or spline"
            " basis"
        )
    files = {
        f"{name}.h": header(model, c, name),
        f"{name}.c": implementation(model, c, name),
        f"{name}_check.c": check(model, c, name),
    }
    return tuple(write_text(folder / file, content) for file, content in files.items())


def header(model: LPVARXModel, c: Configuration, name: str) -> str:
    """Sizes, the index of every signal with its unit, and the functions."""
    arx, up = model.structure, name.upper()
    blocks = [
        [f"#define {up}_Y_{identifier(s)} {i} /* {s.unit} */" for i, s in enumerate(model.outputs)],
        [f"#define {up}_U_{identifier(s)} {i} /* {s.unit} */" for i, s in enumerate(model.inputs)],
        [
            f"#define {up}_P_{identifier(s)} {i} /* {s.unit}, {low:g} to {high:g} */"
            for i, (s, (low, high)) in enumerate(
                zip(model.parameters, arx.basis.ranges, strict=True)
            )
        ],
    ]
    return _HEADER.format(
        name=name,
        up=up,
        ny=arx.ny,
        nu=arx.nu,
        np=len(arx.parameters),
        nf=arx.basis.size,
        memory=arx.memory,
        dt=model.dt,
        room=max(arx.nu, 1),
        real="float" if c.dtype is np.float32 else "double",
        basis=arx.basis,
        method=model.method,
        at="of their lag" if arx.scheduling_at == "lag" else "now",
        signals="\n\n".join("\n".join(b) for b in blocks if b),
    )


def implementation(model: LPVARXModel, c: Configuration, name: str) -> str:
    """The coefficients and functions as tables, and the recursion."""
    factors = [f.arguments for f in c.factors]
    numbers = [[functions, degree, pieces] for functions, degree, pieces, *_ in factors]
    starts = np.cumsum([[0, 0], *([f[4].size, f[5].size] for f in factors[:-1])], axis=0)
    entries = ", ".join(
        f"{{{kind}, {channel}, {lag}, {p_lag}}}" for kind, channel, lag, p_lag in c.entries.tolist()
    )
    tables = [
        f"static const struct {{ int kind, channel, lag, p_lag; }} entries[] = {{{entries}}};",
        f"static const real theta[][{name.upper()}_NY] = {{\n{rows(model.theta, c.dtype)}\n}};",
        "static const struct { int functions, degree, pieces, knot, bernstein; } factors[] = {"
        + ", ".join(
            f"{{{', '.join(map(str, [*n, *s]))}}}"
            for n, s in zip(numbers, starts.tolist(), strict=True)
        )
        + "};",
        table("real", "slack", literals([f[3] for f in factors], c.dtype)),
        table("real", "knots", literals(np.concatenate([f[4] for f in factors]), c.dtype)),
        table(
            "real",
            "bernstein",
            literals(np.concatenate([f[5].reshape(-1) for f in factors]), c.dtype),
        ),
        table("int", "products", c.index.reshape(-1).tolist()),
    ]
    return _IMPLEMENTATION.format(
        name=name,
        up=name.upper(),
        tables="\n".join(tables),
        entries=len(c.entries),
        kinds=", ".join(k.upper() for k in KINDS),
        order=max(f[1] for f in factors) + 1,
        most=max(f[0] for f in factors),
        factors=len(factors),
    )


def check(model: LPVARXModel, c: Configuration, name: str) -> str:
    """A record of a fixed seed, one sample missing, with one-step predictions, and the free run up
    to the missing sample.
    """
    arx = model.structure
    wide, count = arx.ny + arx.nu, 2 * arx.memory + 60
    given = samples(wide, arx.basis.ranges, count).astype(c.dtype).astype(float)
    record = FlightRecord(
        model.dt * np.arange(count), given, (*model.outputs, *model.inputs, *model.parameters)
    )
    complete = np.logical_and.reduce(np.isfinite(given), axis=1)
    there = [
        k
        for k in range(arx.memory, count)
        if complete[k - arx.memory : k].all() and np.isfinite(given[k, arx.ny :]).all()
    ]
    return _CHECK.format(
        name=name,
        up=name.upper(),
        rows=count,
        tolerance=TOLERANCE["single" if c.dtype is np.float32 else "double"],
        there=len(there),
        width=given.shape[1],
        samples=rows(given, c.dtype),
        predicted=rows(model.predict(record, 1)[there], c.dtype),
        half=count // 2,
        simulated=rows(_free_run(model, record, count // 2), c.dtype),
    )


def _free_run(model: LPVARXModel, record: FlightRecord, stop: int) -> Array:
    """Up to `stop`, the samples it starts from as they are."""
    start = model.structure.memory
    out = record.columns(model.outputs)[:stop].copy()
    out[start:] = model.simulate(record)[start:stop]
    return out


_HEADER = """/* Identified LPV input-output model, sampled at {dt:.9g} s, fitted by "{method}".

     y(k) = theta' phi(k); phi: -y, u, 1 and the change of p at their lags, times the functions of p, coefficients at p {at}
     functions {basis}

   Each sample: {name}_predict(&s, u, p, y), then {name}_observe(&s, y) with y as measured (one step ahead) or as predicted (free
   run, after {up}_MEMORY measured samples). No allocation, no library; SI units and radians.
*/
#ifndef {up}_H
#define {up}_H

typedef {real} {name}_real;

#define {up}_NY {ny}
#define {up}_NU {nu}
#define {up}_NP {np}
#define {up}_NF {nf} /* functions of p */
#define {up}_MEMORY {memory} /* samples the model reaches back */

/* indices of y, u, p */
{signals}

/* What {name}_predict says. */
enum {{ {up}_PREDICTED, {up}_NO_PAST, {up}_REFUSED }};

/* The present in row 0, the past behind it. */
typedef struct {{
    {name}_real y[{up}_MEMORY + 1][{up}_NY], u[{up}_MEMORY + 1][{room}], p[{up}_MEMORY + 1][{up}_NP], f[{up}_MEMORY + 1][{up}_NF];
    int filled, fit;
}} {name}_state;

#ifdef __cplusplus
extern "C" {{
#endif
/* No past. */
void {name}_init({name}_state *s);
/* y[{up}_NY] of this instant from u[{up}_NU], p[{up}_NP] now and what was before. {up}_NO_PAST: not enough samples yet, y is left alone.
   {up}_REFUSED: a number that is not finite, or p outside the range of the model; y is left alone and the past starts afresh. */
int {name}_predict({name}_state *s, const {name}_real *u, const {name}_real *p, {name}_real *y);
/* What y was at this instant. A number that is not finite marks a missing sample: the past starts afresh. */
void {name}_observe({name}_state *s, const {name}_real *y);
#ifdef __cplusplus
}}
#endif
#endif
"""

_IMPLEMENTATION = """/* See {name}.h. */
#include "{name}.h"

typedef {name}_real real;
enum {{ {kinds} }};

{tables}

static int is_finite(real x) {{ return x - x == 0; }}

/* f({up}_NF) at p; 0 where p is outside. */
static int functions(const real *p, real *f)
{{
    real value[{factors}][{most}];
    for (int i = 0; i < {factors}; i++) {{
        const real *knot = knots + factors[i].knot;
        const int last = factors[i].pieces, degree = factors[i].degree;
        int piece = 0;
        if (!(p[i] >= knot[0] - slack[i] && p[i] <= knot[last] + slack[i])) return 0;
        while (piece + 1 < last && p[i] >= knot[piece + 1]) piece++;
        const real x = (p[i] - knot[piece]) / (knot[piece + 1] - knot[piece]);
        for (int j = 0; j < factors[i].functions; j++) {{ /* de Casteljau */
            const real *b = bernstein + factors[i].bernstein + (piece * factors[i].functions + j) * (degree + 1);
            real c[{order}];
            for (int d = 0; d <= degree; d++) c[d] = b[d];
            for (int d = degree; d > 0; d--)
                for (int m = 0; m < d; m++) c[m] += x * (c[m + 1] - c[m]);
            value[i][j] = c[0];
        }}
    }}
    for (int j = 0; j < {up}_NF; j++) {{
        f[j] = 1;
        for (int i = 0; i < {factors}; i++) f[j] *= value[i][products[j * {factors} + i]];
    }}
    return 1;
}}

void {name}_init({name}_state *s) {{ s->filled = s->fit = 0; }}

int {name}_predict({name}_state *s, const real *u, const real *p, real *y)
{{
    real sum[{up}_NY] = {{0}};
    for (int k = {up}_MEMORY; k > 0; k--) {{
        for (int i = 0; i < {up}_NY; i++) s->y[k][i] = s->y[k - 1][i];
        for (int i = 0; i < {up}_NU; i++) s->u[k][i] = s->u[k - 1][i];
        for (int i = 0; i < {up}_NP; i++) s->p[k][i] = s->p[k - 1][i];
        for (int i = 0; i < {up}_NF; i++) s->f[k][i] = s->f[k - 1][i];
    }}
    s->fit = functions(p, s->f[0]);
    for (int i = 0; i < {up}_NU; i++) s->fit = is_finite(s->u[0][i] = u[i]) && s->fit;
    for (int i = 0; i < {up}_NP; i++) s->p[0][i] = p[i];
    if (!s->fit) {{
        s->filled = 0;
        return {up}_REFUSED;
    }}
    if (s->filled < {up}_MEMORY) return {up}_NO_PAST;
    for (int e = 0; e < {entries}; e++) {{
        const int i = entries[e].channel, lag = entries[e].lag;
        real value = 1;
        switch (entries[e].kind) {{
        case OUTPUT: value = -s->y[lag][i]; break;
        case INPUT: value = s->u[lag][i]; break;
        case INCREMENT: value = s->p[0][i] - s->p[lag][i]; break;
        default: break; /* OFFSET */
        }}
        for (int j = 0; j < {up}_NF; j++)
            for (int o = 0; o < {up}_NY; o++) sum[o] += theta[e * {up}_NF + j][o] * value * s->f[entries[e].p_lag][j];
    }}
    for (int o = 0; o < {up}_NY; o++) y[o] = sum[o];
    return {up}_PREDICTED;
}}

void {name}_observe({name}_state *s, const real *y)
{{
    for (int o = 0; o < {up}_NY; o++) s->fit = is_finite(s->y[0][o] = y[o]) && s->fit;
    s->filled = s->fit ? s->filled + (s->filled < {up}_MEMORY) : 0;
}}
"""

_CHECK = """/* Does the model predict and run free as Python computed? Exit status 0: every number to {tolerance:g} of max(1, its size). */
#include <math.h>
#include <stdio.h>
#include "{name}.h"

/* y, u, p */
static const {name}_real samples[{rows}][{width}] = {{
{samples}
}};
/* one step ahead, where the past is complete */
static const {name}_real predicted[{there}][{up}_NY] = {{
{predicted}
}};
/* free run from the first {up}_MEMORY samples, up to the missing one */
static const {name}_real simulated[{half}][{up}_NY] = {{
{simulated}
}};

static double worst;

static void compare(const {name}_real *got, const {name}_real *expected)
{{
    for (int i = 0; i < {up}_NY; i++) {{
        const double size = fabs((double)expected[i]), error = fabs((double)got[i] - (double)expected[i]) / (size > 1 ? size : 1);
        if (!(error <= worst)) worst = error; /* a NaN stays */
    }}
}}

int main(void)
{{
    {name}_state s;
    {name}_real y[{up}_NY];
    int there = 0;
    {name}_init(&s);
    for (int k = 0; k < {rows}; k++) {{
        const {name}_real *u = samples[k] + {up}_NY, *p = u + {up}_NU;
        if ({name}_predict(&s, u, p, y) == {up}_PREDICTED) {{
            if (there < {there}) compare(y, predicted[there]);
            there++;
        }}
        {name}_observe(&s, samples[k]);
    }}
    {name}_init(&s);
    for (int k = 0; k < {half}; k++) {{
        const {name}_real *u = samples[k] + {up}_NY, *p = u + {up}_NU;
        const int free_run = {name}_predict(&s, u, p, y) == {up}_PREDICTED;
        if (free_run) compare(y, simulated[k]);
        {name}_observe(&s, free_run ? y : samples[k]);
    }}
    printf("{name}: %d of {there} predictions and a free run, largest difference %.2e\\n", there, worst);
    return !(there == {there} && worst <= {tolerance:g});
}}
"""
