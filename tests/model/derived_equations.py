"""Equations of motion derived by Kane's method in SymPy: a rigid body with a rotor that spins about
its z axis.

Nothing here comes from the model: frames, velocities and the principle of virtual power only.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy
from sympy.physics.mechanics import (
    KanesMethod,
    Point,
    ReferenceFrame,
    RigidBody,
    dynamicsymbols,
    inertia,
)

SPEEDS = "u v w p q r Om"
"""Velocity of the c.g. and angular velocity in body axes; speed of the rotor relative to the
body.
"""

GIVEN = "X Y Z L M N Q_e Q_a g m Ixx Iyy Izz I_rot"
"""Force and moment on the body, torque of the engine on the rotor (its reaction on the body) and of
the air against the rotor, gravity, mass, moments of inertia.
"""


@cache
def derived(attitude):
    """(accelerations, kinematics): functions of (coordinates, speeds, given).

    attitude: "euler" (psi theta phi, yaw pitch roll) or "quaternion" (scalar first). Coordinates:
    position north east down, attitude, rotor angle. `accelerations` gives u' v' w' p' q' r' Om';
    `kinematics` the derivatives of position and attitude.
    """
    given = sympy.symbols(GIVEN)
    X, Y, Z, L, M, N, Q_e, Q_a, g, m, Ixx, Iyy, Izz, I_rot = given
    speeds = dynamicsymbols(SPEEDS)
    u, v, w, p, q, r, Om = speeds
    position, angle = dynamicsymbols("x y z"), dynamicsymbols("chi")
    earth, body, rotor = ReferenceFrame("E"), ReferenceFrame("B"), ReferenceFrame("R")
    if attitude == "euler":
        turns = dynamicsymbols("psi theta phi")
        body.orient_body_fixed(earth, turns, "ZYX")
    else:
        turns = dynamicsymbols("q0 q1 q2 q3")
        body.orient_quaternion(earth, turns)
    rate = body.ang_vel_in(earth)
    turning = [rate.dot(axis) - speed for axis, speed in zip(body, (p, q, r), strict=True)]
    if attitude == "quaternion":
        turning.append(sum(a * a.diff() for a in turns))  # unit length
    velocity = u * body.x + v * body.y + w * body.z
    moving = [
        velocity.dot(axis) - coordinate.diff()
        for axis, coordinate in zip(earth, position, strict=True)
    ]
    # the angular velocities are given by the speeds themselves, so that no attitude rate is left in
    # the dynamics
    body.set_ang_vel(earth, p * body.x + q * body.y + r * body.z)
    rotor.orient_axis(body, body.z, angle)
    rotor.set_ang_vel(body, Om * body.z)
    centre = Point("G")
    centre.set_vel(earth, velocity)
    whole = RigidBody("body", centre, body, m, (inertia(body, Ixx, Iyy, Izz), centre))
    spinning = RigidBody("rotor", centre, rotor, 0, (inertia(rotor, 0, 0, I_rot), centre))
    loads = [
        (centre, X * body.x + Y * body.y + Z * body.z + m * g * earth.z),
        (body, L * body.x + M * body.y + (N - Q_e) * body.z),
        (rotor, (Q_e - Q_a) * body.z),
    ]
    coordinates = [*position, *turns, angle]
    kane = KanesMethod(
        earth, q_ind=coordinates, u_ind=speeds, kd_eqs=[*moving, *turning, angle.diff() - Om]
    )
    kane.kanes_equations([whole, spinning], loads)
    rates = kane.kindiffdict()
    arguments = [coordinates, speeds, given]
    balance = sympy.lambdify(arguments, [kane.mass_matrix, kane.forcing], cse=True)
    kinematics = sympy.lambdify(arguments, [rates[c.diff()] for c in (*position, *turns)], cse=True)
    return lambda *values: np.linalg.solve(*balance(*values)).ravel(), lambda *values: np.array(
        kinematics(*values)
    )
