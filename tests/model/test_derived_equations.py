"""The equations of motion against their derivation by Kane's method, at random states, in both
attitude forms.
"""

from __future__ import annotations

import numpy as np
import pytest
from derived_equations import derived
from scipy.spatial.transform import Rotation

import symheli
from symheli.physics.rigid_body import (
    body_to_earth,
    euler_rates,
    gravity_euler,
    quaternion_rates,
    rotation,
    translation,
)
from symheli.values.kinematics import GRAVITY

DRAWS = 20


def random_body(rng):
    """Speeds u v w p q r Om, angles psi theta phi, force, moment, mass and inertia of some body."""
    speeds = np.concatenate(
        [rng.normal(size=3) * 8, rng.normal(size=3), [167 * rng.uniform(0.8, 1.2)]]
    )
    angles = np.array([rng.uniform(-3, 3), rng.uniform(-1.2, 1.2), rng.uniform(-3, 3)])
    return (
        speeds,
        angles,
        rng.normal(size=3) * 80,
        rng.normal(size=3) * 10,
        rng.uniform(1, 10),
        rng.uniform(0.1, 0.5, 3),
    )


def close(got, expected, scale):
    """To 1e-12 of the largest term, some thousand roundings."""
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12 * scale)


@pytest.mark.slow
def test_rigid_body_functions_are_the_derived_equations():
    """A rotor at rest in space (Om = -r) carries no angular momentum: what is left is the rigid
    body.
    """
    accelerations, kinematics = derived("euler")
    rng = np.random.default_rng(1)
    for _ in range(DRAWS):
        speeds, angles, force, moment, mass, inertia = random_body(rng)
        speeds[6] = -speeds[5]
        _, theta, phi = angles
        coordinates = [0.0, 0.0, 0.0, *angles, 0.0]
        given = [*force, *moment, 0.0, 0.0, GRAVITY, mass, *inertia, 0.1]
        got = accelerations(coordinates, speeds, given)
        linear = translation(*speeds[:6], gravity_euler(phi, theta), tuple(force), mass)
        angular = rotation(*speeds[3:6], tuple(moment), *inertia)
        scale = np.abs(got).max()
        close(np.array([*linear, *angular], float), got[:6], scale)
        rates = kinematics(coordinates, speeds, given)
        close(
            np.array(euler_rates(phi, theta, *speeds[3:6]), float)[::-1],
            rates[3:],
            1.0 + np.abs(rates).max(),
        )


@pytest.mark.slow
def test_quaternion_kinematics_are_the_derived_ones():
    _, kinematics = derived("quaternion")
    rng = np.random.default_rng(2)
    for _ in range(DRAWS):
        speeds, *_, mass, inertia = random_body(rng)
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        rates = kinematics(
            [0.0, 0.0, 0.0, *quaternion, 0.0], speeds, [0.0] * 9 + [mass, *inertia, 0.1]
        )
        close(np.array(quaternion_rates(*quaternion, *speeds[3:6])), rates[3:], 1.0)
        close(np.array(body_to_earth(*quaternion)) @ speeds[:3], rates[:3], np.abs(speeds).max())


@pytest.mark.slow
def test_rotor_and_body_share_yaw_and_differ_from_the_model_by_the_gyroscope_alone(pi):
    """Yaw and rotor speed as derived, -r' in Om' included. In roll and pitch a rigid rotor would
    add its gyroscopic moment I_rot (Om + r) (-q, p); the model, as its source, has the moments of
    the flapping hub there, and this must be all that differs.
    """
    check_right_hand_side(pi, "euler")
    check_right_hand_side(pi, "quaternion")


