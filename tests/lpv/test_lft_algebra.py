"""Connections of LFTs are the connections of their frozen models, with names and units kept."""

import control
import numpy as np
import pytest
from families import random_lpv

from symheli import LFT, LinearModel, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import append, connect, feedback, parallel, series
from symheli.values import Signal

OMEGA = np.array([0.05, 0.7, 9.0])


def lft(seed, nu=2, ny=2, name="airspeed"):
    return (
        random_lpv(2, nx=3, nu=nu, ny=ny, seed=seed, scheduling=Scheduling(name, "m/s", 0.0, 13.0))[
            0
        ]
        .to_lft()
        .reduce()
    )


def responses(system, **p):
    return system.at(**p).frequency_response(OMEGA)


ONE, TWO = {"airspeed": 4.2}, {"airspeed": 4.2, "other": 11.0}


def test_series_parallel_and_feedback_are_those_of_the_frozen_models():
    a, b = lft(0), lft(1, name="other")
    G, K = responses(a, airspeed=4.2), responses(b, other=11.0)
    np.testing.assert_allclose(responses(series(a, b), **TWO), K @ G, rtol=1e-9)
    np.testing.assert_allclose(responses(parallel(a, b), **TWO), G + K, rtol=1e-9)
    np.testing.assert_allclose(
        responses(feedback(a, b, sign=+1), **TWO), np.linalg.solve(np.eye(2) - G @ K, G), rtol=1e-8
    )


def test_feedback_agrees_with_python_control():
    a, b = lft(0), lft(1)
    loop = control.feedback(a.at(4.2).to_control(), b.at(4.2).to_control(), sign=1)
    expected = np.moveaxis(loop(1j * OMEGA), -1, 0)
    np.testing.assert_allclose(responses(feedback(a, b, sign=+1), **ONE), expected, rtol=1e-8)


def test_the_star_product_closes_both_ways():
    # upper (u1, r -> y1, s), lower (s, d -> r, e)
    upper, lower = lft(2), lft(3, name="other")
    M, N = responses(upper, airspeed=4.2), responses(lower, other=11.0)
    star = responses(upper.star(lower, outputs=1, inputs=1), **TWO)
    for k in range(len(OMEGA)):
        # r = N11 s + N12 d, s = M21 u + M22 r
        s_u, s_d = (
            M[k, 1, 0] / (1 - M[k, 1, 1] * N[k, 0, 0]),
            M[k, 1, 1] * N[k, 0, 1] / (1 - M[k, 1, 1] * N[k, 0, 0]),
        )
        r_u, r_d = N[k, 0, 0] * s_u, N[k, 0, 0] * s_d + N[k, 0, 1]
        expected = [
            [M[k, 0, 0] + M[k, 0, 1] * r_u, M[k, 0, 1] * r_d],
            [N[k, 1, 0] * s_u, N[k, 1, 1] + N[k, 1, 0] * s_d],
        ]
        np.testing.assert_allclose(star[k], expected, rtol=1e-8)


def test_gains_by_name_are_those_of_the_polynomial_model():
    lpv, _ = random_lpv(2, nx=2, nu=1, ny=1)
    constant = LinearModel(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[0.3]], (), ("e",), ("c",)
    )
    by_gain, by_system = (
        lpv.to_lft().feedback({("u1", "y1"): 0.3}),
        feedback(lpv.to_lft(), constant, sign=+1),
    )
    np.testing.assert_allclose(responses(by_gain, **ONE), responses(by_system, **ONE), rtol=1e-10)


def test_connection_by_name_closes_a_loop_and_keeps_names_and_units():
    plant = LinearModel(
        [[-1.0]], [[2.0]], [[1.0]], [[0.0]], ("v",), (Signal("force", "N"),), ("v",)
    )
    drag = LFT.parameter(Scheduling("damping", "kg/s", 0.5, 2.0), "v", "brake")
    loop = connect(
        plant,
        drag,
        inputs=["push"],
        outputs=["v", "brake"],
        sums={"force": {"push": 1.0, "brake": -1.0}},
    )
    assert (loop.states, loop.inputs, loop.outputs) == (("v",), ("push",), ("v", "brake"))
    # v' = -v + 2 (push - damping v)
    assert loop.at(1.5).poles()[0] == pytest.approx(-4.0)
    assert loop.outputs[0].unit == "m/s"
    direct = connect(plant, inputs=["force"], outputs=["v"])
    assert direct.inputs[0].unit == "N"


def test_systems_side_by_side_share_a_parameter_and_number_repeated_names():
    both = append(lft(0), lft(1), lft(2, name="other"))
    assert [b.scheduling.name for b in both.blocks] == ["airspeed", "other"]
    assert both.sizes[0] == lft(0).order + lft(1).order
    assert both.states[3] == "x1_2"
    G = responses(both, **TWO)
    np.testing.assert_allclose(G[:, 2:4, 2:4], responses(lft(1), **ONE), rtol=1e-9)
    assert not np.any(G[:, :2, 2:])


def test_selected_channels_keep_their_responses():
    a = lft(0)
    np.testing.assert_allclose(
        responses(a.select(inputs=["u2"], outputs=["y2", "y1"]), **ONE),
        responses(a, **ONE)[:, ::-1, 1:],
        rtol=1e-12,
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: series(lft(0), lft(1, nu=1)), "as many inputs"),
        (lambda: parallel(lft(0), lft(1, ny=1)), "equal numbers"),
        (lambda: feedback(lft(0), lft(1, nu=1), sign=+1), "controller with 2 input"),
        (lambda: append(lft(0), lft(1).discretize(0.1)), "one sample period"),
        (
            lambda: append(lft(0), lft(1).with_scheduling(Scheduling("airspeed", "m/s", 0.0, 9.0))),
            "different ranges",
        ),
        (lambda: append(), "at least one"),
        (lambda: connect(lft(0), inputs=["u1"], outputs=["y1"]), "nothing feeds the input u2"),
        (
            lambda: connect(lft(0), lft(1), inputs=["u1", "u2"], outputs=["y1"]),
            "several systems have an output called y1, y2",
        ),
        (lambda: lft(0).star(lft(1), outputs=3), "star product"),
    ],
)
def test_connections_that_do_not_fit_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_names_and_units_are_checked():
    plant = LinearModel([[-1.0]], [[2.0]], [[1.0]], [[0.0]], ("v",), (Signal("p", "m/s"),), ("v",))
    roll = LinearModel([[-1.0]], [[2.0]], [[1.0]], [[0.0]], ("p",), ("v",), ("p",))
    with pytest.raises(InputError, match="p is in m/s on one side and in rad/s"):
        connect(plant, roll, inputs=[], outputs=["v"])
    with pytest.raises(UnknownNameError, match="did you mean 'y1'"):
        connect(lft(0), inputs=["u1", "u2"], outputs=["y11"])
    with pytest.raises(UnknownNameError, match="input 'w'"):
        connect(lft(0), inputs=["u1", "u2"], outputs=["y1"], sums={"w": {"y1": 1.0}})
    with pytest.raises(UnknownNameError, match="signal or parameter"):
        lft(0).rename({"nope": "yes"})


def test_an_algebraic_loop_without_solution_is_refused():
    one = LinearModel(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]], (), ("e",), ("y",)
    )
    with pytest.raises(InputError, match="not well posed"):
        connect(one, inputs=["r"], outputs=["y"], sums={"e": {"r": 1.0, "y": 1.0}})
