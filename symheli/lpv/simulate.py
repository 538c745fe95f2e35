"""Time response of an LPV model along a given scheduling trajectory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.exponential import expm
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.lpv.scheduling import check_all
from symheli.values.arrays import Array, frozen
from symheli.values.sample_period import same_period


class Steps(NamedTuple):
    """x(k+1) = A x(k) + B u(k) + E w(k) along a trajectory: A, E (n, nx, nx), B (n, nx, nu)."""

    A: Array
    B: Array
    E: Array


def simulate(
    lpv: LPVStateSpace,
    p: object,
    u: object,
    x0: object | None = None,
    *,
    dt: float | None = None,
    drift: object | None = None,
) -> tuple[Array, Array]:
    """Simulate an LPV model along a scheduling history, in deviations from the trim.

    Continuous models are advanced by the exact exponential of each sample's A(p(k)), B(p(k)), p
    held; discrete ones by their own matrices.

    Parameters
    ----------
    lpv : LPVStateSpace
        The model.
    p : array (n,), or (n, d) with d parameters
        In the units of the parameters.
    u : array (n, nu)
        Held between samples.
    x0 : array (nx,), optional
        Default zero.
    dt : float, optional
        s; for continuous models.
    drift : array (n, nx), optional
        Added to dx/dt (continuous) or to x(k+1) (discrete): a moving trim x0(p) contributes
        `lpv.trim.drift(p, rate)`.

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
    p = check_all(lpv.parameters, p)
    n, nx, nu = len(p), len(lpv.states), len(lpv.inputs)
    u = frozen(u, "u", (n, nu))
    w = frozen(np.zeros((n, nx)) if drift is None else drift, "drift", (n, nx))
    state = np.zeros(nx) if x0 is None else frozen(x0, "x0", (nx,))
    _, _, C, D = lpv.matrices(p)
    A, B, E = steps(lpv, p, dt)
    w = np.einsum("kij,kj->ki", E, w)
    x = np.empty((n, nx))
    for k in range(n):
        x[k] = state
        state = A[k] @ state + B[k] @ u[k] + w[k]
    return x, np.einsum("kij,kj->ki", C, x) + np.einsum("kij,kj->ki", D, u)


def steps(lpv: LPVStateSpace, p: Array, dt: float | None) -> Steps:
    """Return the transition from each sample to the next, p held over `dt` (s) for a continuous
    model.
    """
    A, B, *_ = lpv.matrices(p)
    n, nx, nu = B.shape
    if lpv.dt is not None:
        if dt is not None and not same_period(dt, lpv.dt):
            raise InputError(f"the model is discrete at {lpv.dt:g} s; leave dt = {dt!r} out")
        return Steps(A, B, np.broadcast_to(np.eye(nx), (n, nx, nx)))
    if dt is None or not dt > 0:
        raise InputError("a continuous model needs the sample period dt (s)")
    stacked = np.zeros((n, 2 * nx + nu, 2 * nx + nu))
    stacked[:, :nx, :nx], stacked[:, :nx, nx : nx + nu] = A, B
    stacked[:, :nx, nx + nu :] = np.eye(nx)
    step = expm(stacked * dt)
    return Steps(step[:, :nx, :nx], step[:, :nx, nx : nx + nu], step[:, :nx, nx + nu :])
