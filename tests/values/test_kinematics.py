"""Kinematics of a rigid body for arrays, against the symbolic ones of the helicopter."""

import casadi as ca
import numpy as np
import pytest

from symheli.physics.rigid_body import euler_rates, gravity_euler, rotation, translation
from symheli.values.kinematics import RIGID_BODY, kinematic_jacobian, kinematic_rates

EPS = np.finfo(float).eps


def points(n=200):
    """States (n, 8) of ordinary flight and far from it: inverted, steep, fast."""
    rng = np.random.default_rng(0)
    size = np.array([20.0, 10.0, 10.0, 3.0, 3.0, 3.0, 3.1, 1.4])
    return size * rng.uniform(-1, 1, (n, 8))


def symbolic():
    """Rates and their Jacobian as CasADi functions: a body of unit inertia that nothing pushes."""
    y = ca.SX.sym("y", 8)
    u, v, w, p, q, r, phi, theta = ca.vertsplit(y)
    nothing = (0.0, 0.0, 0.0)
    linear = translation(u, v, w, p, q, r, gravity_euler(phi, theta), nothing, 1.0)
    turning = rotation(p, q, r, nothing, 1.0, 1.0, 1.0)
    rates = ca.vertcat(*linear, *turning, *euler_rates(phi, theta, p, q, r)[:2])
    return ca.Function("rates", [y], [rates]), ca.Function("slope", [y], [ca.jacobian(rates, y)])


def test_rates_are_those_of_the_symbolic_body():
    rates, _ = symbolic()
    y = points()
    expected = rates(y.T).full().T
    # a few products of numbers up to 60, tan up to 6
    np.testing.assert_allclose(kinematic_rates(y), expected, rtol=1e-13, atol=300 * EPS)


def test_the_jacobian_is_the_derivative_of_the_symbolic_body():
    _, slope = symbolic()
    y = points()
    expected = np.array([slope(row).full() for row in y])
    np.testing.assert_allclose(kinematic_jacobian(y), expected, rtol=1e-12, atol=300 * EPS)


def test_shapes_follow_the_states():
    y = points(6).reshape(2, 3, 8)
    assert kinematic_rates(y).shape == (2, 3, 8)
    assert kinematic_jacobian(y).shape == (2, 3, 8, 8)
    np.testing.assert_array_equal(kinematic_jacobian(y)[1, 2], kinematic_jacobian(y[1, 2]))


@pytest.mark.parametrize("seed", range(3))
def test_a_body_that_nothing_pushes_keeps_its_speed_and_gravity_its_direction(seed):
    """V' V/2 = g' V for any rotation, and g in body axes turns as any fixed vector: g' = g x omega
    (transport theorem), g' through phi' and theta'.
    """
    y = points()[seed]
    V, omega = y[:3], y[3:6]
    k = kinematic_rates(y)
    still = np.concatenate([V, omega * 0, y[6:]])
    g = kinematic_rates(np.concatenate([V * 0, omega * 0, y[6:]]))[:3]
    assert abs(V @ (k[:3] - g)) < 1e-12 * 60 * np.linalg.norm(V) ** 2
    turned = kinematic_jacobian(still * (np.arange(8) > 5))[:3, 6:] @ k[6:]
    np.testing.assert_allclose(turned, np.cross(g, omega), atol=1e-12)
    assert len(RIGID_BODY) == len(y)
