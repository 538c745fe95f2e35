"""A parameter seen through a lag: the same model at p = q + T dq/dt."""

import math

import numpy as np
import pytest

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import PiecewiseLinear
from symheli.lpv.tools import lagged

T, RATE = 0.2, 0.5


def cubic(rate=RATE):
    rng = np.random.default_rng(0)
    each = ([rng.standard_normal(s) for _ in range(4)] for s in ((2, 2), (2, 1), (1, 2), (1, 1)))
    return LPVStateSpace.polynomial(*each, Scheduling("p", "m/s", 1.0, 3.0, rate=rate), dt=None)


def test_it_is_the_same_model_at_p_wherever_p_is_in_its_range():
    lpv = cubic()
    slow = lagged(lpv, T)
    rng = np.random.default_rng(1)
    for q, r in zip(rng.uniform(1.1, 2.9, 20), rng.uniform(-RATE, RATE, 20), strict=True):
        for found, expected in zip(slow.matrices([q, r]), lpv.matrices(q + T * r), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-10)


def test_the_rate_of_the_first_is_the_second():
    q, r = lagged(cubic(), T).parameters
    assert (q.name, q.rate) == ("p_lagged", r.name)
    assert (q.low, q.high) == (1.0, 3.0)
    assert (r.low, r.high, r.rate) == (-RATE, RATE, 2 * RATE / T)
    assert r.unit == "m/s^2"


def test_the_bounds_hold_along_every_p_within_its_rate():
    """Random p(t), the lag by small steps: r within the rate, dr/dt = (dp/dt - r)/T within twice
    that.
    """
    rng, dt = np.random.default_rng(2), 1e-3
    rates = np.repeat(rng.choice([-RATE, RATE], 200), 50)
    p = 2.0 + np.clip(np.cumsum(rates) * dt, -1, 1)
    q = np.empty_like(p)
    q[0] = p[0]
    for k in range(1, len(p)):
        q[k] = q[k - 1] + dt / T * (p[k - 1] - q[k - 1])
    r = (p - q) / T
    slack = 1 + 2 * dt / T  # of the steps
    assert np.abs(r).max() <= RATE * slack
    assert np.abs(np.diff(r) / dt).max() <= 2 * RATE / T * slack
    assert 1.0 <= q.min()
    assert q.max() <= 3.0


@pytest.mark.parametrize("seconds", [0.0, -1.0, math.inf, math.nan])
def test_a_lag_is_a_positive_number_of_seconds(seconds):
    with pytest.raises(InputError, match="lag: expected a number of seconds > 0"):
        lagged(cubic(), seconds)


@pytest.mark.parametrize("rate", [0.0, math.inf])
def test_the_rate_must_be_known(rate):
    with pytest.raises(InputError, match="needs the rate of p, > 0 and finite"):
        lagged(cubic(rate), T)


def test_only_polynomials_go_beyond_their_range():
    table = LPVStateSpace(
        PiecewiseLinear((1.0, 3.0)),
        *(np.zeros((2, a, b)) for a, b in ((1, 1), (1, 1), (1, 1), (1, 1))),
        Scheduling("p", "m/s", 1.0, 3.0, rate=RATE),
        ("x",),
        ("u",),
        ("y",),
    )
    with pytest.raises(InputError, match="interpolate with kind='polynomial'"):
        lagged(table, T)
