"""A gain that covers what a model leaves out."""

import math

import numpy as np
import pytest

import synthesis
from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import Spline
from synthesis.cover import SAFETY, Remainder, covered_gain, covering

PLAIN = Spline(degree=0)


def lag(pole=1.0):
    """dx/dt = -pole x + u, y = x, whatever p is."""
    return LPVStateSpace.polynomial(
        [[[-pole]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0)
    )


def left_out(size):
    """Of the pole, either way."""
    return np.array([[[size, 0.0]], [[-size, 0.0]]]) / SAFETY


def test_a_pole_known_within_a_margin_has_the_gain_of_the_slowest_pole():
    gain, certificate = covered_gain(lag(), Remainder.of(left_out(0.005)), 0.0, PLAIN, 1.0)
    truth = 1 / (1 - 0.005)
    # one balanced scale for disturbance and remainder costs at most the room that is tried, 1 %
    assert truth <= gain < 1.01 * truth
    assert certificate.verify(rigorous=True)


def test_a_remainder_of_another_size_and_a_gain_that_is_not_proven_are_refused():
    rest = Remainder.of(np.ones((2, 2, 3)))
    with pytest.raises(InputError, match="expected the remainder of 1 states and 1 inputs"):
        covered_gain(lag(), rest, 0.0, PLAIN, 1.0)
    with pytest.raises(InputError, match="proven of the model alone, got inf"):
        covered_gain(lag(), Remainder.of(left_out(0.005)), 0.0, PLAIN, math.inf)


def test_nothing_is_proven_where_the_remainder_may_make_the_plant_unstable():
    assert covered_gain(lag(), Remainder.of(left_out(1.2)), 0.0, PLAIN, 1.0) == (math.inf, None)


def test_every_measured_difference_is_within_the_remainder_with_the_promised_safety():
    missed = (
        np.random.default_rng(1).standard_normal((40, 3, 5))
        * [[1.0], [1e-3], [30.0]]
        * [1, 1, 1e-4, 1, 7]
    )
    rest = Remainder.of(missed)
    norms = np.linalg.norm(missed / rest.rows[:, None] / rest.columns, 2, axis=(1, 2))
    assert norms.max() == pytest.approx(1 / SAFETY)


def test_without_a_remainder_the_covering_model_has_the_gain_of_the_model():
    rest = Remainder.of(left_out(1e-12))
    assert synthesis.l2_gain(
        covering(lag(), rest, 2.0), 0.0, form=PLAIN, search=None
    ).gamma == pytest.approx(0.5, rel=1e-3)
