"""Real parameters and several dynamics at once: closed forms, what is attained, and draws."""

import math

import numpy as np
import pytest
from test_robust_margin import page

from symheli import LFT, LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from synthesis.robust import DynamicBlock, robust_margin, worst_case_gain

TOLERANCE = 2e-3
"""The proven level is raised in steps of a part in a thousand."""


def two_lags(a, b):
    """Two lags 1/(s + 1) in a ring with gains a and b, each with dynamics beside it."""
    return LPVStateSpace.polynomial(
        [[[-1.0, 0.0], [0.0, -1.0]]],
        [np.eye(2)],
        [[[0.0, a], [b, 0.0]]],
        [np.zeros((2, 2))],
        Scheduling("still", "1", 0.0, 1.0, rate=0.0),
        inputs=["d1", "d2"],
        outputs=["v1", "v2"],
    )


RING = [DynamicBlock(["d1"], ["v1"]), DynamicBlock(["d2"], ["v2"])]


def oscillator():
    """m x'' + 0.6 x' + s x = F, two dynamics at the force; m and s in a rational way."""
    m, s = Scheduling("m", "kg", 0.8, 1.2), Scheduling("s", "N/m", 0.5, 1.5)
    return LFT.from_expressions(
        [[0, 1], [-s.symbol / m.symbol, -0.6 / m.symbol]],
        [[0, 0, 0], [1 / m.symbol, 1 / m.symbol, 0.2]],
        [[1, 0], [1, 0], [0, 1]],
        np.zeros((3, 3)).tolist(),
        [m, s],
        inputs=["F", "d1", "d2"],
        outputs=["x", "v1", "v2"],
    ).reduce()


FORCES = [DynamicBlock(["d1"], ["v1"], 0.1), DynamicBlock(["d2"], ["v2"], 0.2)]


@pytest.mark.slow
def test_two_dynamics_in_a_ring_in_closed_form():
    """mu = sqrt(a b) at rest, whatever a/b is, where the largest gain is max(a, b)."""
    found = robust_margin(two_lags(4.0, 0.25), RING)
    assert found.upper == pytest.approx(1.0, rel=1e-6)
    assert (1 - TOLERANCE) * found.upper <= found.lower <= found.upper
    assert found.omega == 0.0
    assert np.abs(np.diag(found.perturbation)) == pytest.approx([1.0, 1.0], rel=1e-5)


def test_a_parameter_alone_in_closed_form():
    """x'' + x' + k x with k = 2 within 1: lost at k = 0."""
    k = Scheduling("k", "1", 1.0, 3.0)
    spring = LPVStateSpace.from_expressions(
        [[0, 1], [-k.symbol, -1]], [[0], [1]], [[1, 0]], [[0]], k
    )
    found = robust_margin(spring)
    assert found.upper == pytest.approx(2.0, rel=1e-5)
    assert (1 - TOLERANCE) * found.upper <= found.lower <= found.upper
    assert found.p == pytest.approx(0.0, abs=1e-4)


@pytest.mark.slow
def test_what_is_borne_and_what_is_lost_without_any():
    small = robust_margin(two_lags(0.01, 0.01), RING, largest=5.0)
    assert (small.lower, small.upper) == (5.0, math.inf)
    unstable = LPVStateSpace.polynomial(
        [[[1.0]]], [[[1.0]]], [[[1.0]]], [[[0.0]]], Scheduling("still", "1", 0.0, 1.0)
    )
    none = robust_margin(unstable, [DynamicBlock(["u1"], ["y1"])])
    assert (none.lower, none.upper) == (0.0, 1e-6)
    gain = worst_case_gain(two_lags(4.0, 4.0), RING[:1])
    assert gain.upper >= gain.lower > 0


