"""The bound of a truncation with constant Gramians holds while p moves."""

import math

import numpy as np
import pytest
import sympy

from symheli import LinearModel, LPVStateSpace, Scheduling
from symheli.errors import InputError, SynthesisError
from symheli.lpv import UserFunctions, balanced_truncation, parallel, series
from synthesis import l2_gain
from synthesis.designs import bounded_truncation

P = Scheduling("p", "1", low=0.0, high=1.0, rate=1.0)


def random_model(seed, n=5, shift=0.0):
    """Decays from 0.5 to 30 1/s, coupled, of which p moves a part; `shift` makes it unstable."""
    rng = np.random.default_rng(seed)
    skew = rng.normal(size=(n, n))
    A = skew - skew.T + np.diag(shift - np.geomspace(0.5, 30.0, n))
    A = [A, 0.3 * rng.normal(size=(n, n))]
    B = [rng.normal(size=(n, 1)), 0.3 * rng.normal(size=(n, 1))]
    return LPVStateSpace.polynomial(A, B, [rng.normal(size=(1, n))], [[[0.1]]], P)


@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)]
)
def test_the_gain_of_the_difference_is_below_the_bound_for_p_that_jumps(seed):
    full = random_model(seed)
    found = bounded_truncation(full, 3, balance="response")
    off = l2_gain(parallel(full, series(found.model, -1.0)), math.inf, search=None)
    assert off.verified
    assert off.lower <= off.gamma <= found.bound
    assert off.lower > 0.1 * found.bound  # and says something


@pytest.mark.parametrize("shift", [0.0, 1.6])
def test_no_frozen_nu_gap_is_above_the_bound_of_the_factors(shift):
    full = random_model(3, shift=shift)
    assert full.at(0.5).is_stable() == (shift == 0.0)
    found = bounded_truncation(full, 3, input_scale=0.5, output_scale=[2.0])
    assert 1e-3 < found.nu_gap.max() <= found.bound < 1


@pytest.mark.parametrize("balance", ["response", "factors"])
def test_of_a_constant_model_it_is_the_truncation_of_that(balance):
    frozen = random_model(0).at(0.3)
    one = balanced_truncation(frozen, 2, balance=balance)
    other = bounded_truncation(LPVStateSpace.constant(frozen), 2, balance=balance)
    # the solver stops within 1e-8 of the scaled Gramians
    np.testing.assert_allclose(other.singular_values, one.singular_values, rtol=1e-3, atol=1e-6)
    assert other.bound == pytest.approx(one.bound, rel=1e-3)


def test_what_has_no_bound_is_refused():
    sampled = random_model(0).discretize(0.1)
    wild = LPVStateSpace.polynomial(
        [[[-0.1, 1], [-1, -0.1]], [[0, 0], [-9, 0]]], [[[0], [1]]], [[[1, 0]]], [[[0]]], P
    )
    direct = LPVStateSpace.polynomial([-np.eye(2)], [[[0], [1]]], [[[1, 0]]], [[[0.0]], [[1.0]]], P)
    sines = LPVStateSpace.from_expressions(
        [[-2 + sympy.sin(P.symbol), 1], [0, -1]], [[1], [1]], [[1, 0]], [[0]], P
    )
    assert isinstance(sines.basis, UserFunctions)
    for model, balance, error, message in (
        (sampled, "response", InputError, "expected a continuous"),
        (sines, "response", InputError, "piecewise polynomial"),
        (direct, "factors", InputError, "the feedthrough depends"),
        (wild, "response", SynthesisError, "no constant Gramians"),
        (wild, "neither", InputError, "balance"),
        (random_model(0).at(0.0), "response", InputError, "expected a continuous"),
    ):
        with pytest.raises(error, match=message):
            bounded_truncation(model, 1, balance=balance)
    assert isinstance(random_model(0).at(0.0), LinearModel)
