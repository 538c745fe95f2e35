"""Inertial, gravity and Euler terms of a rigid body, known whatever flies: for arrays of states."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from symheli.values.arrays import Array
from symheli.values.signal import Signal, signals

GRAVITY = 9.81
"""Gravity, m/s^2, to the digits the published numbers of the X-Cell were computed with."""

VELOCITIES: tuple[Signal, ...] = signals(("u", "v", "w", "p", "q", "r"))
"""What air and inertia act on: velocities (m/s) and rates (rad/s) in body axes."""

RIGID_BODY: tuple[Signal, ...] = signals((*VELOCITIES, "phi", "theta"))
"""With roll and pitch (rad): what the equations below take, in this order."""

INPUTS: tuple[Signal, ...] = signals(("d_lon", "d_lat", "d_col", "d_ped"))
"""Longitudinal and lateral cyclic, collective and tail rotor of a helicopter (rad)."""


def kinematic_rates(y: Array) -> Array:
    """Return the rates (..., 8) of `RIGID_BODY` of a rigid body without aerodynamic forces and
    moments.

    Parameters
    ----------
    y : array (..., 8)
        `RIGID_BODY`, SI and radians.

    Returns
    -------
    array (..., 8)
        m/s^2, rad/s^2 (zero: products of inertia are left to what is identified), rad/s. Singular
        at theta = +-90 deg.

    References
    ----------
    Klein and Morelli (2006), Aircraft System Identification, eqs 3.30 to 3.36; Budiyono and
    Sutarto, eqs 1, 3 and 4.

    Examples
    --------
    >>> import numpy as np
    >>> from symheli.values.kinematics import kinematic_rates
    >>> print(kinematic_rates(np.array([10.0, 0, 0, 0, 0, 0.1, 0, 0])).round(2))
    [ 0.   -1.    9.81  0.    0.    0.    0.    0.  ]
    """
    rates = rates_of(np.moveaxis(y, -1, 0), np)
    return np.stack(np.broadcast_arrays(*rates), axis=-1)


def rates_of(y: Iterable[Any], functions: Any) -> tuple[Any, ...]:
    """The eight rates one by one from the eight states y, with sin, cos and tan of `functions`:
    `numpy` for arrays, `math` for numbers in real time.

    Examples
    --------
    >>> import math
    >>> from symheli.values.kinematics import rates_of
    >>> rates_of((10.0, 0, 0, 0, 0, 0.1, 0, 0), math)[1]
    -1.0
    """
    u, v, w, p, q, r, phi, theta = y
    sine, cosine, slope = functions.sin(phi), functions.cos(phi), functions.cos(theta)
    turn = q * sine + r * cosine
    return (
        v * r - w * q - GRAVITY * functions.sin(theta),
        w * p - u * r + GRAVITY * sine * slope,
        u * q - v * p + GRAVITY * cosine * slope,
        0.0,
        0.0,
        0.0,
        p + functions.tan(theta) * turn,
        q * cosine - r * sine,
    )


def kinematic_jacobian(y: Array) -> Array:
    """Derivatives (..., 8, 8) of `kinematic_rates` (row) by its arguments (column) at y (..., 8).

    Examples
    --------
    >>> import numpy as np
    >>> from symheli.values.kinematics import kinematic_jacobian
    >>> print(kinematic_jacobian(np.zeros(8))[0, 7])
    -9.81
    """
    u, v, w, p, q, r, phi, theta = np.moveaxis(y, -1, 0)
    sp, cp, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    turn = q * sp + r * cp
    J = np.zeros((*y.shape, 8))
    J[..., 0, [1, 2, 4, 5, 7]] = np.stack([r, -q, -w, v, -GRAVITY * ct], axis=-1)
    J[..., 1, [0, 2, 3, 5, 6, 7]] = np.stack(
        [-r, p, w, -u, GRAVITY * cp * ct, -GRAVITY * sp * st], axis=-1
    )
    J[..., 2, [0, 1, 3, 4, 6, 7]] = np.stack(
        [q, -p, -v, u, -GRAVITY * sp * ct, -GRAVITY * cp * st], axis=-1
    )
    J[..., 6, [3, 4, 5, 6, 7]] = np.stack(
        [
            np.ones_like(u),
            np.tan(theta) * sp,
            np.tan(theta) * cp,
            np.tan(theta) * (q * cp - r * sp),
            turn / ct**2,
        ],
        axis=-1,
    )
    J[..., 7, [4, 5, 6]] = np.stack([cp, -sp, -turn], axis=-1)
    return J
