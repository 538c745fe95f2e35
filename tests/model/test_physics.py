"""Physics that needs no oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest

import symheli
from symheli.rigid_body import GRAVITY, rotation


def test_torque_free_body_keeps_energy_and_angular_momentum_to_integrator_order():
    inertia = np.array([0.18, 0.34, 0.28])

    def spin(w, steps, T=2.0):
        h = T / steps
        f = lambda w: np.array(rotation(*w, (0.0, 0.0, 0.0), *inertia))  # noqa: E731
        for _ in range(steps):
            k1 = f(w)
            k2 = f(w + h / 2 * k1)
            k3 = f(w + h / 2 * k2)
            w = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(w + h * k3))
        return w

    w0 = np.array([3.0, -2.0, 1.0])

    def drift(steps):
        w = spin(w0, steps)
        return abs(inertia @ w**2 - inertia @ w0**2), abs(np.linalg.norm(inertia * w) - np.linalg.norm(inertia * w0))

    coarse, fine = drift(100), drift(200)
    for a, b in zip(coarse, fine, strict=True):
        assert math.log2(a / b) > 3.5  # fourth order or better


def test_body_and_rotor_keep_yaw_angular_momentum(pi):
    """Izz r' + I_rot (Om' + r') equals the external yaw moment alone: the engine torque is internal."""
    x = symheli.trim(pi, 3.0).x.array.copy()
    x[pi.states.index("om_i")] += 3.0  # unbalanced engine torque
    u = symheli.trim(pi, 3.0).u.array
    xdot = np.array(pi.compiled("rhs")(x, u, np.zeros(3))).ravel()
    d = pi.compiled("diagnostics")(x=x, u=u, wind=0)
    r, Om = pi.states.index("r"), pi.states.index("Om")
    changed = x.copy()
    changed[pi.states.index("om_i")] -= 6.0
    xdot2 = np.array(pi.compiled("rhs")(changed, u, np.zeros(3))).ravel()
    d2 = pi.compiled("diagnostics")(x=changed, u=u, wind=0)
    assert abs(float(d["Q_e"]) - float(d2["Q_e"])) > 0.5
    momentum = [0.28 * f[r] + 0.095 * (f[Om] + f[r]) for f in (xdot, xdot2)]
    assert momentum[0] == pytest.approx(momentum[1], abs=1e-12)


def test_ideal_governor_is_the_limit_of_constant_rotor_speed(ideal, pi):
    """With the engine torque that makes Om' = 0 the 12-state model has the yaw acceleration of the 10-state one."""
    from scipy.optimize import brentq

    x = symheli.trim(ideal, 4.0).x.array.copy()
    u = symheli.trim(ideal, 4.0).u.array + np.array([0, 0, 0.01, 0.02])
    r = ideal.states.index("r")

    def full(om_i):
        return np.array(pi.compiled("rhs")(np.concatenate([x, [167.0, om_i]]), u, np.zeros(3))).ravel()

    held = full(brentq(lambda om_i: full(om_i)[pi.states.index("Om")], 1.0, 49.0, xtol=1e-13))
    assert held[r] == pytest.approx(float(ideal.compiled("rhs")(x, u, np.zeros(3))[r]), rel=1e-9)


def test_hovering_rotor_looks_the_same_after_a_turn_about_its_shaft():
    """Translation in direction chi tilts the disc by the same angle, away from the motion."""
    from types import SimpleNamespace

    from symheli import inflow
    from symheli.components import Flow, Motion
    from symheli.components.main_rotor import evaluate
    from symheli.vehicle import load_vehicle

    par = SimpleNamespace(**load_vehicle("xcell60").values("main_rotor"), printed=frozenset(), smoothing=0.0)

    def flapping_rates(chi, speed=0.01):
        motion = Motion(speed * math.cos(chi), speed * math.sin(chi), 0.0, 0.0, 0.0, 0.0, 167.0, 1.225)
        effect = evaluate(par, motion, {"d_col": 0.0985, "d_lat": 0.0, "d_lon": 0.0}, {"a1": 0.0, "b1": 0.0}, Flow(inflow.solve))
        return np.array([float(effect.rates["a1"]), float(effect.rates["b1"])])

    forward = flapping_rates(0.0)
    for chi in np.linspace(0, 2 * np.pi, 9):
        # a1 > 0 tilts the thrust aft (X = -T a1), b1 > 0 to the right (Y = T b1): the disc leans against the motion
        np.testing.assert_allclose(flapping_rates(chi), forward[0] * np.array([math.cos(chi), -math.sin(chi)]), atol=1e-12)


