"""Equilibria and exact linear models."""

from __future__ import annotations

import math

import numpy as np
import pytest

import symheli


def test_trim_converges_from_hover_to_20_m_s_with_every_residual_below_1e_9(heli):
    for speed in np.arange(0.0, 20.5, 1.0):
        point = symheli.trim(heli, speed)
        assert np.abs(point.residual.array).max() < 1e-9
        assert not point.on_stops


def test_trimmed_velocity_is_what_was_asked(ideal):
    point = symheli.trim(ideal, 8.0, climb_rate=1.5, sideslip=0.1)
    x = point.x
    assert math.hypot(x["u"], x["v"], x["w"]) == pytest.approx(8.0, rel=1e-12)
    phi, theta = x["phi"], x["theta"]
    climb = x["u"] * math.sin(theta) - (x["v"] * math.sin(phi) + x["w"] * math.cos(phi)) * math.cos(
        theta
    )
    assert climb == pytest.approx(1.5, rel=1e-12)


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
@pytest.mark.parametrize(
    "asked",
    [
        {"turn_rate": 0.3},
        {"climb_rate": -1.5},
        {"sideslip": math.pi / 2},
        {"sideslip": math.pi},
        {"wind": (3, 2, 0)},
    ],
)
def test_turn_descent_sideways_rearward_and_wind_trim(heli, asked):
    assert symheli.trim(heli, 5.0, **asked).success


@pytest.mark.filterwarnings("ignore::symheli.errors.ValidityWarning")
def test_an_impossible_trim_says_why_and_keeps_the_best_point(ideal):
    with pytest.raises(symheli.errors.TrimError, match="du/dt") as caught:
        symheli.trim(ideal, 60.0)
    assert caught.value.result.airspeed == 60.0
    assert not symheli.trim(ideal, 60.0, throw=False).success


@pytest.mark.parametrize(
    "bad", [{"airspeed": -1.0}, {"airspeed": math.nan}, {"airspeed": 2.0, "climb_rate": 3.0}]
)
def test_bad_conditions_are_refused(ideal, bad):
    with pytest.raises(symheli.errors.InputError):
        symheli.trim(ideal, **bad)


def one_sided(f, z, i, h):
    """Second-order one-sided differences of f at z in direction i, forwards and backwards."""
    e = np.zeros(len(z))
    e[i] = h
    return (-3 * f(z) + 4 * f(z + e) - f(z + 2 * e)) / (2 * h), (
        3 * f(z) - 4 * f(z - e) + f(z - 2 * e)
    ) / (2 * h)


@pytest.mark.slow(only=("ideal-0.0", "pi-0.0"))
@pytest.mark.parametrize("speed", [0.0, 0.15, 0.6, 2.0, 5.0, 9.5, 12.0, 19.0])
def test_jacobian_agrees_with_differences_on_each_side_of_a_kink(heli, speed):
    """At a kink the algorithmic derivative must equal one side; elsewhere both. Hover (0) is a kink
    of several limits.
    """
    point = symheli.trim(heli, speed)
    z0 = np.concatenate([point.x.array, point.u.array])
    n, rhs = len(heli.states), heli.compiled("rhs")

    def f(z):
        return np.array(rhs(z[:n], z[n:], np.zeros(3))).ravel()

    A, B, _ = (
        np.array(m) for m in heli.compiled("jacobian")(point.x.array, point.u.array, np.zeros(3))
    )
    J = np.hstack([A, B])
    for i in range(len(z0)):
        forward, backward = one_sided(f, z0, i, 1e-5)
        # rounding 1e-14/h = 1e-9 and truncation h^2 times third derivatives up to 1e4: 1e-5
        # relative to the column
        tolerance = 2e-5 * (1 + np.abs(J[:, i]))
        np.testing.assert_array_less(
            np.minimum(np.abs(J[:, i] - forward), np.abs(J[:, i] - backward)), tolerance
        )


def test_jacobian_is_finite_in_awkward_corners(heli):
    point = symheli.trim(heli, 0.0)
    for change in ({}, {"w": 6.0}, {"u": -8.0}, {"v": 8.0}, {"w": -15.0}):
        x = point.x.array.copy()
        for name, value in change.items():
            x[heli.states.index(name)] = value
        for d_col in (0.0, -0.183, 0.183):
            u = point.u.array.copy()
            u[2] = d_col
            for block in heli.compiled("jacobian")(x, u, np.zeros(3)):
                assert np.all(np.isfinite(np.array(block)))


def test_linear_model_keeps_names_units_and_refuses_a_point_that_is_no_equilibrium(ideal):
    point = symheli.trim(ideal, 5.0)
    lin = symheli.linearize(ideal, point, inputs=["d_lat", "v_w"])
    assert lin.inputs == ("d_lat", "v_w")
    assert [s.unit for s in lin.inputs] == ["rad", "m/s"]
    assert lin.to_control().state_labels == list(map(str, ideal.states))
    with pytest.raises(symheli.errors.InputError, match="equilibrium"):
        symheli.linearize(ideal, symheli.trim(ideal, 5.0, acceleration=2.0))


def test_quaternion_and_euler_forms_agree(heli):
    """The same accelerations from both forms at a random state, heading 270 deg."""
    rng = np.random.default_rng(3)
    n = len(heli.states)
    x = np.concatenate(
        [
            rng.normal(size=3) * 4,
            rng.normal(size=3) * 0.5,
            [0.2, -0.15],
            rng.normal(size=2) * 0.02,
            [165.0, 12.0][: n - 10],
        ]
    )
    u = np.array([0.01, -0.02, 0.09, 0.2])
    phi, theta, psi = x[6], x[7], math.radians(270)
    from scipy.spatial.transform import Rotation

    body_to_earth = Rotation.from_euler("ZYX", [psi, theta, phi])
    qx, qy, qz, qw = body_to_earth.as_quat()
    flight = np.concatenate([x[:6], [qw, qx, qy, qz], [1.0, 2.0, 3.0], x[8:]])
    wind_earth = np.array([2.0, -1.0, 0.5])
    euler = np.array(heli.compiled("rhs")(x, u, body_to_earth.inv().apply(wind_earth))).ravel()
    quaternion = np.array(heli.compiled("flight_rhs")(flight, u, wind_earth)).ravel()
    np.testing.assert_allclose(quaternion[:6], euler[:6], rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(quaternion[13:], euler[8:], rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(quaternion[10:13], body_to_earth.apply(x[:3]), rtol=1e-12)
