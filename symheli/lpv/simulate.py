"""Time response of an LPV model along a given scheduling trajectory."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.exponential import expm
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array, frozen


def simulate(
    lpv: LPVStateSpace,
    p: object,
    u: object,
    x0: object | None = None,
    *,
    dt: float | None = None,
    drift: object | None = None,
) -> tuple[Array, Array]:
    """States (n, nx) and outputs (n, ny) for scheduling p (n,) and inputs u (n, nu) held between
    samples.

    Continuous models are advanced by the exact exponential of each sample's A(p(k)), B(p(k)) over
    `dt` (s), p held; discrete ones by their own matrices. `drift` (n, nx) is added to dx/dt
    (continuous) or to x(k+1) (discrete): a moving trim x0(p) contributes -x0'(p) dp/dt. Deviations
    in, deviations out.
    """
    p = lpv.scheduling.check(p)
    n, nx, nu = len(p), len(lpv.states), len(lpv.inputs)
    u = frozen(u, "u", (n, nu))
    w = frozen(np.zeros((n, nx)) if drift is None else drift, "drift", (n, nx))
    state = np.zeros(nx) if x0 is None else frozen(x0, "x0", (nx,))
    A, B, C, D = lpv.matrices(p)
    if lpv.dt is None:
        if dt is None or not dt > 0:
            raise InputError("a continuous model needs the sample period dt (s)")
        stacked = np.zeros((n, 2 * nx + nu, 2 * nx + nu))
        stacked[:, :nx, :nx], stacked[:, :nx, nx : nx + nu], stacked[:, :nx, nx + nu :] = (
            A,
            B,
            np.eye(nx),
        )
        step = expm(stacked * dt)
        A, B, E = step[:, :nx, :nx], step[:, :nx, nx : nx + nu], step[:, :nx, nx + nu :]
        w = np.einsum("kij,kj->ki", E, w)
    x = np.empty((n, nx))
    for k in range(n):
        x[k] = state
        state = A[k] @ state + B[k] @ u[k] + w[k]
    return x, np.einsum("kij,kj->ki", C, x) + np.einsum("kij,kj->ki", D, u)
