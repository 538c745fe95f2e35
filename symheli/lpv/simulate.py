"""Time response of an LPV model along a given scheduling trajectory."""

from __future__ import annotations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.exponential import expm
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.arrays import Array, frozen
from symheli.values.sample_period import same_period


def simulate(
    lpv: LPVStateSpace,
    p: object,
    u: object,
    x0: object | None = None,
    *,
    dt: float | None = None,
    drift: object | None = None,
) -> tuple[Array, Array]:
    """Response of an LPV model along a scheduling history, deviations in, deviations out.

    Continuous models are advanced by the exact exponential of each sample's A(p(k)), B(p(k)), p
    held; discrete ones by their own matrices.

    Parameters
    ----------
    lpv : LPVStateSpace
        The model.
    p : array (n,)
        In the unit of its scheduling.
    u : array (n, nu)
        Held between samples.
    x0 : array (nx,), optional
        Default zero.
    dt : float, optional
        s; for continuous models.
    drift : array (n, nx), optional
        Added to dx/dt (continuous) or to x(k+1) (discrete): a moving trim x0(p) contributes
        -x0'(p) dp/dt.

    Returns
    -------
    states : array (n, nx)
        At each sample.
    outputs : array (n, ny)
        At each sample.

    Raises
    ------
    InputError
        Shapes that do not fit, p outside its range, a missing `dt`, or one that is not the model's.

    Examples
    --------
    >>> p, u = np.linspace(0.0, 1.0, 400), np.ones((400, 1))
    >>> states, outputs = lpv.simulate(spring, p, u, dt=0.1)
    >>> round(float(outputs[-1, 0]), 2)
    0.4
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
    elif dt is not None and not same_period(dt, lpv.dt):
        raise InputError(f"the model is discrete at {lpv.dt:g} s; leave dt = {dt!r} out")
    x = np.empty((n, nx))
    for k in range(n):
        x[k] = state
        state = A[k] @ state + B[k] @ u[k] + w[k]
    return x, np.einsum("kij,kj->ki", C, x) + np.einsum("kij,kj->ki", D, u)
