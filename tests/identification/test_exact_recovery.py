"""Noise-free data give the coefficients back, whatever the number of inputs and outputs."""

import numpy as np
import pytest
from known_systems import Truth, flown, moving, structure

import identification as idn

# 1e-9: the condition of these regressors stays below 1e4, and rounding enters at 1e-16 of signals of size 1-10
EXACT = dict(rtol=0, atol=1e-9)

SHAPES = {
    "siso": dict(outputs=("y",), inputs=("u",)),
    "simo": dict(outputs=("theta", "w", "u"), inputs=("d_lon",)),
    "timo": dict(outputs=("theta", "w", "u"), inputs=("d_lon", "d_col")),
    "mimo": dict(outputs=("v", "r"), inputs=("d_lat", "d_ped"), na=2, nb=2, delay=0),
    "offsets": dict(outputs=("theta", "u"), inputs=("d_lon",), offset=True, offset_rate=True),
    "one output of the past only": dict(inputs=(), nb=0, offset=True, na=1),
}


@pytest.mark.parametrize("method", ["ls", "rls"])
@pytest.mark.parametrize("at", ["lag", "now"])
@pytest.mark.parametrize("shape", SHAPES)
def test_noise_free_record_gives_the_coefficients_back(shape, at, method):
    truth = Truth(structure(**SHAPES[shape], scheduling_at=at))
    model = idn.fit(truth.arx, truth.record(moving(400)), method=method)
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)


@pytest.mark.parametrize("method", ["ls", "rls"])
def test_the_papers_structure_is_recovered_from_the_papers_parameter_trajectory(method):
    """na=3, one input coefficient at lag 2, quadratic in p, p from sin(pi k/3): Budiyono and Sutarto, eqs 13-15."""
    arx = structure(outputs=("theta", "w", "u"), inputs=("d_lon",), na=3, nb=1, delay=2, scheduling_at="now")
    truth = Truth(arx)
    p = 6.5 * (1 + np.sin(np.pi * np.arange(500) / 3))
    model = idn.fit(arx, truth.record(p), method=method)
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)
    assert model.excitation.distinct == 3


def test_a_discrete_polynomial_system_with_its_state_as_output_comes_back_exactly():
    """x(k+1) = A(p(k)) x(k) + B(p(k)) u(k) is the order-1 structure with coefficients at the lag."""
    rng = np.random.default_rng(3)
    A0, A1, A2 = 0.4 * rng.uniform(-1, 1, (3, 4, 4)) / [[[1.0]], [[13.0]], [[169.0]]]
    B0, B1 = rng.uniform(-1, 1, (2, 4, 2)) / [[[1.0]], [[13.0]]]

    def A(p):
        return A0 + p * A1 + p**2 * A2

    def B(p):
        return B0 + p * B1

    arx = structure(outputs=("u", "w", "q", "theta"), inputs=("d_lon", "d_col"), na=1, nb=1, delay=1)
    p = moving(600)
    record = flown(arx, [lambda q: -A(q)], [B], p, rng.normal(size=(600, 2)))
    lpv = idn.fit(arx, record).to_state_space()
    assert lpv.states == arx.outputs
    for q in (0.0, 4.2, 13.0):
        np.testing.assert_allclose(lpv.at(q).A, A(q), **EXACT)
        np.testing.assert_allclose(lpv.at(q).B, B(q), **EXACT)


def test_coefficients_read_as_monomials_in_physical_units():
    arx = structure(na=1, nb=1)
    record = flown(
        arx, [lambda p: np.array([[-0.5 - 0.03 * p + 0.002 * p**2]])], [lambda p: np.array([[1 - 0.05 * p]])], moving(), _noise(700)
    )
    found = idn.fit(arx, record).coefficients.monomial()
    np.testing.assert_allclose(found.A[0, :, 0, 0], [-0.5, -0.03, 0.002], **EXACT)
    np.testing.assert_allclose(found.B[0, :, 0, 0], [1, -0.05, 0], **EXACT)


def test_two_records_are_fitted_together_without_reaching_from_one_to_the_other():
    truth = Truth(structure())
    model = idn.fit(truth.arx, [truth.record(moving(80), seed=1), truth.record(moving(90)[::-1].copy(), seed=2)])
    assert model.rows_used == 80 + 90 - 2 * truth.arx.memory
    np.testing.assert_allclose(model.theta, truth.theta, **EXACT)


def test_missing_samples_and_gaps_cost_rows_but_not_exactness():
    truth = Truth(structure())
    record = truth.record(moving(300))
    values = record.values.copy()
    values[50, 0] = values[120, 1] = values[200, 2] = np.nan
    time = record.time.copy()
    time[150:] += 5.0
    holed = type(record)(time, values, record.signals)
    for method in ("ls", "rls"):
        model = idn.fit(truth.arx, holed, method=method)
        # y missing: itself and two lags; u: two lags (delay 1); p: all terms at lags 1, 2; two starts of two samples
        assert model.rows_dropped == 3 + 2 + 2 + 4
        np.testing.assert_allclose(model.theta, truth.theta, **EXACT)


def _noise(n):
    return np.random.default_rng(9).normal(size=(n, 1))
