"""Rigid-body motion in body axes (x forward, y right, z down) and attitude kinematics."""

from __future__ import annotations

from typing import Any

from symheli.codegen.symbolic import cos, sin, tan
from symheli.values.kinematics import GRAVITY


def translation(
    u: Any,
    v: Any,
    w: Any,
    p: Any,
    q: Any,
    r: Any,
    gravity: tuple[Any, Any, Any],
    force: tuple[Any, Any, Any],
    mass: Any,
) -> Any:
    """(u', v', w') in m/s^2: V' = -omega x V + g + F/m. `gravity` in body axes (m/s^2), `force` in
    N.

    Source: Budiyono & Sutarto, eqs 1 and 3.
    """
    return (
        v * r - w * q + gravity[0] + force[0] / mass,
        w * p - u * r + gravity[1] + force[1] / mass,
        u * q - v * p + gravity[2] + force[2] / mass,
    )


def rotation(
    p: Any,
    q: Any,
    r: Any,
    moment: tuple[Any, Any, Any],
    Ixx: Any,
    Iyy: Any,
    Izz: Any,
    added_yaw_inertia: Any = 0.0,
) -> Any:
    """(p', q', r') in rad/s^2: I omega' = -omega x I omega + M with Ixz = 0; `moment` in N m.

    `added_yaw_inertia` (kg m^2) is that of a rotor held at constant speed relative to the body: it
    reacts on r' only. Source: Budiyono & Sutarto, eqs 2 and 3.
    """
    return (
        (q * r * (Iyy - Izz) + moment[0]) / Ixx,
        (p * r * (Izz - Ixx) + moment[1]) / Iyy,
        (p * q * (Ixx - Iyy) + moment[2]) / (Izz + added_yaw_inertia),
    )


def gravity_euler(phi: Any, theta: Any) -> tuple[Any, Any, Any]:
    """Gravity in body axes (m/s^2) from roll and pitch (rad)."""
    return -GRAVITY * sin(theta), GRAVITY * sin(phi) * cos(theta), GRAVITY * cos(phi) * cos(theta)


def euler_rates(phi: Any, theta: Any, p: Any, q: Any, r: Any) -> tuple[Any, Any, Any]:
    """(phi', theta', psi') in rad/s; singular at theta = +-90 deg. Source: Budiyono & Sutarto, eq.
    4.
    """
    turn = q * sin(phi) + r * cos(phi)
    return p + tan(theta) * turn, q * cos(phi) - r * sin(phi), turn / cos(theta)


def body_to_earth(q0: Any, q1: Any, q2: Any, q3: Any) -> tuple[tuple[Any, Any, Any], ...]:
    """Rotation matrix (rows north, east, down) from a unit quaternion, scalar first."""
    return (
        (q0**2 + q1**2 - q2**2 - q3**2, 2 * (q1 * q2 - q0 * q3), 2 * (q1 * q3 + q0 * q2)),
        (2 * (q1 * q2 + q0 * q3), q0**2 - q1**2 + q2**2 - q3**2, 2 * (q2 * q3 - q0 * q1)),
        (2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), q0**2 - q1**2 - q2**2 + q3**2),
    )


def quaternion_rates(
    q0: Any, q1: Any, q2: Any, q3: Any, p: Any, q: Any, r: Any
) -> tuple[Any, Any, Any, Any]:
    """Derivative (1/s) of the scalar-first attitude quaternion: half its product with (0, p, q,
    r).
    """
    return (
        0.5 * (-q1 * p - q2 * q - q3 * r),
        0.5 * (q0 * p + q2 * r - q3 * q),
        0.5 * (q0 * q + q3 * p - q1 * r),
        0.5 * (q0 * r + q1 * q - q2 * p),
    )
