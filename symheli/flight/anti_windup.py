"""Gains that let a controller's states follow the commands that are really applied."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from symheli.errors import InputError
from symheli.lpv.riccati import regulator
from symheli.values.arrays import Array

VARIANCE_RATIOS = tuple(10.0**k for k in range(-4, 7))
"""Ratios of the variance of the applied to that of the commanded input, tried from the fastest
observer to the slowest.
"""
RADIUS_TOLERANCE = 1e-6
"""Rounding error of an eigenvalue's modulus."""


def observer_gains(A: Array, B: Array, C: Array) -> Array:
    """L (K, n, m) for x(k+1) = A x + B e + L (applied - commanded) at K airspeeds.

    Those of a Kalman filter that reads the states from the applied commands, white noise of 1 on
    every input: with all commands at their limits the states then follow these instead of winding
    up, A - L C stable. The fastest of the `VARIANCE_RATIOS` is taken, the same at all airspeeds,
    for which no set of saturated commands, the others free, is less stable than the controller
    itself: frozen airspeeds, no proof for moving ones.

    Parameters
    ----------
    A, B, C : array
        (K, n, n), (K, n, nu), (K, m, n); C of the commands that can saturate.

    Raises
    ------
    InputError
        A state that neither decays nor shows in a command.

    References
    ----------
    Astrom, Wittenmark (1997), Computer-Controlled Systems, sec. 9.4.
    """
    if not C.size:
        return np.zeros((len(A), A.shape[1], C.shape[1]))
    alone = np.array([_radius(M) for M in A])
    for trust in VARIANCE_RATIOS:
        L = np.stack([_kalman(*at, trust) for at in zip(A, B, C, strict=True)])
        if (saturated_radius(A, L, C) <= np.maximum(alone, 1.0) + RADIUS_TOLERANCE).all():
            return L
    return np.zeros_like(L)


def saturated_radius(A: Array, L: Array, C: Array) -> Array:
    """(K,): the largest eigenvalue magnitude of A - L C over all sets of commands that saturate
    together, none left out but the empty one.
    """
    m = C.shape[1]
    sets = [list(s) for size in range(1, m + 1) for s in combinations(range(m), size)]
    return np.array(
        [
            max(_radius(a - gain[:, s] @ c[s]) for s in sets)
            for a, gain, c in zip(A, L, C, strict=True)
        ]
    )


def _kalman(A: Array, B: Array, C: Array, trust: float) -> Array:
    n = len(A)
    Q = B @ B.T
    Q = Q + 1e-9 * max(np.trace(Q) / n, np.finfo(float).tiny) * np.eye(n)
    size = np.diag(C @ Q @ C.T)
    R = trust * np.diag(np.maximum(size, 1e-6 * max(size.max(), np.finfo(float).tiny)))
    try:
        L = regulator(A.T, C.T, Q, R, dt=1.0).K.T
    except InputError:
        L = np.zeros((n, len(C)))
    if not _radius(A - L @ C) < 1.0:
        raise InputError(
            "no anti-windup gain: a state of the controller neither decays nor shows in a command"
            " that it could be read from; reduce the controller, or give correction=0"
        )
    return L


def _radius(M: Array) -> float:
    return float(np.abs(np.linalg.eigvals(M)).max(initial=0.0))
