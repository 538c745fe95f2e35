"""Loop shaping over p: beside the closed form of one model, and certified while p moves."""

import math

import numpy as np
import pytest

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import feedback
from synthesis.designs import loop_shaping, ncfsyn


def carriage(rate, low=0.5, high=2.0):
    """A mass on a damper that p stiffens, pushed more the larger p is."""
    p = Scheduling("p", "1", low, high, rate=rate)
    return LPVStateSpace.polynomial(
        A=[[[0.0, 1.0], [0.0, -0.5]], [[0.0, 0.0], [-0.4, 0.0]]],
        B=[[[0.0], [0.5]], [[0.0], [1.0]]],
        C=[[[1.0, 0.0]]],
        D=[[[0.0]]],
        scheduling=p,
        inputs=["push"],
        outputs=["place"],
    )


slow_integral = LinearModel([[-0.01]], [[1.0]], [[2.0]], [[4.0]], ["w"], ["in"], ["out"])


def worst_frozen(G, W1):
    return max(ncfsyn(G.at(p), W1).optimum for p in np.linspace(0.5, 2.0, 31))


@pytest.mark.slow
def test_of_one_model_it_is_the_closed_form():
    G = carriage(0.0, low=1.0, high=1.0 + 1e-6)
    made = loop_shaping(G, slow_integral, rate=0.0)
    assert made.shaped.optimum == pytest.approx(ncfsyn(G.at(1.0), slow_integral).optimum, rel=1e-3)


@pytest.mark.slow
def test_at_rest_it_comes_within_a_hundredth_of_the_worst_closed_form():
    G = carriage(0.0)
    made = loop_shaping(G, slow_integral)
    worst = worst_frozen(G, slow_integral)
    assert worst * (1 - 2e-3) <= made.shaped.optimum <= 1.01 * worst
    # u = W1 K y of the plant itself: the frozen loops are those of the shaped plant
    for p in (0.5, 1.0, 2.0):
        loop = feedback(G.at(p), made.controller.at(p), sign=+1)
        assert loop.is_stable()


@pytest.mark.slow
def test_while_p_moves_it_is_proven():
    made = loop_shaping(carriage(0.3), slow_integral)
    proof = made.shaped.certify(search=None)
    assert proof.verified
    assert proof.gamma <= made.shaped.promised * 1.01
    assert proof.gamma >= worst_frozen(carriage(0.3), slow_integral) * (1 - 1e-3)


@pytest.mark.slow
def test_a_weight_over_p_undoes_the_dependence_of_the_plant():
    """p/s behind a weight 1/p, here to 1e-4 by a polynomial: 1/s, whose optimum is sqrt(2)."""
    p = Scheduling("p", "1", 1.0, 2.0, rate=1.0)
    G = LPVStateSpace.polynomial([[[0.0]]], [[[0.0]], [[1.0]]], [[[1.0]]], [[[0.0]]], p)
    nodes = np.linspace(1.0, 2.0, 51)
    fit = np.polynomial.Polynomial.fit(nodes, 1 / nodes, 7).convert().coef
    none = np.zeros((1, 0, 0)), np.zeros((1, 0, 1)), np.zeros((1, 1, 0))
    weight = LPVStateSpace.polynomial(*none, fit[:, None, None], p)
    made = loop_shaping(G, weight)
    assert made.shaped.optimum == pytest.approx(math.sqrt(2), rel=2e-3)
    assert made.controller.inputs == G.outputs
    assert made.controller.outputs == G.inputs


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"G": carriage(0.0).at(1.0)}, "ncfsyn takes one linear model"),
        ({"W1": 0.0}, "W1: expected a weight that is not 0"),
        ({"W2": carriage(0.0).discretize(0.1)}, "its sample period is 0.1 s"),
        ({"W1": [1.0, 2.0]}, "expected a weight of 1 channels"),
    ],
)
def test_bad_input_is_refused_in_words(given, words):
    with pytest.raises(InputError, match=words):
        loop_shaping(**{"G": carriage(0.0), **given})
