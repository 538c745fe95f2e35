"""The prior about a simulator's coefficients: variances by marginal likelihood."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from identification.estimators.simulator_prior import LARGEST, LEAST, SimulatorPrior


def group(n, mean=2.0, size=3.0):
    return SimulatorPrior(np.full(n, mean), np.full(n, size), np.zeros(n, int), np.ones(1))


@pytest.mark.parametrize(("true", "information"), [(0.3, 50.0), (2.0, 5.0)])
def test_independent_measurements_give_the_closed_form(true, information):
    """z_i ~ N(0, t + 1/c): the maximum of the likelihood is at t = mean z^2 - 1/c."""
    rng, n = np.random.default_rng(0), 300
    z = np.sqrt(true) * rng.normal(size=n) + rng.normal(size=n) / np.sqrt(information)
    prior, normal, at = group(n), np.eye(n) * information / 9.0, np.zeros(n)
    prior.learn(normal, normal @ (2.0 + 3.0 * z - at), at)
    # the updates end where they change by a hundredth
    assert prior.variance[0] == pytest.approx(np.mean(z**2) - 1 / information, rel=0.02)


def test_correlated_measurements_give_the_maximum_of_the_marginal_likelihood():
    """Against a search over the density of y = X z + e, integrated over z in closed form."""
    rng = np.random.default_rng(1)
    X = rng.normal(size=(60, 12)) @ np.diag(np.logspace(0, -1, 12))
    y = X @ (0.7 * rng.normal(size=12)) + 0.5 * rng.normal(size=60)

    def loss(logarithm):
        S = np.exp(logarithm) * X @ X.T + 0.25 * np.eye(60)
        return np.linalg.slogdet(S)[1] + y @ np.linalg.solve(S, y)

    best = np.exp(minimize_scalar(loss, bounds=(-8.0, 4.0), method="bounded").x)
    prior = group(12, mean=0.0, size=1.0)
    prior.learn(X.T @ X / 0.25, X.T @ y / 0.25, np.zeros(12))
    assert prior.variance[0] == pytest.approx(best, rel=0.03)


def test_a_simulator_that_is_right_is_believed_and_one_that_is_wrong_is_not():
    n, normal = 8, 1e6 * np.eye(8)
    right, wrong = group(n), group(n)
    right.learn(normal, np.zeros(n), right.mean)
    wrong.learn(normal, normal @ np.full(n, 1e5), wrong.mean)
    assert right.variance[0] == LEAST
    assert wrong.variance[0] == LARGEST
    # what is left of the prior's pull on the wrong one: its share of the information
    assert wrong.precision().max() / 1e6 < 1e-12
