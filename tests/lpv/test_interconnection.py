"""Systems of any kinds are connected exactly; the result is of the most general kind among them."""

from dataclasses import replace

import control
import numpy as np
import pytest
from families import SPEED, random_lpv

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv import CubicSpline, append, connect, feedback, parallel, series
from symheli.lpv.tools import lower_feedback
from symheli.values import Signal
from synthesis import hinf

OMEGA = np.array([0.05, 0.7, 9.0])
NODES = (0.0, 3.0, 5.0, 9.0, 13.0)


def linear(seed=0, nu=2, ny=2):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3, 3)) - 3 * np.eye(3)
    sizes = (A, rng.normal(size=(3, nu)), rng.normal(size=(ny, 3)), rng.normal(size=(ny, nu)))
    names = ([f"{name}{i}" for i in range(n)] for name, n in (("x", 3), ("u", nu), ("y", ny)))
    return LinearModel(*sizes, *names)


def on_a_spline(seed=0):
    """Through models whose entries are no polynomials of p, without feedthrough."""
    rng = np.random.default_rng(seed)
    basis = CubicSpline(NODES)
    shapes = ((3, 3), (3, 2), (2, 3))
    A, B, C = (rng.normal(size=(basis.size, *shape)) for shape in shapes)
    A -= 9 * np.multiply.outer(basis.constant(), np.eye(3))
    names = ([f"{name}{i}" for i in range(n)] for name, n in (("x", 3), ("u", 2), ("y", 2)))
    return LPVStateSpace(basis, A, B, C, np.zeros((basis.size, 2, 2)), SPEED, *names)


def positive(plant, controller):
    """The positive loop, as one of the connections that take two systems."""
    return feedback(plant, controller, sign=+1)


def response(model, p=4.2):
    at = model if isinstance(model, LinearModel) else model.at(p)
    return at.frequency_response(OMEGA)


def joined(G, K):
    """What each connection makes of two frozen models."""
    zero = np.zeros_like(G)
    return {
        series: K @ G,
        parallel: G + K,
        positive: np.linalg.solve(np.eye(2) - G @ K, G),
        append: np.block([[G, zero], [zero, K]]),
    }


@pytest.mark.parametrize("join", [series, parallel, positive, append])
@pytest.mark.parametrize("kinds", ["linear, linear", "linear, spline", "spline, polynomial"])
def test_a_connection_is_that_of_the_frozen_models_and_of_the_most_general_kind(join, kinds):
    makers = {
        "linear": linear,
        "spline": on_a_spline,
        "polynomial": lambda: random_lpv(2, nx=3, ny=2, seed=3)[0],
    }
    one, other = (makers[kind]() for kind in kinds.split(", "))
    found = join(one, other)
    assert type(found) is (LinearModel if kinds == "linear, linear" else LPVStateSpace)
    expected = joined(response(one), response(other))[join]
    np.testing.assert_allclose(response(found), expected, rtol=1e-9, atol=1e-11)
    assert type(join(one, LFT.constant(linear()))) is LFT if kinds[:6] != "spline" else True


def test_linear_models_are_connected_as_python_control_connects_them():
    G, K = linear(1), linear(2)
    expected = control.feedback(G.to_control(), K.to_control(), sign=1)
    np.testing.assert_allclose(
        response(feedback(G, K, sign=+1)), np.moveaxis(expected(1j * OMEGA), -1, 0), rtol=1e-9
    )


