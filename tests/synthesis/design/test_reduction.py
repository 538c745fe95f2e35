"""Controllers with fewer states."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from scheduled_plants import frozen, spring, spring_controller

import symheli
import synthesis
from symheli import LinearModel, LPVStateSpace
from symheli.errors import InputError, SynthesisError
from synthesis import hinf, output_feedback
from synthesis.design.loops.reduction import frozen_gain
from synthesis.numerics.linear.norm import norm


@pytest.fixture(scope="module")
def made():
    return spring_controller()


def extended(made, turned):
    """With a third state that the measurements do not move, in turned coordinates."""
    m = made.model
    one = np.zeros((m.basis.size, 3, 3))
    one[:, :2, :2] = m.A
    one[0, 2, 2] = -1.0
    one[0, 1, 2] = 0.5
    B = np.concatenate([m.B, np.zeros((m.basis.size, 1, m.B.shape[2]))], axis=1)
    C = np.concatenate([m.C, np.ones((m.basis.size, m.C.shape[1], 1))], axis=2)
    T, back = turned, np.linalg.inv(turned)
    model = LPVStateSpace(
        m.basis,
        back @ one @ T,
        back @ B,
        C @ T,
        m.D,
        m.parameters,
        ("k1", "k2", "k3"),
        m.inputs,
        m.outputs,
    )
    return replace(made, model=model)


@pytest.mark.slow
def test_states_that_nothing_moves_are_left_out_exactly(made):
    """The transfer function stays what it was, in whatever coordinates."""
    turned = np.random.default_rng(0).standard_normal((3, 3))
    more = extended(made, turned)
    less = more.reduce(2)
    assert less.order == 2
    assert "2 of 3 states kept" in less.method
    omega = np.geomspace(0.1, 30, 9)
    for p in (0.0, 0.35, 1.0):
        K = made.at(p).frequency_response(omega)
        # the Gramian of what is not moved is rounding of one, and its root is taken
        np.testing.assert_allclose(
            less.at(p).frequency_response(omega), K, atol=1e-5 * np.abs(K).max()
        )


@pytest.mark.slow
def test_a_state_that_matters_little_may_go():
    """Gusts of 20 rad/s bring a third state; two do about as well, frozen."""
    gusts = LinearModel([[-20.0]], [[20.0]], [[1.0]], [[0.0]], ("x",), ("in",), ("out",))
    made = output_feedback(spring().weighted({"w": gusts}))
    less = made.reduce(2)
    assert (made.order, less.order) == (3, 2)
    for p in np.linspace(0, 1, 7):
        gain = norm(*less.closed().matrices(p))[0]  # inf where the loop is not stable
        assert hinf(*frozen(made.plant, p)).optimum * (1 - 1e-6) <= gain < 1.02 * made.promised


def test_a_state_without_which_the_loop_is_unstable_stays(made):
    with pytest.raises(SynthesisError, match="with 1 of 2 states the closed loop is not stable"):
        made.reduce(1)


@pytest.mark.slow
def test_what_was_promised_of_all_states_is_not_promised_of_fewer(made):
    more = extended(made, np.eye(3))
    less = more.reduce(2)
    assert np.isnan(less.promised)
    assert less.optimum is None
    (note,) = less.reasons
    assert f"{frozen_gain(less):.6g}" in note
    assert f"{frozen_gain(more):.6g} of all 3 states" in note
    assert "nan" not in str(less)
    # a gain is proven without a promise
    assert less.certify(search=None).verified


@pytest.mark.slow
def test_the_least_order_within_a_loss_is_found():
    gusts = LinearModel([[-20.0]], [[20.0]], [[1.0]], [[0.0]], ("x",), ("in",), ("out",))
    made = output_feedback(spring().weighted({"w": gusts}))
    whole = frozen_gain(made)
    orders = []
    for loss in (0.0, 0.02, 1.0):
        less = made.reduce(loss=loss)
        orders.append(less.order)
        assert frozen_gain(less) <= (1 + loss) * whole
        if less.order:
            with contextlib.suppress(SynthesisError):
                assert frozen_gain(made.reduce(less.order - 1)) > (1 + loss) * whole
    assert orders == sorted(orders, reverse=True)
    assert orders[1] < made.order


@pytest.mark.parametrize("given", [{}, {"order": 1, "loss": 0.1}, {"loss": -0.1}, {"loss": "3%"}])
def test_an_order_or_a_loss_is_asked_for(made, given):
    with pytest.raises(InputError, match="loss"):
        made.reduce(**given)


def test_as_many_states_as_there_are_is_the_same_controller(made):
    assert made.reduce(2) is made
    assert made.reduce(2) is made


@pytest.mark.parametrize("order", [-1, 1.5, True, "1"])
def test_an_order_is_a_whole_number(made, order):
    with pytest.raises(InputError, match="order: expected an integer >= 0"):
        made.reduce(order)


def test_a_loop_that_is_not_stable_is_not_reduced(made):
    wrong = replace(made, model=replace(made.model, C=-40 * made.model.C))
    with pytest.raises(SynthesisError, match="not stable at every frozen p"):
        wrong.reduce(1)


def test_a_loop_through_feedthroughs_that_both_depend_on_p_is_closed_at_frozen_p():
    """u = -(1 + p)(x + p u / 2) about x' = -x + w + u: 1 / (1 + k) with k = 1 at both ends and
    more between; as a function of p the loop is rational, which no basis holds.
    """
    p = symheli.Scheduling("p", "1", low=0.0, high=1.0)
    model = LPVStateSpace.polynomial(
        [[[-1.0]]],
        [[[1.0, 1.0]]],
        [[[1.0], [1.0]]],
        [np.zeros((2, 2)), [[0.0, 0.0], [0.0, 0.5]]],
        p,
        inputs=["w", "u"],
        outputs=["z", "y"],
    )
    plant = synthesis.Plant(model, ["w"], ["z"], ["u"], ["y"])
    gain = LPVStateSpace.polynomial(
        [np.zeros((0, 0))],
        [np.zeros((0, 1))],
        [np.zeros((1, 0))],
        [[[-1.0]], [[-1.0]]],
        p,
        inputs=["y"],
        outputs=["u"],
    )
    made = synthesis.Controller.of(plant, gain)
    with pytest.raises(InputError, match="rational"):
        made.closed()
    assert frozen_gain(made) == pytest.approx(0.5, rel=1e-6)
