"""A C program that carries cases computed here and says whether the exported code reproduces
them.
"""

from __future__ import annotations

import numpy as np

from symheli import Helicopter

CASES = 12
STEP = 0.005  # s
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


def check_program(heli: Helicopter, header: str) -> str:
    """Cases of `heli_rhs`, `heli_flight_rhs` and `heli_flight_step`, drawn from a fixed seed:
    flight, wind, saturations.
    """
    rng = np.random.default_rng(0)
    blocks = {"rhs_cases": [], "flight_cases": [], "step_cases": []}
    for _ in range(CASES):
        inputs = 0.5 * heli.travel * rng.uniform(
            -1, 1, len(heli.inputs)
        ) + 0.5 * heli.travel * np.array([0, 0, 1, 1])
        wind = 2.0 * rng.standard_normal(3)
        x, flight = _state(heli, heli.states, rng), _state(heli, heli.flight_states, rng)
        flight[6:10] /= np.linalg.norm(flight[6:10])
        blocks["rhs_cases"].append((x, inputs, wind, heli.numeric("rhs")(x, inputs, wind)[0]))
        blocks["flight_cases"].append(
            (flight, inputs, wind, heli.numeric("flight_rhs")(flight, inputs, wind)[0])
        )
        blocks["step_cases"].append((flight, inputs, wind, _step(heli, flight, inputs, wind)))
    tables = "\n".join(
        f"static const double {name}[{CASES}][{sum(map(len, rows[0]))}] = {{\n{_rows(rows)}\n}};"
        for name, rows in blocks.items()
    )
    return _PROGRAM.format(header=header, cases=CASES, step=STEP, tables=tables)


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


def _rows(rows: list) -> str:
    return ",\n".join(
        "    {" + ", ".join(repr(float(v)) for v in np.concatenate(row)) + "}" for row in rows
    )


_PROGRAM = """/* Does the exported code reproduce what Python computed? Exit status 0: every entry to 1e-12 of max(1, its size). */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "{header}"

#define CASES {cases}

/* x, u, wind, expected */
{tables}

static double miss(const double *got, const double *expected, int n)
{{
    double worst = 0;
    int i;
    for (i = 0; i < n; i++) {{
        const double size = fabs(expected[i]) > 1 ? fabs(expected[i]) : 1;
        const double error = fabs(got[i] - expected[i]) / size;
        if (!(error <= worst)) worst = error; /* a NaN stays */
    }}
    return worst;
}}

static int verdict(const char *name, double worst)
{{
    printf("%-18s largest difference %.2e%s\\n", name, worst, worst <= 1e-12 ? "" : "  FAILED");
    return !(worst <= 1e-12);
}}

int main(void)
{{
    double got[RHS_N_FLIGHT], worst[3] = {{0, 0, 0}};
    int k, failed = 0;
    for (k = 0; k < CASES; k++) {{
        const double *x = rhs_cases[k], *u = x + RHS_N_X, *wind = u + RHS_N_U;
        double error;
        heli_rhs(x, u, wind, got);
        error = miss(got, wind + RHS_N_WIND, RHS_N_X);
        if (!(error <= worst[0])) worst[0] = error;

        x = flight_cases[k], u = x + RHS_N_FLIGHT, wind = u + RHS_N_U;
        heli_flight_rhs(x, u, wind, got);
        error = miss(got, wind + RHS_N_EARTH, RHS_N_FLIGHT);
        if (!(error <= worst[1])) worst[1] = error;

        x = step_cases[k], u = x + RHS_N_FLIGHT, wind = u + RHS_N_U;
        memcpy(got, x, sizeof got);
        heli_flight_step(got, u, wind, {step});
        error = miss(got, wind + RHS_N_EARTH, RHS_N_FLIGHT);
        if (!(error <= worst[2])) worst[2] = error;
    }}
    failed += verdict("heli_rhs", worst[0]);
    failed += verdict("heli_flight_rhs", worst[1]);
    failed += verdict("heli_flight_step", worst[2]);
    return failed;
}}
"""
