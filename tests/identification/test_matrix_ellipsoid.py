"""A Gaussian matrix of coefficients is in its ellipsoid at least as often as that says."""

import math
from fractions import Fraction

import numpy as np
import pytest

from identification.model import matrix_ellipsoid
from identification.model.matrix_ellipsoid import spectral_radius
from symheli.errors import InputError
from synthesis.numerics.polynomial.exact import exact, positive_definite

SIZES = [(12, 3), (6, 2), (5, 1)]


def correlated(n, m, seed=0):
    """A covariance (m, n, m, n) that is no product of one of outputs and one of regressors, in
    units that differ by four orders.
    """
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((m * n, 2 * m * n)) * np.geomspace(1e-2, 1e2, m * n)[:, None]
    return (root @ root.T).reshape(m, n, m, n)


def drawn(P, count, seed=1):
    """Gaussian matrices (count, n, m) of that covariance."""
    m, n = P.shape[:2]
    factor = np.linalg.cholesky(P.reshape(m * n, m * n))
    white = np.random.default_rng(seed).standard_normal((count, m * n))
    return (white @ factor.T).reshape(count, m, n).swapaxes(1, 2)


@pytest.mark.slow(only="12-3")
@pytest.mark.parametrize(("n", "m"), SIZES)
def test_the_matrix_is_inside_at_least_as_often_as_promised(n, m):
    P, count = correlated(n, m), 20000
    for probability in (0.5, 0.95):
        inside = matrix_ellipsoid(P, probability).contains(drawn(P, count)).mean()
        # three standard errors of a count
        assert inside > probability - 3 * math.sqrt(probability * (1 - probability) / count)


@pytest.mark.slow(only="12-3")
@pytest.mark.parametrize(("n", "m"), SIZES)
def test_a_radius_of_draws_is_smaller_and_keeps_the_promise_too(n, m):
    P, count = correlated(n, m), 20000
    found = matrix_ellipsoid(P, 0.95, draws=20000, seed=7)
    inside = found.contains(drawn(P, count)).mean()
    error = math.sqrt(0.95 * 0.05 / count)
    # both are counts of as many draws: the rank lies 4.75 standard errors up, and either scatters
    assert 0.95 - 3 * error < inside < 0.95 + 11 * error
    # the covariance of one output is a product: what is proven is exact there
    proven = matrix_ellipsoid(P, 0.95).bound
    assert found.bound < (proven if m > 1 else 1.02 * proven)


@pytest.mark.parametrize(("n", "m"), SIZES)
def test_the_cover_holds_in_exact_arithmetic(n, m):
    P = correlated(n, m)
    found = matrix_ellipsoid(P, 0.9)
    left, right = exact(found.left, Fraction), exact(found.right, Fraction)
    K = np.kron(right.T @ right, left @ left.T) * Fraction(found.inflation)
    assert positive_definite(K - exact(P.reshape(m * n, m * n), Fraction))


def test_a_matrix_gaussian_is_covered_by_itself():
    rng = np.random.default_rng(3)
    roots = rng.standard_normal((2, 2)), rng.standard_normal((4, 4))
    Sigma, V = (M @ M.T for M in roots)
    found = matrix_ellipsoid(np.einsum("ij,ab->iajb", Sigma, V), 0.9)
    assert found.inflation == pytest.approx(1.0, abs=1e-6)  # to the shift that keeps roots regular
    assert found.bound == pytest.approx(spectral_radius(4, 2, 0.9), rel=1e-6)
    own = np.kron(found.right.T @ found.right, found.left @ found.left.T)
    np.testing.assert_allclose(own, np.kron(Sigma, V), rtol=1e-6, atol=1e-6 * np.abs(own).max())


def test_units_of_coefficients_play_no_part():
    P = correlated(4, 2)
    unit = np.multiply.outer([1e-3, 1e4], [1e5, 1.0, 1e-6, 3.0])
    other = matrix_ellipsoid(P * unit[:, :, None, None] * unit, 0.9)
    assert other.bound == pytest.approx(matrix_ellipsoid(P, 0.9).bound, rel=1e-6)


def test_what_is_known_exactly_stays_so():
    P = correlated(3, 2)
    P[:, 1] = P[:, :, :, 1] = 0.0
    found = matrix_ellipsoid(P, 0.9)
    assert not np.any(found.left[1])
    error = np.zeros((3, 2))
    assert found.contains(error)
    error[1, 0] = 1e-9
    assert not found.contains(error)


@pytest.mark.parametrize(("n", "m"), [(30, 1), (30, 3), (8, 8), (1, 1)])
@pytest.mark.parametrize("probability", [0.3, 0.95, 0.999])
def test_the_radius_is_exceeded_no_more_often_than_said(n, m, probability):
    count = 20000
    norms = np.linalg.norm(np.random.default_rng(0).standard_normal((count, n, m)), 2, axis=(1, 2))
    beyond = np.mean(norms > spectral_radius(n, m, probability))
    error = math.sqrt(probability * (1 - probability) / count)
    assert beyond <= 1 - probability + 3 * error
    if min(n, m) == 1:  # chi-squared, exactly
        assert beyond == pytest.approx(1 - probability, abs=4 * error)


def test_wrong_covariances_are_refused():
    P = correlated(3, 2)
    with pytest.raises(InputError, match="expected the shape"):
        matrix_ellipsoid(P[:, :, :, :2], 0.9)
    with pytest.raises(InputError, match="symmetric"):
        matrix_ellipsoid(P + np.triu(np.ones((6, 6)), 1).reshape(P.shape), 0.9)
    with pytest.raises(InputError, match="known exactly"):
        matrix_ellipsoid(0 * P, 0.9)
    with pytest.raises(
        InputError, match=r"at least 270 to estimate a probability of 0\.95, got 200"
    ):
        matrix_ellipsoid(P, 0.95, draws=200)
    with pytest.raises(InputError, match="integer >= 0"):
        matrix_ellipsoid(P, 0.95, draws=-5)
    for probability in (0.0, 1.0, math.nan, True):
        with pytest.raises(InputError, match="probability"):
            matrix_ellipsoid(P, probability)
