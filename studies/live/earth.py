"""Velocities between body and earth axes."""

from __future__ import annotations

import math

import numpy as np

from symheli.logs.xplane import body_velocity


def earth_velocity(
    u: float, v: float, w: float, phi: float, theta: float, psi: float
) -> tuple[float, float, float]:
    """Return north, east, down (m/s) of a velocity in body axes (m/s), by the Euler angles psi,
    theta, phi (rad) in that order: the inverse of `symheli.logs.xplane.body_velocity`.
    """
    right, below = (
        math.cos(phi) * v - math.sin(phi) * w,
        math.sin(phi) * v + math.cos(phi) * w,
    )
    ahead, down = (
        math.cos(theta) * u + math.sin(theta) * below,
        -math.sin(theta) * u + math.cos(theta) * below,
    )
    return (
        math.cos(psi) * ahead - math.sin(psi) * right,
        math.sin(psi) * ahead + math.cos(psi) * right,
        down,
    )


def in_body(
    north: float, east: float, down: float, phi: float, theta: float, psi: float
) -> dict[str, float]:
    """Return u, v, w (m/s) of a velocity over ground (m/s); NaN where a number is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        body = body_velocity(*map(np.asarray, (north, east, down, phi, theta, psi)))
    return dict(zip("uvw", map(float, body), strict=True))


def turn_rate(q: float, r: float, phi: float, theta: float) -> float:
    """Return the rate of the heading, rad/s, by rates (rad/s) and attitude (rad)."""
    return (q * math.sin(phi) + r * math.cos(phi)) / math.cos(theta)
