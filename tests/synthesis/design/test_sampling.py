"""Controllers sampled, and flown."""

import numpy as np
import pytest
from scheduled_plants import spring

import symheli
from symheli.errors import InputError
from synthesis import Plant, output_feedback, state_feedback
from synthesis.worst.frozen import norm


@pytest.fixture(scope="module")
def made():
    return output_feedback(spring())


def test_sampling_by_tustin_keeps_the_norm_at_every_condition(made):
    """The rule maps the imaginary axis onto the unit circle: the H-infinity norm of what is sampled
    is that of what was continuous, but for the functions of p fitted to it.
    """
    sampled = made.discretize(0.05)
    assert sampled.dt == 0.05
    for p in (0.0, 0.3, 0.8, 1.0):
        before, after = (c.model.matrices(p) for c in (made, sampled))
        assert norm(*after, 0.05)[0] == pytest.approx(norm(*before)[0], rel=1e-4)


def test_responses_agree_at_warped_frequencies(made):
    dt, p = 0.05, 0.4
    omega = np.array([0.5, 3.0, 12.0])
    sampled = made.discretize(dt).at(p).frequency_response(omega)
    warped = made.at(p).frequency_response(2 / dt * np.tan(omega * dt / 2))
    np.testing.assert_allclose(sampled, warped, rtol=1e-4)


def test_what_cannot_be_sampled(made):
    with pytest.raises(InputError, match=r"already sampled \(dt = 0.02 s\)"):
        made.discretize(0.02).discretize(0.02)
    with pytest.raises(InputError, match="dt: expected a positive number of seconds"):
        made.discretize(0.0)


# --- on the helicopter -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def roll(ideal):
    """Static feedback of roll attitude and rate of the lateral axis, hover to 6 m/s."""
    family = symheli.sweep(ideal, [0.0, 3.0, 6.0])
    lateral = family.select(["p", "phi", "b1"], ["d_lat"]).interpolate(degree=2)
    A, gain = lateral.A, lateral.B
    model = symheli.LPVStateSpace(
        lateral.basis,
        A,
        np.concatenate([gain, gain], axis=2),
        np.eye(1, len(A)).T[:, :, None] * np.vstack([[0, 1, 0], [0, 0, 0], np.eye(3)]),
        np.eye(1, len(A)).T[:, :, None] * np.array([[0, 0], [0, 5.0], *[[0, 0]] * 3]),
        lateral.parameters,
        lateral.states,
        ("gust", "d_lat"),
        ("z_phi", "z_lat", "p", "phi", "b1"),
    )
    plant = Plant(
        model,
        disturbances=["gust"],
        performance=["z_phi", "z_lat"],
        controls=["d_lat"],
        measurements=["p", "phi", "b1"],
    )
    return state_feedback(plant, rate=1.0)
