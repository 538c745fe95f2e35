"""The hand-written equations in Numba, with the Runge-Kutta loop inside."""

import numba
import numpy as np

from benchmarks.opponents.equations import build

COMPILE = numba.njit(
    error_model="numpy", fastmath=True
)  # fastmath takes a quarter off the time here
EQUATIONS = build(COMPILE)
derivatives = EQUATIONS.quaternion


@COMPILE
def _rates(x, u, wind, out):
    d = derivatives(
        x[0],
        x[1],
        x[2],
        x[3],
        x[4],
        x[5],
        x[6],
        x[7],
        x[8],
        x[9],
        x[10],
        x[11],
        x[12],
        x[13],
        x[14],
        u[0],
        u[1],
        u[2],
        u[3],
        wind[0],
        wind[1],
        wind[2],
    )
    for i in range(15):
        out[i] = d[i]


@COMPILE
def fly(x0, inputs, wind, dt, steps):
    """States (n + 1, 15) under inputs (n, 4) held for `dt` s each, by `steps` classical Runge-Kutta
    steps an input.
    """
    n, h = len(inputs), dt / steps
    states = np.empty((n + 1, 15))
    x, z = x0.copy(), np.empty(15)
    k1, k2, k3, k4 = np.empty(15), np.empty(15), np.empty(15), np.empty(15)
    states[0] = x
    for k in range(n):
        u = inputs[k]
        for _ in range(steps):
            _rates(x, u, wind, k1)
            for i in range(15):
                z[i] = x[i] + 0.5 * h * k1[i]
            _rates(z, u, wind, k2)
            for i in range(15):
                z[i] = x[i] + 0.5 * h * k2[i]
            _rates(z, u, wind, k3)
            for i in range(15):
                z[i] = x[i] + h * k3[i]
            _rates(z, u, wind, k4)
            for i in range(15):
                x[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])
            x[6:10] /= np.sqrt(x[6] ** 2 + x[7] ** 2 + x[8] ** 2 + x[9] ** 2)
        states[k + 1] = x
    return states


@numba.njit(error_model="numpy", fastmath=True, parallel=True)
def fly_many(x0, inputs, winds, dt, steps):
    """Last states (m, 15) of m flights from x0 (m, 15) in winds (m, 3) under the same inputs (n,
    4), on all cores.
    """
    ends = np.empty((len(x0), 15))
    for j in numba.prange(len(x0)):
        ends[j] = fly(x0[j], inputs, winds[j], dt, steps)[-1]
    return ends
