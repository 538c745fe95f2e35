"""The H2-optimal controller in matrices: state feedback on a Kalman filter, by two Riccati
equations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.lpv.riccati import regulator
from symheli.values.arrays import Array
from synthesis.design.plant.generalized import Generalized

Matrices = tuple[Array, Array, Array, Array]


class ControlGains(NamedTuple):
    """The control that minimises |z| with the states known: u = F x + F0 w, X the solution of the
    Riccati equation, R the weight of u.

    Of the dual plant: the transposed gains of the filter, its covariance, and that of what it
    cannot predict.
    """

    F: Array
    F0: Array
    X: Array
    R: Array


def control_gains(P: Generalized, dt: float | None) -> ControlGains | None:
    """Return the gains, None where the equation has no stabilising solution."""
    Q, R, S = P.C1.T @ P.C1, P.D12.T @ P.D12, P.D12.T @ P.C1
    try:
        found = regulator(P.A, P.B2, Q, R, S.T, dt, terms=np.abs(P.C1).T @ np.abs(P.C1))
    except InputError:
        return None
    F0 = np.zeros((len(R), P.B1.shape[1]))
    if dt is not None:
        F0 = -np.linalg.solve(found.R, P.B2.T @ found.X @ P.B1 + P.D12.T @ P.D11)
    return ControlGains(-found.K, F0, found.X, found.R)


def lqg(P: Generalized, dt: float | None) -> Matrices | None:
    """Return the controller u = K y; its state is the filter's estimate, for a sampled plant from
    the samples before.

    D12 has full column and D21 full row rank; of a continuous plant D11 plays no part. None where
    an equation has no stabilising solution.

    References
    ----------
    Zhou, Doyle, Glover (1996), section 14.5; Chen and Francis (1995), Optimal Sampled-Data Control
    Systems, section 6.6.
    """
    control, filtering = control_gains(P, dt), control_gains(P.dual, dt)
    if control is None or filtering is None:
        return None
    F, L = control.F, filtering.F.T
    D = np.zeros((len(F), L.shape[1]))
    if dt is not None:  # the part of the newest measurement
        D = control.F @ filtering.X @ P.C2.T + control.F0 @ P.D21.T
        D = np.linalg.solve(filtering.R, D.T).T
    A = P.A + P.B2 @ F + L @ P.C2 - P.B2 @ D @ P.C2
    return given_direct_way(P.D22, A, P.B2 @ D - L, F - D @ P.C2, D)


def given_direct_way(D22: Array, A: Array, B: Array, C: Array, D: Array) -> Matrices:
    """Return the controller of a plant with D22 from that of the plant without: it acts on y - D22
    u.
    """
    N = np.linalg.inv(np.eye(D.shape[-2]) + D @ D22)
    NC, ND = N @ C, N @ D
    return A - B @ D22 @ NC, B - B @ D22 @ ND, NC, ND
