"""Conversion between the Euler form of linear models and the quaternion form of flights, for one
state or arrays of them.
"""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array


def flight_state(x: object, heading: float = 0.0, position: object = (0.0, 0.0, 0.0)) -> Array:
    """Quaternion form (..., nx + 5) of Euler-form states (..., nx) at `heading` (rad) and
    `position` (north east down, m).
    """
    x = np.asarray(x, float)
    (cp, ct, cy), (sp, st, sy) = (
        [f(angle / 2) for angle in (x[..., 6], x[..., 7], np.full(x.shape[:-1], heading))]
        for f in (np.cos, np.sin)
    )
    quaternion = [
        cp * ct * cy + sp * st * sy,
        sp * ct * cy - cp * st * sy,
        cp * st * cy + sp * ct * sy,
        cp * ct * sy - sp * st * cy,
    ]
    place = np.broadcast_to(np.asarray(position, float), (*x.shape[:-1], 3))
    return np.concatenate([x[..., :6], np.stack(quaternion, axis=-1), place, x[..., 8:]], axis=-1)


def euler_state(flight: object) -> Array:
    """Euler form (..., nx) of quaternion-form states (..., nx + 5): heading and position are left
    out.
    """
    flight = np.asarray(flight, float)
    q0, q1, q2, q3 = np.moveaxis(flight[..., 6:10], -1, 0)
    phi = np.arctan2(2 * (q0 * q1 + q2 * q3), 1 - 2 * (q1**2 + q2**2))
    theta = np.arcsin(np.clip(2 * (q0 * q2 - q3 * q1), -1.0, 1.0))
    return np.concatenate(
        [flight[..., :6], phi[..., None], theta[..., None], flight[..., 13:]], axis=-1
    )