def test_sums_are_signals_of_their_own():
    """As outputs, in inputs and in other sums: no block of gain one is needed."""
    plant = LinearModel([[-1.0]], [[2.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",))
    loop = connect(
        plant,
        inputs=["r", "d"],
        outputs=["y", "error", "r", "u"],
        sums={
            "error": {"r": 1.0, "y": -1.0},
            "pushed": {"error": 3.0, "d": 1.0},
            "u": {"pushed": 1},
        },
    )
    # x' = -x + 2 (3 (r - x) + d)
    assert isinstance(loop, LinearModel)
    np.testing.assert_allclose(loop.A, [[-7.0]])
    np.testing.assert_allclose(loop.B, [[6.0, 2.0]])
    np.testing.assert_allclose(loop.C, [[1.0], [-1.0], [0.0], [-3.0]])
    np.testing.assert_allclose(loop.D, [[0, 0], [1, 0], [1, 0], [3, 1]])
    for sums, message in (
        ({"u": {"a": 1.0}, "a": {"b": 1.0}, "b": {"a": 1.0}}, "a needs b needs a"),
        ({"u": {"y": 1.0}, "y": {"u": 1.0}}, "'y' is the name of an output"),
    ):
        with pytest.raises(InputError, match=message):
            connect(plant, inputs=["r"], outputs=["y"], sums=sums)


def test_transfer_functions_and_gains_are_blocks_under_names_that_are_given_to_them():
    """BasicAffine of fdbianchi/lpv_synthesis_toolbox, weighted, as it stands in a book; the
    frozen optima are those found with the weights realized by hand.
    """
    s = control.tf("s")
    p1, p2 = (Scheduling(name, "1", low=0.0, high=1.0) for name in ("p1", "p2"))
    a, b = p1.symbol, p2.symbol
    plant = LPVStateSpace.from_expressions(
        [[-2 - 1.3 * a - 0.5 * b, 1 + 0.1 * a], [-1 - 0.1 * a, -2 - 1.3 * a - 0.5 * b]],
        [[1], [1]],
        [[10, 10]],
        [[0]],
        (p1, p2),
        inputs=["u"],
        outputs=[Signal("y", "m")],
    )
    weighted = connect(
        plant,
        {("e", "z1"): 10 / (s + 0.01), ("u", "z2"): (0.04 * s + 0.1) / (0.004 * s + 1)},
        inputs=["r", "u"],
        outputs=["z1", "z2", "e"],
        sums={"e": {"r": 1, "y": -1}},
    )
    for at, optimum in (((0.0, 0.0), 0.763786), ((1.0, 1.0), 0.766273)):
        design = hinf(weighted.at(*at), controls=["u"], measurements=["e"])
        assert design.optimum == pytest.approx(optimum, rel=1e-4)  # to the accuracy of the search


def test_names_of_blocks_and_the_units_they_take():
    plant = LinearModel(
        [[-1.0]], [[2.0]], [[1.0]], [[0.0]], ("x",), (Signal("u", "N"),), (Signal("y", "m"),)
    )
    labelled = control.tf([1], [1, 1], inputs="y", outputs="w", name="lag")
    gains = {("w", ("u", "v")): [[-3.0], [4.0]]}
    loop = connect(plant, labelled, gains, inputs=[], outputs=["w", "v", "y"])
    root = 1j * np.sqrt(6.0)  # x' = -x - 6 w, w' = x - w
    np.testing.assert_allclose(np.sort_complex(loop.poles()), [-1 - root, -1 + root])
    assert [y.unit for y in loop.outputs] == ["m/s", "m/s", "m"]  # w and v are known
    for block, message in (
        ({"K": 2.0}, "got the key 'K'"),
        ({("y", ("v", "w")): 2.0}, "expected 1 name"),
        ({("y", "v"): control.tf([1, 0], [1])}, "non-proper"),
        ({("y", "z"): plant}, "y is in N on one side and in m"),
    ):
        with pytest.raises(InputError, match=message):
            connect(plant, block, inputs=["u"], outputs=["y"])


def test_a_loop_through_feedthrough_that_depends_on_p_needs_an_lft():
    lpv, _ = random_lpv(2, nu=1, ny=1)
    with pytest.raises(InputError, match=r"to_lft\(\)"):
        feedback(lpv, 0.5, sign=+1)
    closed = feedback(lpv.to_lft(), 0.5, sign=+1)
    G = response(lpv)
    np.testing.assert_allclose(response(closed), G / (1 - 0.5 * G), rtol=1e-9)


def test_a_misfit_goes_through_the_connection():
    """A spline through a family that is also evaluated between the nodes."""
    lpv = on_a_spline()
    between = np.array([1.0, 4.0, 11.0])
    exact = lpv.matrices(between)
    lpv = lpv.with_residuals(between, exact._replace(A=exact.A + 0.01))
    behind = series(linear(3), lpv)
    assert behind.residuals is not None
    np.testing.assert_allclose(behind.residuals.A[:, 3:, 3:], -0.01, rtol=1e-9)
    assert np.abs(behind.residuals.A[:, :3]).max() < 1e-12


def test_an_uncertain_system_stays_a_set_with_the_same_block():
    model = on_a_spline()
    unc = UncertainStateSpace(model, [Signal("u1")], [Signal("y1")], 0.4, 1.0, "a test")
    controller = replace(linear(4, 1, 1), inputs=("y0",), outputs=("u0",))
    by_order = feedback(unc, controller, sign=+1)
    assert isinstance(by_order, UncertainStateSpace)
    kept = lower_feedback(unc, controller, inputs=["u0"], outputs=["y0"])
    np.testing.assert_allclose(response(by_order.model), response(kept.model), rtol=1e-9)
    assert (by_order.inputs, by_order.outputs, by_order.bound) == (("u0",), ("y0",), 0.4)
    for other, message in ((unc, "2 uncertain"), (LFT.constant(linear()), r"1 LFT\(s\)")):
        with pytest.raises(InputError, match=message):
            append(unc, other)


def test_a_parameter_of_both_is_one_parameter():
    one = random_lpv(2, nx=2, ny=2, seed=1)[0]
    both = append(one, replace(one, parameters=(Scheduling("mass", "kg", 0.0, 13.0),)), one)
    assert [s.name for s in both.parameters] == ["airspeed", "mass"]
    G = both.at(4.2, 7.0).frequency_response(OMEGA)
    np.testing.assert_allclose(G[:, 2:4, 2:4], response(one, 7.0), rtol=1e-9)
    np.testing.assert_allclose(G[:, 4:, 4:], response(one, 4.2), rtol=1e-9)
