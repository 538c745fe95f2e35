"""Point designs against closed forms and printed numbers."""

import control
import numpy as np
import pytest
from design_plants import (
    all_ones,
    first_order,
    he1,
    he5,
    matrices,
    named,
    scherer_gahinet_chilali,
    slicot_sb10fd,
)

from symheli import LinearModel
from synthesis import h2, hinf
from synthesis.designs import mixed_sensitivity, ncfsyn


@pytest.mark.parametrize(
    ("a", "b", "c"), [(0, 3, 2), (1, 2, 0.5), (-1, 1, 1), (5, 1, 1), (0.3, 10, 0.2), (-2, 3, 4)]
)
def test_a_first_order_plant_has_its_optimum_in_closed_form(a, b, c):
    """(-a + sqrt(a^2 + b^2 - q))(-a + sqrt(a^2 + c^2 - q)) = q with q = 1/gamma^2."""
    q = 1 / hinf(*first_order(a, b, c)).optimum ** 2
    left = (-a + np.sqrt(a**2 + b**2 - q)) * (-a + np.sqrt(a**2 + c**2 - q))
    assert left == pytest.approx(q, rel=1e-6)


def test_without_a_pole_the_closed_form_is_a_root_of_squares():
    assert hinf(*first_order(0, 3, 2)).optimum == pytest.approx(np.sqrt(1 / 9 + 1 / 4), rel=1e-8)


@pytest.mark.parametrize(
    ("a", "b", "c", "sentence"),
    [(-0.01, 20, 0.1, "the measurements do not suffice"), (-2, 0.7, 4, "measures all states")],
)
def test_the_weaker_side_decides_where_the_factors_have_no_common_root(a, b, c, sentence):
    """Then one square root vanishes: gamma = 1/sqrt(a^2 + min(b, c)^2)."""
    design = hinf(*first_order(a, b, c))
    assert design.optimum == pytest.approx(1 / np.hypot(a, min(b, c)), rel=1e-8)
    assert sentence in design.limit


def test_scherer_gahinet_chilali():
    """Printed: H2 7.748350599; the H-infinity optimum was computed by two routes."""
    assert h2(*scherer_gahinet_chilali([1, 2])).hinf_norm == pytest.approx(7.748350599, abs=5e-10)
    design = hinf(*scherer_gahinet_chilali([0]))
    assert design.optimum == pytest.approx(9.508085, abs=1e-6)
    assert design.optimum <= design.hinf_norm <= 1.01 * design.optimum * (1 + 1e-6)


def test_slicot_example_with_every_direct_way():
    """The printed controller at gamma 15, as a transfer function: its states are in other
    coordinates.
    """
    model, u, y = slicot_sb10fd()
    assert hinf(model, u, y).optimum == pytest.approx(10.184256, abs=1e-6)
    K = hinf(model, u, y, gamma=15.0).controller
    printed = LinearModel(
        [
            [-2.8043, 14.7367, 4.6658, 8.1596, 0.0848, 2.5290],
            [4.6609, 3.2756, -3.5754, -2.8941, 0.2393, 8.2920],
            [-15.3127, 23.5592, -7.1229, 2.7599, 5.9775, -2.0285],
            [-22.0691, 16.4758, 12.5523, -16.3602, 4.4300, -3.3168],
            [30.6789, -3.9026, -1.3868, 26.2357, -8.8267, 10.4860],
            [-5.7429, 0.0577, 10.8216, -11.2275, 1.5074, -10.7244],
        ],
        [
            [-0.1581, -0.0793],
            [-0.9237, -0.5718],
            [0.7984, 0.6627],
            [0.1145, 0.1496],
            [-0.6743, -0.2376],
            [0.0196, -0.7598],
        ],
        [
            [-0.2480, -0.1713, -0.0880, 0.1534, 0.5016, -0.0730],
            [2.8810, -0.3658, 1.3007, 0.3945, 1.2244, 2.5690],
        ],
        [[0.0554, 0.1334], [-0.3195, 0.0333]],
        K.states,
        K.inputs,
        K.outputs,
    )
    omega = np.geomspace(0.1, 100, 30)
    ours, theirs = K.frequency_response(omega), printed.frequency_response(omega)
    assert np.abs(ours - theirs).max() < 3e-4 * np.abs(ours).max()  # four printed decimals


