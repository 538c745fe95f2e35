"""The nu-gap against closed forms and its defining properties."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symheli import LinearModel
from symheli.errors import InputError
from symheli.lpv import nu_gap
from symheli.lpv.nu_gap import STRIDE, _orthonormal, angles
from symheli.lpv.tools import LinearModels, chordal_distance, nu_gaps
from symheli.values import signals


def model(A, B, C, D, dt=0.1):
    return LinearModel(
        A, B, C, D, signals([f"x{i}" for i in range(len(A))]), signals(["u"]), signals(["y"]), dt=dt
    )


def gain(k):
    return model(np.array([[0.5]]), np.zeros((1, 1)), np.zeros((1, 1)), np.array([[k]]))


def pole(a, b=1.0):
    return model(np.array([[a]]), np.array([[b]]), np.array([[1.0]]), np.zeros((1, 1)))


def test_two_gains_are_as_far_apart_as_their_points_on_the_sphere():
    a, b = 0.5, 3.0
    assert nu_gap(gain(a), gain(b)) == pytest.approx(
        abs(a - b) / np.sqrt((1 + a**2) * (1 + b**2)), rel=1e-12
    )


def test_distance_is_zero_to_itself_and_symmetric():
    one, two = pole(0.9, 0.3), pole(0.8, 0.5)
    assert nu_gap(one, one) == pytest.approx(0, abs=1e-9)
    assert nu_gap(one, two) == pytest.approx(nu_gap(two, one), rel=1e-9)


def test_a_slightly_stable_and_a_slightly_unstable_pole_are_close_for_feedback():
    """High gain at low frequency: both look like an integrator; the open-loop difference would be
    unbounded.
    """
    assert nu_gap(pole(0.999), pole(1.001)) < 0.05


def test_a_stable_and_a_far_unstable_plant_of_small_gain_are_as_far_as_can_be():
    assert nu_gap(pole(0.5, 0.01), pole(1.5, 0.01)) == 1.0


def test_scaling_channels_is_the_same_as_scaling_the_models():
    assert nu_gap(
        pole(0.9, 3.0), pole(0.8, 5.0), input_scale=0.1, output_scale=2.0
    ) == pytest.approx(nu_gap(pole(0.9, 3.0 * 0.1 / 2.0), pole(0.8, 5.0 * 0.1 / 2.0)), rel=1e-12)


def test_chordal_distance_never_exceeds_the_gap():
    omega = np.geomspace(0.01, 30, 50)
    one, two = pole(0.9, 0.3), pole(0.8, 0.5)
    assert chordal_distance(one, two, omega).max() <= nu_gap(one, two) * (1 + 1e-6)


def test_models_of_other_signals_have_no_distance():
    one = pole(0.5)
    other = replace(one, inputs=signals(["another"]))
    for distance in (nu_gap, lambda a, b: chordal_distance(a, b, [1.0])):
        with pytest.raises(InputError, match="same inputs and outputs in the same order"):
            distance(one, other)


def test_models_that_cannot_be_compared_are_refused():
    with pytest.raises(InputError, match="sample period"):
        nu_gap(
            pole(0.9),
            model(np.array([[0.9]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), dt=0.2),
        )
    with pytest.raises(InputError, match="stability boundary"):
        nu_gap(pole(1.0), pole(0.5))


def test_continuous_models_are_as_far_apart_as_their_closed_forms():
    """1/(s - a) and 1/(s + a), MATLAB's example of gapmetric with .0020, differ most at rest."""
    one, other = (
        replace(model(np.array([[a]]), np.eye(1), np.eye(1), np.zeros((1, 1)), 0.1), dt=None)
        for a in (1e-3, -1e-3)
    )
    assert nu_gap(one, other) == pytest.approx(2e3 / (1 + 1e6), rel=1e-9)
    assert nu_gaps(one, LinearModels.of([one, other])) == pytest.approx(
        [0, 2e3 / (1 + 1e6)], abs=1e-7
    )
    with pytest.raises(InputError, match=r"continuous, 0\.1 s"):
        nu_gap(one, pole(0.5))


def lag(dt, slow=0.01):
    """1/(s + slow), sampled with a hold."""
    return model(
        np.array([[np.exp(-slow * dt)]]),
        np.array([[-np.expm1(-slow * dt) / slow]]),
        np.eye(1),
        np.zeros((1, 1)),
        dt,
    )


