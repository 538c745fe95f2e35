"""What must not change: energy, momentum, angular momentum; and what the two attitude forms must
share.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import symheli
from symheli.values.kinematics import GRAVITY

NO_AIR = {"density": 1e-30, "main_rotor.hub_stiffness": 0.0}
"""Without air there is no thrust, and without stiffness the hub passes on no flapping: gravity and
the engine are left.
"""

U = np.array([0.0, 0.0, 0.1, 0.2])


def march(f, x, duration, steps):
    """Classical Runge-Kutta steps of x' = f(x), order 4; nothing is normalised in between."""
    h = duration / steps
    for _ in range(steps):
        k1 = f(x)
        k2 = f(x + h / 2 * k1)
        k3 = f(x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + h * k3))
    return x


def flight(heli, x, duration, steps, u=U):
    evaluate = heli.numeric("flight_rhs")
    return march(lambda z: evaluate(z, u, 0.0)[0], x, duration, steps)


def in_flight(heli, **values):
    """A flight state: level, at the origin, everything else 0 but what is given."""
    x = np.zeros(len(heli.flight_states))
    x[heli.flight_states.index("q0")] = 1.0
    for name, value in values.items():
        x[heli.flight_states.index(name)] = value
    return x


def invariants(heli, x):
    """Energy (J), angular momentum in earth axes (kg m^2/s) and position of a flight state."""
    body = heli.vehicle.values("body")
    inertia = np.array([body["Ixx"], body["Iyy"], body["Izz"]])
    turned = Rotation.from_quat(np.roll(x[6:10], -1))
    energy = (
        0.5 * body["mass"] * x[:3] @ x[:3]
        + 0.5 * inertia @ x[3:6] ** 2
        - body["mass"] * GRAVITY * x[12]
    )
    return energy, turned.apply(inertia * x[3:6]), x[10:13]


def test_tumbling_body_keeps_energy_and_angular_momentum_to_integrator_order(pi):
    """Throttle shut and no air: 2 s of tumbling; every error falls by 2^4 when the step is
    halved.
    """
    heli = pi.with_parameters(NO_AIR)
    start = in_flight(
        heli, u=6.0, v=-2.0, w=1.0, p=3.0, q=-2.0, r=1.0, Om=250.0
    )  # above its command: the governor asks for nothing
    energy, momentum, _ = invariants(heli, start)
    parabola = start[:3] * 2.0 + np.array([0.0, 0.0, 0.5 * GRAVITY * 2.0**2])

    def errors(steps):
        e, h, position = invariants(heli, flight(heli, start, 2.0, steps))
        return np.array(
            [
                abs(e - energy) / energy,
                np.abs(h - momentum).max() / np.linalg.norm(momentum),
                np.abs(position - parabola).max(),
            ]
        )

    coarse, fine = errors(50), errors(100)
    assert np.all(coarse < 1e-2)
    assert np.all(fine > 1e-10)  # above rounding, or there is no order to see
    orders = np.log2(coarse / fine)
    assert np.all((orders > 3.5) & (orders < 5.6)), (
        orders
    )  # energy of a free rigid body gains an order, 5


def test_engine_cannot_change_the_angular_momentum_about_the_shaft(pi):
    """Izz r + I_rot (Om + r) without air, while the engine runs the rotor up: to rounding, as
    Runge-Kutta keeps what is linear. The printed sign of r' in the rotor equation gains what it
    should not.
    """
    body, drive = pi.vehicle.values("body"), pi.vehicle.values("drivetrain")
    drift = {}
    for option in ((), ("rotor_reaction",)):
        heli = symheli.Helicopter.load("xcell60", printed=option).with_parameters(NO_AIR)
        start = in_flight(heli, Om=140.0, om_i=10.0)
        end = flight(heli, start, 3.0, 300)
        rates = heli.flight_states.index("r"), heli.flight_states.index("Om")
        momentum = [
            body["Izz"] * x[rates[0]] + drive["inertia"] * (x[rates[1]] + x[rates[0]])
            for x in (start, end)
        ]
        assert abs(end[rates[1]] - 140.0) > 10  # the rotor did speed up
        drift[option] = abs(momentum[1] - momentum[0]) / momentum[0]
    assert drift[()] < 1e-13
    assert drift["rotor_reaction",] > 0.1


