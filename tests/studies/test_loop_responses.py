"""Responses of closed loops to commands and disturbances: closed forms, and what noise leaves."""

import numpy as np
import pytest

import symheli
from evidence.tuning import THROW, parameters
from studies.autopilot.between import stable_between
from studies.autopilot.tuned import LEAST, RESPOND, closed_loops, loop_margins
from symheli import LinearModel
from symheli.errors import InputError
from symheli.flight import HelicopterLoops
from synthesis.design.loops.responses import DURATION, LOWEST, responses

SISO = {"loop": ("y", "command", "disturbance")}


@pytest.fixture(scope="module")
def loops():
    return HelicopterLoops.from_parameters(parameters(), throw=THROW)


def closed(A, B, C, dt=None):
    """y after its command, and after a disturbance that is added to it."""
    states = [f"x{k}" for k in range(len(A))]
    B = np.column_stack([B, -np.asarray(B)])
    return LinearModel(A, B, [C], [[0.0, 0.0]], states, ["command", "disturbance"], ["y"], dt)


@pytest.mark.parametrize("k", [0.5, 3.0])
def test_a_loop_that_integrates_has_its_closed_form(k):
    """L = k/s: k/(s + k) and s/(s + k), -3 dB at k; rise ln 9 / k, 5 % left after ln 20 / k."""
    found = responses(closed([[-k]], [k], [1.0]), SISO)["loop"]
    assert found.bandwidth_3db == pytest.approx(k, rel=1e-4)  # lines between frequencies 1 % apart
    assert found.rejection == pytest.approx(k, rel=1e-4)
    assert found.peak == pytest.approx(-10 * np.log10(1 + (LOWEST / k) ** 2), abs=1e-9)
    assert found.rejection_peak == pytest.approx(-10 * np.log10(1 + (k / 100.0) ** 2), abs=1e-9)
    assert found.overshoot == 0.0
    # straight lines between samples of 1/500 of the duration
    assert found.rise == pytest.approx(np.log(9) / k, rel=1e-3)
    assert found.settling == pytest.approx(np.log(20) / k, rel=1e-3)


def test_a_loop_with_little_damping_has_its_closed_form():
    """L = w^2 / (s (s + 2 z w)): overshoot and peak of the second-order lag."""
    w, z = 2.0, 0.3
    model = closed([[0.0, 1.0], [-(w**2), -2 * z * w]], [0.0, w**2], [1.0, 0.0])
    found = responses(model, SISO)["loop"]
    exact = 100 * np.exp(-np.pi * z / np.sqrt(1 - z**2))
    assert found.overshoot == pytest.approx(exact, abs=0.01)  # samples beside the top
    assert found.peak == pytest.approx(-20 * np.log10(2 * z * np.sqrt(1 - z**2)), abs=1e-3)
    power = 1 - 2 * z**2 + np.sqrt((1 - 2 * z**2) ** 2 + 1)
    assert found.bandwidth_3db == pytest.approx(w * np.sqrt(power), rel=1e-4)


def test_a_loop_that_follows_too_little_has_the_ends_of_the_range():
    """y = .5 of the command: it never follows within 3 dB, and never settles."""
    found = responses(closed([[-4.0]], [2.0], [1.0]), SISO)["loop"]
    assert (found.bandwidth_3db, found.rise, found.settling) == (LOWEST, DURATION, DURATION)


def test_the_closed_loops_are_those_of_a_simulation(ideal, loops):
    """A step of the roll command, sample by sample through the plant and `commanded`."""
    model = symheli.linearize(ideal, symheli.trim(ideal, 6.0)).discretize(loops.dt)
    K = loops.commanded
    P = model.select(inputs=K.outputs, outputs=K.inputs[:5])
    x, k, y = np.zeros(len(P.A)), np.zeros(len(K.A)), []
    for _ in range(100):
        measured = P.C @ x
        y.append(measured[3])
        into = np.concatenate([measured, [1.0, 0.0, 0.0]])
        x, k = P.A @ x + P.B @ (K.C @ k + K.D @ into), K.A @ k + K.B @ into
    found = closed_loops(model, loops).step_response(99 * loops.dt)
    assert found.values[:100, 0, 0] == pytest.approx(np.array(y), abs=1e-10)
    # a disturbance of what is measured acts as the negative command
    assert found.values[:, 0, 3] == pytest.approx(-found.values[:, 0, 0], abs=1e-10)


@pytest.mark.slow
def test_bands_shrink_with_the_spread_of_the_helicopters(ideal, loops):
    """Parameters drawn a tenth as widely leave bands about a tenth as wide, down to the least."""
    rng = np.random.default_rng(0)
    z = rng.standard_normal((6, 3))
    names = ("body.Ixx", "body.Iyy", "main_rotor.bar_lock_number")

    def bands(deviation):
        drawn = [
            ideal.with_parameters(
                {
                    n: ideal.parameters[n] * np.exp(deviation * e)
                    for n, e in zip(names, row, strict=True)
                }
            )
            for row in z
        ]
        return loop_margins([ideal, *drawn], loops, [6.0])[0]

    wide, narrow = bands(0.1), bands(0.01)
    for name in ("gain", "bandwidth_3db", "rejection"):
        ratio = narrow.measures.banded(name)[1] / wide.measures.banded(name)[1]
        at_least = LEAST[name] / wide.measures.banded(name)[1]
        # a tenth, up to the curvature over +-20 %, or the least band
        assert max(0.07, at_least) * 0.99 <= ratio <= max(0.13, at_least) * 1.01, name
        assert ratio < 1.0, name


def test_a_higher_attitude_gain_raises_bandwidth_and_rejection(ideal, loops):
    (before, *_), (after, *_) = (
        loop_margins([ideal], one, [6.0])
        for one in (loops, loops.with_parameters({"ATC_ANG_RLL_P": 6.0}))
    )
    for name in ("bandwidth_3db", "rejection"):
        assert after.measures[name] > 1.1 * before.measures[name]
    assert set(RESPOND) == {"d_lat", "d_lon", "d_ped"}


def test_no_proof_where_a_frozen_loop_is_unstable(ideal, loops):
    found = stable_between([ideal], loops.with_parameters({"ATC_RAT_RLL_P": 0.6}), 4.0, 6.0, 1.0)
    assert not found.exact
    assert found.unstable == (5.0,)
    assert str(found).startswith("NOT PROVEN that the changed loops are stable for every V(t)")
    assert "a model frozen at some p is not stable" in str(found)
    with pytest.raises(InputError, match="a proof between airspeeds needs two of them"):
        stable_between([ideal], loops, 4.0, 4.0, 1.0)