def test_the_gap_does_not_depend_on_how_finely_a_slow_pole_is_sampled():
    """A pole 1e-10 inside the circle was once taken to lie on it, and frequencies below 1e-3 rad/s
    were never looked at.
    """
    expected = nu_gap(lag(1e-2), lag(1e-2, 0.03))
    for dt in (1e-4, 1e-8):
        # a hold of 1e-2 s differs from none by half a sample's phase at the crossover of 1 rad/s
        assert nu_gap(lag(dt), lag(dt, 0.03)) == pytest.approx(expected, rel=1e-2)


def test_turns_at_the_sharpest_resonance_are_counted():
    """k/(s^2 + 2 z s + 1) with z = 1e-7 and -1e-7: both are at infinity on the sphere where they
    differ, so they are close.
    """

    def resonance(damping, dt=0.1):
        A = np.array([[0.0, 1.0], [-1.0, -2 * damping]])
        inverse = np.linalg.inv(np.eye(2) - 0.5 * dt * A)
        B = inverse @ np.array([[0.0], [dt]])
        C = np.array([[1.0, 0.0]]) @ inverse
        return model(
            inverse @ (np.eye(2) + 0.5 * dt * A), B, C, 0.5 * np.array([[1.0, 0.0]]) @ B, dt
        )

    assert nu_gap(resonance(1e-7), resonance(-1e-7)) < 1e-5


def test_sample_periods_that_are_equal_but_for_rounding_are_equal():
    assert nu_gap(lag(0.02), lag(0.019999999999999574)) == pytest.approx(0, abs=1e-9)


def plants(seed, states=6, inputs=2, outputs=3):
    """A lightly damped plant of random modes, and one near it."""
    rng = np.random.default_rng(seed)
    A = np.zeros((states, states))
    for i in range(0, states, 2):
        radius, angle = 1 - 10 ** rng.uniform(-5, -0.5), rng.uniform(0.01, 3.0)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        A[i : i + 2, i : i + 2] = radius * turn
    names = [
        signals([f"{kind}{i}" for i in range(n)])
        for kind, n in zip("xuy", (states, inputs, outputs), strict=True)
    ]
    B, C = rng.standard_normal((states, inputs)), rng.standard_normal((outputs, states))
    one = LinearModel(A, B, C, 0.1 * rng.standard_normal((outputs, inputs)), *names, dt=0.02)
    size = 10 ** rng.uniform(-4, -1)
    return one, replace(one, B=B + size * rng.standard_normal(B.shape))


def plain(one, other, points):
    """Chordal distances at every frequency, by dense solves and matrix square roots."""

    def root(P):
        values, vectors = np.linalg.eigh(np.eye(P.shape[1]) + P @ P.conj().swapaxes(1, 2))
        return (vectors / np.sqrt(values)[:, None]) @ vectors.conj().swapaxes(1, 2)

    omega = angles(np.concatenate([one.poles(), other.poles()]), points) / one.dt
    P1, P2 = (model.frequency_response(omega) for model in (one, other))
    apart = root(P2) @ (P1 - P2) @ root(P1.conj().swapaxes(1, 2))
    return np.linalg.norm(apart, ord=2, axis=(1, 2))


@pytest.mark.parametrize("shape", [(6, 1, 1), (6, 2, 3), (8, 4, 2)])
def test_the_gap_is_the_largest_distance_at_all_frequencies(shape):
    for seed in range(8):
        one, other = plants(seed, *shape)
        every = plain(one, other, 200).max()
        assert nu_gap(one, other, points=200) == pytest.approx(every, rel=1e-9, abs=1e-13)


@pytest.mark.parametrize("seed", [7, 9, 17, 24])
def test_a_peak_between_the_frequencies_that_come_first_is_found(seed):
    one, other = plants(seed, 6, 1, 1)
    every = plain(one, other, 200)
    assert max(every[:-1:STRIDE].max(), every[-1]) < 0.6 * every.max()
    assert nu_gap(one, other, points=200) == pytest.approx(every.max(), rel=1e-9)


@pytest.mark.parametrize("gain", [1.0, 1e4, 1e10])
def test_bases_are_orthonormal_where_the_gain_is_of_rank_one(gain):
    """As near an integrator: one projection of 1e10 would leave errors of 1e-6."""
    rng = np.random.default_rng(0)
    P = gain * rng.standard_normal((3, 1, 5)) * rng.standard_normal((1, 3, 5))
    Q = _orthonormal(P + rng.standard_normal((3, 3, 5)) + 0j)
    for k in range(5):
        np.testing.assert_allclose(Q[:, :, k].conj().T @ Q[:, :, k], np.eye(3), atol=1e-12)