def test_engine_torque_is_internal_in_air_too(pi):
    """Izz r' + I_rot (Om' + r') does not depend on the throttle."""
    point = symheli.trim(pi, 3.0)
    r, Om, om_i = (pi.states.index(name) for name in ("r", "Om", "om_i"))
    momentum, torque = [], []
    for change in (3.0, -3.0):
        x = point.x.array.copy()
        x[om_i] += change
        xdot = pi.numeric("rhs")(x, point.u.array, 0.0)[0]
        momentum.append(0.28 * xdot[r] + 0.095 * (xdot[Om] + xdot[r]))
        torque.append(float(pi.compiled("diagnostics")(x=x, u=point.u.array, wind=0)["Q_e"]))
    assert abs(torque[0] - torque[1]) > 0.5
    assert momentum[0] == pytest.approx(momentum[1], abs=1e-12)


def test_ideal_governor_is_the_limit_of_constant_rotor_speed(ideal, pi):
    """With the engine torque that makes Om' = 0 the 12-state model has the yaw acceleration of the
    10-state one.
    """
    from scipy.optimize import brentq

    point = symheli.trim(ideal, 4.0)
    x, u = point.x.array, point.u.array + np.array([0, 0, 0.01, 0.02])
    r, Om = ideal.states.index("r"), pi.states.index("Om")

    def full(om_i):
        return pi.numeric("rhs")(np.concatenate([x, [167.0, om_i]]), u, 0.0)[0]

    held = full(brentq(lambda om_i: full(om_i)[Om], 1.0, 49.0, xtol=1e-13))
    assert held[r] == pytest.approx(ideal.numeric("rhs")(x, u, 0.0)[0][r], rel=1e-9)


def test_free_fall_in_thin_air(ideal):
    """Without air there is no force but gravity, at any attitude."""
    x = np.zeros(10)
    x[6], x[7] = 0.3, -0.2
    a = ideal.with_parameters({"density": 1e-12}).numeric("rhs")(x, U, 0.0)[0][:3]
    expected = GRAVITY * np.array(
        [math.sin(0.2), math.sin(0.3) * math.cos(0.2), math.cos(0.3) * math.cos(0.2)]
    )
    np.testing.assert_allclose(a, expected, rtol=1e-9)


def test_quaternion_and_euler_forms_fly_the_same_flight_to_integrator_order(heli):
    """1.5 s with a pedal and cyclic step from 6 m/s, between the wake's corners; the gap falls by
    2^4 when the step is halved.
    """
    point = symheli.trim(heli, 6.0)
    u = point.u.array + np.array([0.004, -0.003, 0.002, 0.01])
    turned = Rotation.from_euler("ZYX", [0.0, point.x["theta"], point.x["phi"]])
    start = np.concatenate(
        [point.x.array[:6], np.roll(turned.as_quat(), 1), [0.0, 0.0, -20.0], point.x.array[8:]]
    )

    def gap(steps):
        quaternion = flight(heli, start, 1.5, steps, u)
        euler = march(lambda z: heli.numeric("rhs")(z, u, 0.0)[0], point.x.array, 1.5, steps)
        _, theta, phi = Rotation.from_quat(np.roll(quaternion[6:10], -1)).as_euler("ZYX")
        both = np.concatenate([quaternion[:6], [phi, theta], quaternion[13:]])
        assert np.abs(both[:8] - point.x.array[:8]).max() > 0.1  # it did manoeuvre
        return np.abs(both - euler).max()

    coarse, fine = gap(20), gap(40)
    assert coarse < 1e-2
    assert fine > 1e-12
    assert 3.2 < math.log2(coarse / fine) < 5.5