def check_right_hand_side(heli, attitude):
    accelerations, kinematics = derived(attitude)
    body, drive = heli.vehicle.values("body"), heli.vehicle.values("drivetrain")
    gear = heli.vehicle.values("tail_rotor")["gear_ratio"]
    names, evaluate = heli.diagnostics.name_out(), heli.diagnostics
    rng = np.random.default_rng(3)
    for _ in range(DRAWS):
        speeds, angles, *_ = random_body(rng)
        own = np.array([*(0.05 * rng.normal(size=2)), speeds[6], rng.uniform(5, 30)])
        u, wind = rng.uniform(-0.1, 0.15, 4), rng.normal(size=3)
        turned = Rotation.from_euler("ZYX", angles)
        euler = np.concatenate([speeds[:6], [angles[2], angles[1]], own])
        d = dict(
            zip(
                names, (float(v) for v in evaluate(euler, u, turned.inv().apply(wind))), strict=True
            )
        )
        air = d["Q_mr"] + gear * d["Q_tr"]
        given = [
            *(d[n] for n in "XYZLM"),
            d["N"] + d["Q_e"],
            d["Q_e"],
            air,
            GRAVITY,
            *body.values(),
            drive["inertia"],
        ]
        quaternion = np.roll(turned.as_quat(), 1)
        coordinates = [1.0, 2.0, 3.0, *(angles if attitude == "euler" else quaternion), 0.5]
        expected = accelerations(coordinates, speeds, given)
        p, q, r, Om = speeds[3:]
        gyroscope = drive["inertia"] * (Om + r)
        expected[3] += gyroscope * q / body["Ixx"]
        expected[4] -= gyroscope * p / body["Iyy"]
        rates = kinematics(coordinates, speeds, given)
        scale = np.abs(expected).max()
        if attitude == "euler":
            got = np.array(heli.rhs(euler, u, turned.inv().apply(wind))).ravel()
            close(got[[0, 1, 2, 3, 4, 5, 10]], expected, scale)
            close(got[[7, 6]], rates[4:], 1.0 + np.abs(rates).max())
        else:
            flight = np.concatenate([speeds[:6], quaternion, [1.0, 2.0, 3.0], own])
            got = np.array(heli.flight_rhs(flight, u, wind)).ravel()
            close(got[[0, 1, 2, 3, 4, 5, 15]], expected, scale)
            close(got[6:10], rates[3:], 1.0)
            close(got[10:13], rates[:3], np.abs(speeds).max())


def test_ideal_governor_is_the_derived_system_whose_engine_holds_the_speed(ideal):
    """With Q_e = Q_mr + n_tr Q_tr + I_rot r' the derived rotor keeps its speed, and the derived
    body yaws as the model.
    """
    accelerations, _ = derived("euler")
    body, drive = ideal.vehicle.values("body"), ideal.vehicle.values("drivetrain")
    rng = np.random.default_rng(4)
    for _ in range(DRAWS):
        speeds, angles, *_ = random_body(rng)
        speeds[6] = drive["nominal_speed"]
        x = np.concatenate([speeds[:6], [angles[2], angles[1]], 0.05 * rng.normal(size=2)])
        u = rng.uniform(-0.1, 0.15, 4)
        d = dict(
            zip(
                ideal.diagnostics.name_out(),
                (float(v) for v in ideal.diagnostics(x, u, 0)),
                strict=True,
            )
        )
        yaw = float(ideal.rhs(x, u, 0)[5])
        air = d["Q_mr"] + ideal.vehicle.values("tail_rotor")["gear_ratio"] * d["Q_tr"]
        given = [
            *(d[n] for n in "XYZLM"),
            d["N"] + d["Q_e"],
            d["Q_e"],
            air,
            GRAVITY,
            *body.values(),
            drive["inertia"],
        ]
        got = accelerations([0.0, 0.0, 0.0, *angles, 0.0], speeds, given)
        close(got[5], yaw, np.abs(got).max())
        assert d["N"] == pytest.approx(
            body["Izz"] * yaw - (body["Ixx"] - body["Iyy"]) * speeds[3] * speeds[4],
            rel=1e-10,
            abs=1e-9,
        )
        assert abs(got[6]) < 1e-12 * np.abs(got).max() * body["Izz"] / drive["inertia"] * 10  # held


def test_printed_rotor_reaction_contradicts_the_derivation():
    printed = symheli.Helicopter.load("xcell60", printed=["rotor_reaction"])
    with pytest.raises(AssertionError, match="Mismatch"):
        check_right_hand_side(printed, "euler")
