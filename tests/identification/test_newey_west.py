"""Covariances of sums of correlated terms, and of coefficients by instruments flown elsewhere."""

import numpy as np
import pytest
from known_vehicles import Vehicle

import identification as idn
from identification.estimators.newey_west import long_run_covariance


@pytest.mark.parametrize("cuts", [[], [1], [40, 41, 170]])
def test_it_is_the_sum_of_tapered_products_however_the_rows_come(cuts):
    g, lags = np.random.default_rng(0).normal(size=(200, 3)), 7
    expected = g.T @ g
    for lag in range(1, lags + 1):
        cross = (1 - lag / (lags + 1)) * g[:-lag].T @ g[lag:]
        expected += cross + cross.T
    found = long_run_covariance(np.split(g, cuts), lags)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("flights", [8])
def test_instruments_know_the_scatter_of_their_coefficients(flights):
    """Flights with noisy sensors: the errors, in standard errors, have the size of one."""
    vehicle, sensors = Vehicle(na=1, nb=1), np.array([0.02] * 3 + [0.005] * 3 + [0.002] * 2)
    off = []
    for seed in range(flights):
        record = vehicle.record(800, seed=seed, sensors=sensors)
        clean = vehicle.without_noise(seed=seed)
        found = idn.fit(vehicle.kin, record, idn.methods.InstrumentalVariables(clean))
        spread = np.sqrt(np.einsum("onon->no", found.covariance))
        off.append((found.theta - vehicle.theta) / spread)
    # 25 of 800 samples tapered leave a few percent out
    assert 0.85 < np.sqrt(np.mean(np.square(off))) < 1.25
