"""D-K iteration: what mu promises, and routes that agree; a published plant: docs/gallery.md."""

from dataclasses import replace

import control
import numpy as np
import pytest

from symheli import LFT, LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import connect
from synthesis import hinf
from synthesis.robust import (
    DynamicBlock,
    design_plant,
    mu_synthesis,
    robust_margin,
    worst_case_gain,
)

STILL = Scheduling("still", "1", 0.0, 1.0, rate=0.0)


def lag(unknown=0.1):
    """x' = u + w, of which a share of u is not known; y = x + n, z = (x, u)."""
    return LinearModel(
        [[0.0]],
        [[1.0, 1.0, 0.0, 1.0]],
        [[0.0], [1.0], [0.0], [1.0]],
        [[0, 0, 0, unknown], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]],
        ["x"],
        ["d", "w", "n", "u"],
        ["v", "z", "cost", "y"],
    )


BLOCK = [DynamicBlock("d", "v")]


def closed(plant, K):
    """The loop of u = K y, of the other signals of the plant."""
    w = [str(u) for u in plant.inputs if u not in K.outputs]
    z = [str(y) for y in plant.outputs if y not in K.inputs]
    return LPVStateSpace.constant(connect(plant, K, inputs=w, outputs=z), STILL)


@pytest.fixture(scope="module")
def design():
    return mu_synthesis(lag(), ["u"], ["y"], BLOCK, order=2, iterations=2)


@pytest.mark.slow
def test_mu_is_the_margin_of_the_loop_with_the_performance_as_a_block(design):
    """The loop is formed anew from plant and controller. Both are raised in steps of .1 %."""
    loop = closed(lag(), design.controller)
    performance = DynamicBlock(["w", "n"], ["z", "cost"])
    margin = robust_margin(loop, [*BLOCK, performance])
    assert 1 / margin.lower == pytest.approx(design.mu, rel=3e-3)
    assert 1 / margin.upper <= design.mu
    assert design.mu < 0.9 * design.levels[0]


def test_of_a_loop_of_many_states_mu_is_computed_and_says_so(monkeypatch):
    monkeypatch.setattr(design_plant, "MAX_PROVEN_STATES", 1)
    found = mu_synthesis(lag(), ["u"], ["y"], BLOCK, order=0, iterations=1)
    assert found.mu == min(found.levels)
    assert not found.verified
    assert not found.verify(rigorous=True)
    assert np.isnan(found.omega)


@pytest.mark.slow
def test_the_worst_gain_within_one_over_mu_is_below_mu(design):
    loop = closed(lag(), design.controller)
    worst = worst_case_gain(loop, [DynamicBlock("d", "v", 1 / design.mu)])
    assert worst.lower <= design.mu * (1 + 1e-6)
    assert worst.upper <= design.mu * 1.003
    assert worst.lower > 0.98 * design.mu  # mu is attained by some block


def test_without_uncertainty_it_is_the_least_norm():
    found = mu_synthesis(lag(1e-6), ["u"], ["y"], BLOCK, order=0, iterations=2)
    plain = lag().select(inputs=["w", "n", "u"], outputs=["z", "cost", "y"])
    assert found.mu == pytest.approx(hinf(plain, ["u"], ["y"]).optimum, rel=5e-3)


@pytest.mark.slow
def test_a_sampled_plant_of_the_same_responses_has_the_same_mu(design):
    sampled = lag().discretize(0.2, "tustin")
    found = mu_synthesis(sampled, ["u"], ["y"], BLOCK, order=2, iterations=2)
    assert found.controller.dt == 0.2
    assert found.mu == pytest.approx(design.mu, rel=3e-3)
    loop = closed(sampled, found.controller)
    assert worst_case_gain(loop, [DynamicBlock("d", "v", 1 / found.mu)]).lower <= found.mu * 1.003


@pytest.mark.slow
def test_a_parameter_counts_as_a_block():
    """x' = -k x + ..., k within 1 of 2, with a weight; the gain of members is below mu."""
    k = Scheduling("k", "1", 1.0, 3.0)
    plant = LFT.from_expressions(
        [[-k.symbol]],
        [[1, 0, 1]],
        [[1], [0], [1]],
        [[0, 0, 0], [0, 0, 0.5], [0, 0.1, 0]],
        [k],
        inputs=["w", "n", "u"],
        outputs=["z", "cost", "y"],
    ).reduce()
    found = mu_synthesis(plant, ["u"], ["y"], iterations=3)
    assert found.mu < 1
    loop = connect(plant, found.controller, inputs=["w", "n"], outputs=["z", "cost"])
    for value in (1.0, 2.0, 3.0):
        one = loop.at(value)
        omega = np.geomspace(1e-2, 1e2, 400)
        assert one.is_stable()
        assert np.linalg.norm(one.frequency_response(omega), 2, axis=(1, 2)).max() <= found.mu


def column():
    """The distillation column of Skogestad and Postlethwaite, sec. 8.11.4 and 8.12.4."""
    s = control.tf("s")
    G0 = np.array([[87.8, -86.4], [108.2, -109.6]])
    G = control.ss(-np.eye(2) / 75, np.eye(2), G0 / 75, np.zeros((2, 2)))
    doubt, wish = (s + 0.2) / (0.5 * s + 1), (s / 2 + 0.05) / (s + 1e-6)
    return connect(
        {(("g1", "g2"), ("y1", "y2")): G},
        {("u1", "v1"): doubt, ("u2", "v2"): doubt, ("e1", "z1"): wish, ("e2", "z2"): wish},
        inputs=["d1", "d2", "w1", "w2", "u1", "u2"],
        outputs=["v1", "v2", "z1", "z2", "m1", "m2"],
        sums={
            **{"g1": {"u1": 1, "d1": 1}, "g2": {"u2": 1, "d2": 1}},
            **{"e1": {"y1": 1, "w1": 1}, "e2": {"y2": 1, "w2": 1}},
            **{"m1": {"e1": -1}, "m2": {"e2": -1}},
        },
    )


def test_an_unreachable_plant_gives_reasons():
    plant = replace(lag(), A=[[1.0]], B=[[1.0, 1.0, 0.0, 0.0]])
    found = mu_synthesis(plant, ["u"], ["y"], BLOCK, order=0)
    assert found.controller is None
    assert found.reasons


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"order": 3}, "even number"),
        ({"iterations": 0}, "iterations"),
        ({"blocks": []}, "nothing is uncertain"),
        ({"model": 1.0}, "expected a LinearModel"),
    ],
)
def test_bad_input_is_refused_in_words(given, words):
    asked = {"model": lag(), "blocks": BLOCK, **given}
    with pytest.raises(InputError, match=words):
        mu_synthesis(asked.pop("model"), ["u"], ["y"], **asked)