def test_main_rotor_is_mirror_symmetric():
    """Mirroring v, p, r, d_lat mirrors Y, L, b1' and leaves X, Z, M, a1'."""
    from types import SimpleNamespace

    from symheli import inflow
    from symheli.components import Flow, Motion
    from symheli.components.main_rotor import evaluate
    from symheli.vehicle import load_vehicle

    par = SimpleNamespace(**load_vehicle("xcell60").values("main_rotor"), printed=frozenset(), smoothing=0.0)

    def effect(side):
        motion = Motion(6.0, side * 1.5, 0.4, side * 0.3, 0.2, side * 0.1, 167.0, 1.225)
        return evaluate(
            par, motion, {"d_col": 0.09, "d_lat": side * 0.02, "d_lon": 0.01}, {"a1": 0.02, "b1": side * 0.03}, Flow(inflow.solve)
        )

    right, left = effect(1.0), effect(-1.0)
    np.testing.assert_allclose(np.array(right.force, float) * [1, -1, 1], np.array(left.force, float), rtol=1e-13)
    np.testing.assert_allclose(np.array(right.moment, float) * [-1, 1, -1], np.array(left.moment, float), rtol=1e-13)
    assert float(right.rates["b1"]) == pytest.approx(-float(left.rates["b1"]))
    assert float(right.rates["a1"]) == pytest.approx(float(left.rates["a1"]))


def test_free_fall_in_thin_air(tmp_path):
    """Without air there is no force but gravity, at any attitude."""
    heli = symheli.Helicopter.load("xcell60", governor="ideal", density=1e-12)
    x = np.zeros(10)
    x[6], x[7] = 0.3, -0.2
    a = np.array(heli.rhs(x, [0, 0, 0.1, 0.2], np.zeros(3))).ravel()[:3]
    np.testing.assert_allclose(
        a, GRAVITY * np.array([math.sin(0.2), math.sin(0.3) * math.cos(0.2), math.cos(0.3) * math.cos(0.2)]), rtol=1e-9
    )


def test_decided_signs_push_the_right_way_and_the_printed_forms_are_options(ideal):
    """Each printed option changes the equation it names; the decided ones stabilise sideways motion and push the fuselage down."""
    x = symheli.trim(ideal, 0.0).x.array.copy()
    u = symheli.trim(ideal, 0.0).u.array
    b1, w = ideal.states.index("b1"), ideal.states.index("w")
    x[1] = 1.0
    for option, row in (("lateral_flapping", b1), ("fuselage_downwash", w)):
        printed = symheli.Helicopter.load("xcell60", governor="ideal", printed=[option])
        decided_value, printed_value = (float(h.rhs(x, u, np.zeros(3))[row]) for h in (ideal, printed))
        assert decided_value != pytest.approx(printed_value)
    assert float(ideal.rhs(x, u, np.zeros(3))[b1]) < 0  # sideslip to the right tilts the disc left
    with pytest.raises(symheli.UnknownNameError, match="lateral_flapping"):
        symheli.Helicopter.load("xcell60", printed=["lateral_flaping"])


def test_compiled_and_interpreted_functions_agree(heli):
    point = symheli.trim(heli, 7.0)
    x, u = point.x.array + 0.01, point.u.array
    np.testing.assert_allclose(
        np.array(heli.compiled("rhs")(x, u, np.zeros(3))), np.array(heli.rhs(x, u, np.zeros(3))), rtol=1e-13, atol=1e-13
    )  # same operations in the same order without contraction: rounding only
