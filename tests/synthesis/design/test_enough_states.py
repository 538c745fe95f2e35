"""States that a design leaves out: what it loses, and when none is left out."""

import numpy as np
import pytest
from scheduled_plants import spring

from symheli import LinearModel
from synthesis import output_feedback
from synthesis.design.lpv import output_feedback as design
from synthesis.design.lpv.enough_states import FEW_STATES, LOSS
from synthesis.design.plant.generalized import Generalized
from synthesis.impose import Grid
from synthesis.numerics.linear.norm import norm

LAGS = 11


@pytest.fixture(scope="module")
def slow_plant():
    """The spring behind eleven fast lags in a row: what matters of them is their delay."""
    A = 300.0 * (np.eye(LAGS, k=-1) - np.eye(LAGS))
    B, C = 300.0 * np.eye(LAGS)[:, :1], np.eye(LAGS)[-1:]
    names = [f"lag{i}" for i in range(LAGS)]
    lags = LinearModel(A, B, C, [[0.0]], names, ["moved"], ["u"])
    return spring(rate=0.1).with_servo({"u": lags})


@pytest.fixture(scope="module")
def fewer(slow_plant):
    return output_feedback(slow_plant)


def test_states_of_a_short_delay_are_left_out(slow_plant, fewer):
    assert len(slow_plant.states) > FEW_STATES
    assert fewer.order < len(slow_plant.states)
    assert fewer.method.endswith(f"with {fewer.order} of {len(slow_plant.states)} states")


@pytest.mark.slow
def test_the_level_is_that_of_all_states_and_kept_on_the_whole_plant(
    slow_plant, fewer, monkeypatch
):
    monkeypatch.setattr(design, "enough_states", lambda scaled, worst: len(scaled.left))
    whole = output_feedback(slow_plant)
    assert whole.order == len(slow_plant.states)
    assert fewer.promised == pytest.approx(whole.promised, rel=1e-2)
    loop = fewer.closed()
    assert loop.states == (*slow_plant.states, *fewer.model.states)
    frozen = [norm(*loop.matrices(p), None)[0] for p in np.linspace(0.0, 1.0, 41)]
    assert max(frozen) <= fewer.promised * (1 + LOSS)


def test_of_few_states_and_at_given_points_none_is_left_out(slow_plant):
    assert output_feedback(spring()).order == 2
    assert output_feedback(slow_plant, impose=Grid(5), Y=1).order == len(slow_plant.states)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_states_at_rest_keep_the_response_to_slow_signals(dt):
    rng = np.random.default_rng(0)
    A = 0.3 * rng.normal(size=(5, 5)) - (np.eye(5) if dt is None else 0.0)
    plant = Generalized.split(
        A, rng.normal(size=(5, 4)), rng.normal(size=(3, 5)), rng.normal(size=(3, 4)), 2, 1
    )
    few = plant.at_rest(2, dt)

    def at_rest(each):
        A, B, C, D = each.joined
        return C @ np.linalg.solve((0.0 if dt is None else 1.0) * np.eye(len(A)) - A, B) + D

    assert few.A.shape == (2, 2)
    np.testing.assert_allclose(at_rest(few), at_rest(plant), rtol=1e-9)