@pytest.mark.slow
def test_the_page_of_robstab_by_blocks():
    """MATLAB prints [1.5960, 1.5993]."""
    found = robust_margin(page().model, [DynamicBlock(["d"], ["v"], 0.5)])
    assert 1.5960 <= found.lower <= found.upper <= 1.5995
    other = robust_margin(page())
    assert found.upper == pytest.approx(other.upper, rel=1e-4)


def closed_at(model, p, omega, delta):
    """The response from F to x with these dynamics at d1 and d2, from the model itself."""
    one = model.at(*p)
    M = one.C @ np.linalg.solve(1j * omega * np.eye(2) - one.A, one.B) + one.D
    return M, M[:1, :1] + M[:1, 1:] @ delta @ np.linalg.solve(
        np.eye(2) - M[1:, 1:] @ delta, M[1:, :1]
    )


@pytest.mark.slow
def test_the_margin_of_two_parameters_and_two_dynamics_is_attained():
    model = oscillator()
    found = robust_margin(model, FORCES)
    assert (1 - TOLERANCE) * found.upper <= found.lower <= found.upper
    for p, s in zip(found.p, model.parameters, strict=True):
        assert abs(p - s.middle) <= found.upper * s.radius * (1 + 1e-6)
    bounds = np.array([0.1, 0.2]) * found.upper
    assert np.all(np.abs(np.diag(found.perturbation)) <= bounds * (1 + 1e-5))
    # beyond its range the model is the same rational function
    M = model.matrix(
        [(p - s.middle) / s.radius for p, s in zip(found.p, model.parameters, strict=True)]
    )
    A, B, C = M[:2, :2], M[:2, 3:], M[3:, :2]
    response = C @ np.linalg.solve(1j * found.omega * np.eye(2) - A, B)
    lost = np.linalg.det(np.eye(2) - response @ found.perturbation)
    assert abs(lost) < 1e-4  # the frequency is known to some 1e-6


@pytest.mark.slow
def test_the_worst_gain_is_attained_and_no_draw_is_above_it():
    model = oscillator()
    found = worst_case_gain(model, FORCES)
    assert (1 - TOLERANCE) * found.upper <= found.lower <= found.upper
    _, gain = closed_at(model, found.p, found.omega, found.perturbation)
    assert abs(gain.item()) == pytest.approx(found.lower, rel=1e-4)
    rng, worst = np.random.default_rng(1), 0.0
    for _ in range(2000):
        p = [rng.uniform(s.low, s.high) for s in model.parameters]
        delta = np.diag([0.1, 0.2] * np.exp(2j * np.pi * rng.uniform(size=2)))
        worst = max(worst, abs(closed_at(model, p, rng.uniform(0.3, 1.5), delta)[1].item()))
    assert 0.7 * found.lower < worst <= found.lower * (1 + 1e-6)


@pytest.mark.parametrize(
    ("given", "error", "words"),
    [
        ({"model": two_lags(1, 1).at(0.0)}, InputError, "expected an LFT"),
        ({"blocks": []}, InputError, "nothing is uncertain"),
        ({"blocks": [("d1", "v1", 1.0)]}, InputError, "expected DynamicBlock"),
        ({"blocks": [DynamicBlock(["d1"], ["v1"], 0.0)]}, InputError, "finite bound > 0"),
        ({"blocks": [*RING, RING[0]]}, InputError, "one block only"),
        ({"blocks": [DynamicBlock(["d9"], ["v1"])]}, UnknownNameError, "d9"),
    ],
)
def test_bad_input_is_refused_in_words(given, error, words):
    asked = {"model": two_lags(1.0, 1.0), "blocks": RING, **given}
    for question in (robust_margin, worst_case_gain):
        with pytest.raises(error, match=words):
            question(**asked)


def test_a_gain_needs_channels_and_a_block_is_given_once():
    with pytest.raises(InputError, match="a gain needs an input and an output"):
        worst_case_gain(two_lags(1.0, 1.0), RING)
    with pytest.raises(InputError, match="has its block"):
        robust_margin(page(), RING)
