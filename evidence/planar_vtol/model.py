"""Equations of the planar VTOL: with velocities in body axes, as published, and over ground."""

from __future__ import annotations

import casadi
import numpy as np

GRAVITY, ARM, MASS, INERTIA = 9.81, 0.25, 0.486, 0.00383
"""m/s^2, m, kg, kg m^2."""
STATES, INPUTS = ("px", "pz", "phi", "vx", "vz", "phi'"), ("u1", "u2")
LIMITS = {"phi": np.pi / 3, "vx": 2.0, "vz": 1.0, "phi'": np.pi / 3, "w": 1.0}
"""Of the published box: rad, m/s, m/s, rad/s, m/s^2."""


def published() -> casadi.Function:
    """(x, u, w) -> dx/dt with velocities in the body's axes; w: acceleration along the ground."""
    x, u, w = casadi.SX.sym("x", 6), casadi.SX.sym("u", 2), casadi.SX.sym("w", 1)
    _, _, phi, vx, vz, turn = casadi.vertsplit(x)
    s, c = casadi.sin(phi), casadi.cos(phi)
    rate = casadi.vertcat(
        vx * c - vz * s,
        vx * s + vz * c,
        turn,
        turn * vz - GRAVITY * s + c * w,
        -turn * vx - GRAVITY * c - s * w + (u[0] + u[1]) / MASS,
        (u[0] - u[1]) * ARM / INERTIA,
    )
    return casadi.Function("planar_vtol_body", [x, u, w], [rate])


def over_ground() -> casadi.Function:
    """The same motion with velocities over ground: the thrust turns, and nothing else couples."""
    x, u, w = casadi.SX.sym("x", 6), casadi.SX.sym("u", 2), casadi.SX.sym("w", 1)
    _, _, phi, vx, vz, turn = casadi.vertsplit(x)
    thrust = (u[0] + u[1]) / MASS
    rate = casadi.vertcat(
        vx,
        vz,
        turn,
        -thrust * casadi.sin(phi) + w,
        thrust * casadi.cos(phi) - GRAVITY,
        (u[0] - u[1]) * ARM / INERTIA,
    )
    return casadi.Function("planar_vtol", [x, u, w], [rate])
