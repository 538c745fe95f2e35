"""Matrices, gains and python-control systems from elsewhere go in by the same doors as the models
of this package.
"""

from dataclasses import replace
from functools import partial

import control
import numpy as np
import pytest
from families import SPEED, random_lpv, stacked

from symheli import LFT, LinearFamily, LinearModel, LPVStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.flight.stitched_model import StitchedModel
from symheli.lpv import PiecewiseLinear, append, connect, feedback, parallel, series

PLANT = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("v",), ("d_col",), ("q",))


def compensator(**names):
    return control.ss([[-5.0]], [[1.0]], [[2.0]], [[0.5]], **names)


def test_units_and_names_come_with_a_system_of_python_control():
    model = LinearModel.from_control(
        compensator(),
        states=["lag"],
        inputs=["q"],
        outputs=["command"],
        units={"lag": "m", "command": "V"},
    )
    assert [(str(s), s.unit) for s in (*model.states, *model.inputs, *model.outputs)] == [
        ("lag", "m"),
        ("q", "rad/s"),
        ("command", "V"),
    ]
    with pytest.raises(UnknownNameError, match="did you mean 'lag'"):
        LinearModel.from_control(compensator(), states=["lag"], units={"lg": "m"})
    transfer = LinearModel.from_control(control.tf([2.0], [1.0, 3.0]))
    assert transfer.frequency_response([4.0])[0, 0, 0] == pytest.approx(2 / (3 + 4j), rel=1e-14)
    with pytest.raises(InputError, match="unknown length"):
        LinearModel.from_control(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], True))
    with pytest.raises(InputError, match="StateSpace or a TransferFunction"):
        LinearModel.from_control(3.0)


def test_a_python_control_system_connects_by_its_names():
    # "e" carries no unit, as python-control's signals do
    plant = LinearModel(PLANT.A, PLANT.B, PLANT.C, PLANT.D, ("v",), ("u",), ("y",))
    loop = connect(
        plant,
        compensator(inputs="y", outputs="e"),
        inputs=["r"],
        outputs=["y"],
        sums={"u": {"r": 1.0, "e": -1.0}},
    )
    expected = control.feedback(plant.to_control(), compensator())
    assert loop.frequency_response([0.7])[0, 0, 0] == pytest.approx(
        complex(expected(0.7j)), rel=1e-12
    )


@pytest.mark.parametrize("join", [partial(feedback, sign=+1), series, parallel, append])
def test_gains_lpv_models_and_python_control_systems_are_joined_in_their_order(join):
    lpv, _ = random_lpv(1, nu=1, ny=1)
    lpv = replace(lpv, D=np.zeros_like(lpv.D))  # a loop through D(p) is rational, see below
    theirs = compensator()
    ours = LinearModel.from_control(theirs)
    for p in (0.0, 7.0):
        np.testing.assert_allclose(
            stacked(join(lpv, theirs).at(p)), stacked(join(lpv.to_lft(), ours).at(p)), atol=1e-13
        )
        for gain in (2.0, [[2.0]], np.array([[2.0]])):
            named = LinearModel.gain([[2.0]], ["a"], ["b"])
            np.testing.assert_allclose(
                stacked(join(lpv, gain).at(p)),
                stacked(join(lpv.to_lft(), named).at(p)),
                atol=1e-13,
            )


def test_what_has_no_states_goes_with_any_sample_period():
    sampled = PLANT.discretize(0.1)
    for gain in (LinearModel.gain([[3.0]], ["q"], ["e"]), 3.0, control.ss([], [], [], [[3.0]])):
        assert series(sampled, gain).dt == 0.1
        assert series(sampled, gain).frequency_response([1.0]) == pytest.approx(
            3 * sampled.frequency_response([1.0]), rel=1e-14
        )
    with pytest.raises(
        InputError, match=r"one sample period, got 0.1 s, continuous; discretize the continuous"
    ):
        series(sampled, PLANT)


def test_what_cannot_be_connected_is_told_what_can():
    with pytest.raises(InputError, match=r"sums=.*{\(inputs, outputs\): gain}"):
        connect(PLANT, 2.0, inputs=["d_col"], outputs=["q"])
    with pytest.raises(InputError, match=r"a system of python-control.*to connect, got dict"):
        append(PLANT, {})
    spline = LPVStateSpace(
        PiecewiseLinear((0.0, 13.0)),
        np.zeros((2, 1, 1)),
        np.zeros((2, 1, 1)),
        np.zeros((2, 1, 1)),
        np.zeros((2, 1, 1)),
        SPEED,
        ("x",),
        ("u",),
        ("y",),
    )
    with pytest.raises(InputError, match="interpolate with kind='polynomial'"):
        append(spline, LFT.constant(PLANT))


def test_a_family_of_matrices_from_elsewhere_has_no_trims_and_interpolates_all_the_same():
    models = [
        LinearModel([[-1.0 - v]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("d_col",), ("u",))
        for v in (0.0, 5.0, 13.0)
    ]
    family = LinearFamily.from_models([0.0, 5.0, 13.0], models)
    assert family[1].point is None
    lpv = family.select(["u"]).interpolate("polynomial", 1)
    assert lpv.trim is None
    assert lpv.at(9.0).A[0, 0] == pytest.approx(-10.0, rel=1e-12)
    with pytest.raises(InputError, match="this family has none"):
        family.known_trims("a stitched model")
    with pytest.raises(InputError, match="one model for each value of airspeed: 2, got 3"):
        LinearFamily.from_models([0.0, 5.0], models)
    with pytest.raises(InputError, match=r"models\[2\]: expected states"):
        LinearFamily.from_models([0.0, 5.0, 13.0], [*models[:2], PLANT])


def test_a_stitched_model_says_that_it_needs_trims(ideal):
    import symheli

    family = symheli.sweep(ideal, [0.0, 5.0])
    bare = LinearFamily.from_models(
        family.airspeeds, [replace(model, point=None) for model in family]
    )
    with pytest.raises(InputError, match="a stitched model needs the trim at each airspeed"):
        StitchedModel.from_family(bare)


def test_loops_through_feedthrough_are_solved():
    model = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.5]], ("x",), ("u",), ("y",))
    closed = model.feedback({("u", "y"): -1.0})
    expected = control.feedback(model.to_control(), control.ss([], [], [], [[1.0]]))
    assert closed.frequency_response([0.3])[0, 0, 0] == pytest.approx(
        complex(expected(0.3j)), rel=1e-12
    )
    with pytest.raises(InputError, match="not well posed"):
        model.feedback({("u", "y"): 2.0})