def test_helicopters_of_compleib():
    """Optima over all controllers, computed by two routes. That of HE1 is an infimum, its
    measurement has no noise: it is approached in proportion to the noise that is put there.
    """
    assert hinf(*he5()).optimum == pytest.approx(1.76504, abs=5e-6)
    far, near = (hinf(*he1(noise)).optimum for noise in (1e-4, 1e-5))
    assert near < far
    assert near - (far - near) / 9 == pytest.approx(0.07362, abs=5e-6)
    assert "y1 has no noise" in hinf(*he1(0.0)).reasons[0]


def test_a_controller_that_can_be_written_down():
    """Where z = x + u, the estimate cancels x: K = (-3, 1, -1, 0) for every level and for H2."""
    for design in (h2(*all_ones()), hinf(*all_ones(), gamma=1e3), hinf(*all_ones(), gamma=1e6)):
        K = [float(M[0, 0]) for M in matrices(design.controller)]
        assert pytest.approx([-3, 1, -1, 0], abs=1e-12) == K
    nothing = hinf(*all_ones())
    assert nothing.optimum == 0.0
    assert "arbitrarily small" in nothing.reasons[0]


def test_skogestad_postlethwaite_mixed_sensitivity():
    """Example 3.8: printed 2.80, 2.92, 6.73."""
    A = np.kron(np.eye(2), [[0.0, 1.0], [-5.0, -6.0]])
    # observer form of 5 (1, 1; 1 + 2s, 2)/(s^2 + 6s + 5)
    B = np.array([[0, 0], [5, 5], [10, 0], [5 - 60, 10]])
    C = np.kron(np.eye(2), [[1.0, 0.0]])
    G = LinearModel(A, B, C, np.zeros((2, 2)), list("abcd"), ["u1", "u2"], ["y1", "y2"])
    s = 0.7j
    expected = np.array([[1, 1], [1 + 2 * s, 2]]) / ((0.2 * s + 1) * (s + 1))
    np.testing.assert_allclose(G.frequency_response([0.7])[0], expected, rtol=1e-12)
    s = control.tf("s")
    for bandwidths, optimum in (
        ((0.25, 0.25), 2.795484),
        ((0.25, 25), 2.916176),
        ((25, 0.25), 6.722849),
    ):
        weight = [(s / 1.5 + wb) / (s + 1e-4 * wb) for wb in bandwidths]
        design = mixed_sensitivity(G, weight, 1.0)
        assert design.optimum == pytest.approx(optimum, abs=1e-6)
        assert design.hinf_norm <= 1.01 * optimum * (1 + 1e-6)


def test_mcfarlane_glover_loop_shaping_by_two_routes():
    """Printed 2.34; the four-block problem solved by the general route has the same optimum."""
    s = control.tf("s")
    G, W = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2), (s + 2) / (s + 1e-6)
    design = ncfsyn(G, W)
    assert design.optimum == pytest.approx(2.338767, abs=1e-6)
    shaped = control.ss(G * W)
    A, B, C = shaped.A, shaped.B, shaped.C
    none = np.zeros((len(A), 1))
    general = hinf(
        *named(
            A,
            np.hstack([none, B, B]),
            np.vstack([none.T, C, C]),
            [[0, 0, 1], [1, 0, 0], [1, 0, 0]],
            1,
            1,
        )
    )
    assert general.optimum == pytest.approx(design.optimum, rel=1e-7)


def test_a_plant_without_states_has_a_static_controller():
    """z = (w + u, u), y = w + n: the least gain of [1 + k, k; k, k], found by trying every k."""
    model = LinearModel.gain([[1, 0, 1], [0, 0, 1], [1, 1, 0]], ["w", "n", "u"], ["z", "z_u", "y"])
    design = hinf(model, ["u"], ["y"])
    gains = [np.linalg.norm([[1 + k, k], [k, k]], 2) for k in np.linspace(-1, 0, 10001)]
    least = min(gains)
    assert design.optimum == pytest.approx(least, rel=1e-4)  # the spacing
    assert design.controller.A.shape == (0, 0)
