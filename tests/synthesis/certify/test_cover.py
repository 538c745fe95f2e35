"""A set of models that covers what one model leaves out."""

import math

import numpy as np
import pytest

from symheli import LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError
from symheli.lpv.uncertain_state_space import SAFETY
from synthesis import l2_gain
from synthesis.forms import Spline

PLAIN = Spline(degree=0)
covering = UncertainStateSpace.covering


def lag(pole=1.0):
    """dx/dt = -pole x + u, y = x, whatever p is."""
    return LPVStateSpace.polynomial(
        [[[-pole]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0)
    )


def left_out(size):
    """Of the pole, either way."""
    return np.array([[[size, 0.0]], [[-size, 0.0]]]) / SAFETY


@pytest.mark.slow
def test_a_pole_known_within_a_margin_has_the_gain_of_the_slowest_pole():
    certificate = l2_gain(covering(lag(), left_out(0.005)), 0.0, form=PLAIN)
    truth = 1 / (1 - 0.005)
    # a thousandth more: the remainder covers the entry of the input too, by a millionth
    assert truth <= certificate.gamma < 1.001 * truth
    assert certificate.verify(rigorous=True)


def test_a_remainder_of_another_size_is_refused():
    with pytest.raises(InputError, match=r"differences: expected shape \(any, 1, 2\)"):
        covering(lag(), np.ones((2, 2, 3)))


def test_nothing_is_proven_where_the_remainder_may_make_the_plant_unstable():
    assert l2_gain(covering(lag(), left_out(1.2)), 0.0, form=PLAIN).gamma == math.inf


def test_every_measured_difference_is_within_the_remainder_with_the_promised_safety():
    missed = (
        np.random.default_rng(1).standard_normal((40, 3, 5))
        * [[1.0], [1e-3], [30.0]]
        * [1, 1, 1e-4, 1, 7]
    )
    model = LPVStateSpace.constant(
        LinearModel(*(np.zeros(s) for s in ((3, 3), (3, 2), (1, 3), (1, 2))), "abc", "uv", "y")
    )
    around = covering(model, missed).model.at(0.5)
    rows = around.B[:, 2:].diagonal()
    columns = np.hstack([around.C[1:], around.D[1:, :2]]).diagonal()
    norms = np.linalg.norm(missed / rows[:, None] / columns, 2, axis=(1, 2))
    assert norms.max() == pytest.approx(1 / SAFETY)


@pytest.mark.slow
def test_without_a_remainder_the_covering_set_has_the_gain_of_the_model():
    certificate = l2_gain(covering(lag(), left_out(1e-12)), 0.0, form=PLAIN, search=None)
    assert certificate.gamma == pytest.approx(1.0, rel=1e-3)
