"""Designs for the worst-case gain: against the Riccati optimum, members, and a published design."""

import numpy as np
import published_h3 as h3
import pytest

from symheli import LFT, LinearModel, Scheduling
from symheli.errors import InputError
from symheli.lpv import connect
from synthesis import hinf
from synthesis.robust import DynamicBlock, mu_synthesis, worst_case_gain
from synthesis.robust.members import through


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


def uncertain_lag(low=1.0, high=3.0):
    """x' = -k x + w + u, k in [low, high]; z = (x, u), y = x + n/10."""
    k = Scheduling("k", "1", low, high)
    known = LinearModel(
        [[0.0]],
        [[-1, 1, 0, 1]],
        [[1], [1], [0], [1]],
        [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0.1, 0]],
        ["x"],
        ["kx", "w", "n", "u"],
        ["x_k", "z", "cost", "y"],
    )
    return connect(
        known,
        LFT.parameter(k, "x_k", "kx"),
        inputs=["w", "n", "u"],
        outputs=["z", "cost", "y"],
    )


@pytest.fixture(scope="module")
def design():
    return mu_synthesis(uncertain_lag(), ["u"], ["y"], goal="gain", iterations=1, states=1)


def test_the_gain_is_proven_and_no_member_exceeds_it(design):
    assert design.verified
    assert list(design.levels) == sorted(design.levels, reverse=True)
    assert design.gain.lower == pytest.approx(design.levels[-1], rel=1e-4)
    omega = np.geomspace(1e-3, 1e3, 300)
    for value in np.linspace(1.0, 3.0, 7):
        one = design.loop.at(value)
        assert one.is_stable()
        gains = np.linalg.norm(one.frequency_response(omega), 2, axis=(1, 2))
        assert gains.max() <= design.gain.upper


def test_it_is_no_lower_than_the_optimum_of_the_worst_member_and_near_it(design):
    """No controller does better for all than the best one for k = 1 does there. Measured: .4 %."""
    least = hinf(uncertain_lag().at(1.0), ["u"], ["y"]).optimum
    assert least * (1 - 1e-6) <= design.gain.lower <= 1.01 * least


def test_a_plant_whose_only_pole_is_unstable_is_designed_for():
    """Its pole is at the mean pace of all: no bilinear map of that pace has a place for it."""
    found = mu_synthesis(uncertain_lag(-3.0, 1.0), ["u"], ["y"], goal="gain", iterations=1)
    least = hinf(uncertain_lag(-3.0, 1.0).at(-3.0), ["u"], ["y"]).optimum
    assert found.verified
    assert least * (1 - 1e-6) <= found.gain.lower <= 1.01 * least
    assert all(found.loop.at(k).is_stable() for k in np.linspace(-3.0, 1.0, 9))


@pytest.mark.slow
def test_without_uncertainty_it_is_the_least_norm():
    found = mu_synthesis(lag(1e-6), ["u"], ["y"], BLOCK, goal="gain", iterations=2, states=1)
    plain = lag().select(inputs=["w", "n", "u"], outputs=["z", "cost", "y"])
    least = hinf(plain, ["u"], ["y"]).optimum
    assert least * (1 - 1e-6) <= found.gain.lower <= least * (1 + 5e-3)


@pytest.mark.slow
def test_with_dynamics_it_is_below_the_gain_of_the_design_for_mu():
    plain = mu_synthesis(lag(), ["u"], ["y"], BLOCK, order=2, iterations=3)
    found = mu_synthesis(lag(), ["u"], ["y"], BLOCK, goal="gain")
    model = LFT.constant(lag())
    asked = {"inputs": ["d", "w", "n"], "outputs": ["v", "z", "cost"]}
    other = worst_case_gain(connect(model, plain.controller, **asked), BLOCK)
    assert found.gain.upper < other.lower


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (3, 1)])
@pytest.mark.parametrize("omega", [0.0, 0.7, np.inf])
def test_dynamics_of_a_direction_are_all_pass(shape, omega):
    """At the frequency the matrix itself, of gain 1 at every other one."""
    rng = np.random.default_rng(3)
    a, b = (rng.standard_normal(n) + 1j * rng.standard_normal(n) for n in shape)
    if omega in (0.0, np.inf):
        a, b = a.real, b.real
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    A, B, C, D = through(np.outer(a, b), omega)
    assert np.all(np.linalg.eigvals(A).real < 0) if len(A) else True

    def at(w):
        if np.isinf(w):
            return D
        return C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B) + D

    np.testing.assert_allclose(at(omega), np.outer(a, b), atol=1e-12)
    for w in (0.0, 0.1, 1.0, 10.0, np.inf):
        assert np.linalg.norm(at(w), 2) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"goal": "h2"}, "goal"),
        ({"goal": "mu", "states": 2}, "states"),
        ({"goal": "gain", "states": 0, "iterations": 1}, "as many or more"),
    ],
)
def test_bad_input_is_refused_in_words(given, words):
    with pytest.raises(InputError, match=words):
        mu_synthesis(lag(), ["u"], ["y"], BLOCK, **given)


def test_an_unreachable_plant_gives_reasons():
    plant = LinearModel([[1.0]], [[1.0, 1.0, 0.0, 0.0]], lag().C, lag().D, ["x"], lag().inputs,
                        lag().outputs)  # fmt: skip
    found = mu_synthesis(plant, ["u"], ["y"], BLOCK, goal="gain")
    assert found.controller is None
    assert found.gain is None
    assert not found.verified
    assert found.reasons


@pytest.mark.slow
def test_a_published_design_is_undercut_with_proof():
    """Schwenkel et al.: 37.46863. Here 36.73, of four states."""
    found = mu_synthesis(h3.plant(), ["u1", "u2"], ["y"], goal="gain")
    assert found.verified
    assert found.gain.upper < 36.8 < h3.PUBLISHED
    omega = np.append(np.linspace(0, np.pi, 200), found.gain.omega)
    corners = [(a, b) for a in h3.RANGES[0] for b in h3.RANGES[1]]
    worst = max(h3.frozen_gain(found.controller, d, omega) for d in [*corners, found.gain.p])
    assert found.gain.lower * (1 - 1e-4) <= worst <= found.gain.upper
