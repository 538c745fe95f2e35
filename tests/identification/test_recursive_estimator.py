"""The square-root filter: equal to batch least squares, and alive when excitation stops."""

import numpy as np
import pytest
from known_systems import Truth, moving, structure

import identification as idn
from identification.structure.regressors import regression
from symheli import lpv
from symheli.errors import InputError


def test_recursive_and_batch_estimates_agree_on_noisy_data():
    truth = Truth(structure(outputs=("a", "b"), inputs=("u", "v"), offset=True))
    record = truth.record(moving(500), noise=0.3)
    batch, recursive = (
        idn.fit(truth.arx, record, method="ls"),
        idn.fit(truth.arx, record, method="rls"),
    )
    data = regression(truth.arx, record)
    # both are backward stable orthogonal methods: they differ by rounding times the condition
    # (below 1e3), not by its square
    np.testing.assert_allclose(
        data.phi @ recursive.theta,
        data.phi @ batch.theta,
        rtol=0,
        atol=1e-10 * np.abs(data.y).max(),
    )
    residual = data.phi.T @ (data.y - data.phi @ recursive.theta)
    assert np.abs(residual).max() < 1e-10 * np.abs(data.phi.T @ data.y).max()
    np.testing.assert_allclose(recursive.residual_covariance, batch.residual_covariance, rtol=1e-9)


@pytest.mark.parametrize(
    "over",
    [
        dict(),
        dict(outputs=("a", "b"), inputs=("u", "v"), na={"a": 3, "b": 1}, offset=True, delay=0),
    ],
)
@pytest.mark.parametrize(
    "basis", [idn.Polynomial(5, 0.0, 13.0), lpv.BSpline(3, (0.0, 4.0, 9.0, 13.0))]
)
def test_recursive_coefficients_differ_from_batch_by_rounding_times_condition(basis, over):
    truth = Truth(structure(basis=basis, **over))
    record = truth.record(moving(900), noise=0.3, noise_seed=50)
    batch, recursive = (idn.fit(truth.arx, record, method=m) for m in ("ls", "rls"))
    data = regression(truth.arx, record)
    size = np.abs(data.y).max()
    np.testing.assert_allclose(
        data.phi @ recursive.theta, data.phi @ batch.theta, rtol=0, atol=1e-10 * size
    )
    left = np.where(truth.arx.free, data.phi.T @ (data.y - data.phi @ recursive.theta), 0.0)
    assert np.abs(left).max() < 1e-10 * np.abs(data.phi.T @ data.y).max()
    scale = np.linalg.norm(data.phi, axis=0)[:, None]
    relative = np.linalg.norm((recursive.theta - batch.theta) * scale) / np.linalg.norm(
        batch.theta * scale
    )
    condition = batch.excitation.condition
    multiple = relative / (np.finfo(float).eps * condition)
    print(
        f"coefficients differ by {relative:.2e} = {multiple:.2f} x eps x condition"
        f" ({condition:.3g})"
    )
    assert multiple < 20  # measured 0.3 to 1.8


def slow_and_cold():
    """Degree 5 on 0-13 m/s, p through its range once in 3000 samples and nothing known before;
    noise 0.1, output 2.8 (rms).
    """
    truth = Truth(structure(basis=idn.Polynomial(5, 0.0, 13.0)))
    p = 6.5 - 6.4 * np.cos(2 * np.pi * np.arange(3000) / 3000)
    return truth, truth.record(p, noise=0.1, noise_seed=50)


def test_degree_five_with_forgetting_and_slow_airspeed_predicts_as_weighted_batch_does():
    """Raw monomials lose the textbook covariance here within 80 samples."""
    truth, record = slow_and_cold()
    history = idn.RecursiveLeastSquares(truth.arx, forgetting=0.99, floor=0.0).run(record)
    assert np.isfinite(history.coefficients).all()
    data = regression(truth.arx, record)
    weights = np.sqrt(0.99 ** np.arange(len(data.phi))[::-1])[:, None]
    batch = np.linalg.lstsq(weights * data.phi, weights * data.y, rcond=None)[0]
    window = slice(-300, None)  # older samples have no weight left to agree about
    np.testing.assert_allclose(
        data.phi[window] @ history.state.solve(), data.phi[window] @ batch, rtol=0, atol=1e-8
    )
    # 100 samples of a slow p fix the model where p is, not elsewhere: single coefficients reach
    # 7e6, predictions stay at the noise
    assert np.sqrt(np.mean(history.innovations[200:] ** 2)) < 0.15


def test_the_default_floor_does_no_harm_on_a_slow_cold_start():
    truth, record = slow_and_cold()
    history = idn.RecursiveLeastSquares(truth.arx, forgetting=0.99).run(record)
    assert np.sqrt(np.mean(history.innovations[200:] ** 2)) < 0.3


def test_coefficients_along_the_gain_equal_those_of_the_factor():
    truth = Truth(structure())
    history = idn.RecursiveLeastSquares(truth.arx, forgetting=0.995).run(
        truth.record(moving(700), noise=0.1)
    )
    # the gain accumulates 700 roundings, each damped by later data
    np.testing.assert_allclose(history.state.theta, history.state.solve(), rtol=0, atol=1e-9)
    np.testing.assert_array_equal(history.coefficients[-1], history.state.theta)


def test_forgetting_equals_weighted_least_squares():
    truth = Truth(structure())
    record = truth.record(moving(300), noise=0.2)
    state = idn.RecursiveLeastSquares(truth.arx, forgetting=0.98, floor=0.0).run(record).state
    data = regression(truth.arx, record)
    w = np.sqrt(0.98 ** np.arange(len(data.phi))[::-1])[:, None]
    expected = np.linalg.lstsq(w * data.phi, w * data.y, rcond=None)[0]
    np.testing.assert_allclose(state.theta, expected, rtol=0, atol=1e-9)


def test_run_is_update_sample_by_sample():
    truth = Truth(structure(offset=True, offset_rate=True))
    record = truth.record(moving(120), noise=0.1)
    values = record.values.copy()
    values[60, 0] = np.nan
    record = type(record)(record.time, values, record.signals)
    rls = idn.RecursiveLeastSquares(truth.arx, forgetting=0.99)
    history, state = rls.run(record), rls.init()
    for k in range(len(record)):
        state, info = rls.update(state, record["y"][k], record["u"][k], record["p"][k])
        np.testing.assert_array_equal(info.innovation, history.innovations[k])
        assert info.available == bool(np.isfinite(history.innovations[k]).all())
    np.testing.assert_array_equal(state.theta, history.state.theta)
    np.testing.assert_array_equal(state.past, history.state.past)


def test_a_missing_sample_teaches_nothing_and_empties_the_lags():
    truth = Truth(structure())
    rls = idn.RecursiveLeastSquares(truth.arx)
    state = rls.run(truth.record(moving(100))).state
    after, info = rls.update(state, np.nan, 0.0, 5.0)
    assert not info.available
    assert len(after.past) == 0
    assert after.factor is state.factor
    waits = []
    for _ in range(3):
        after, info = rls.update(after, 0.1, 0.2, 5.0)
        waits.append(info.available)
    assert waits == [False, False, True]


@pytest.mark.slow(but="0.9")
@pytest.mark.parametrize("forgetting", [0.9, 0.99])
def test_slow_scheduling_and_a_long_silence_wind_nothing_up(forgetting):
    """Constant forgetting without a floor reaches coefficients of 1e35 in other packages once
    excitation stops.
    """
    truth = Truth(structure())
    n, silence = 400, 4000
    p = np.concatenate([moving(n), np.full(silence, 6.0)])
    record = truth.record(p, noise=0.01)
    values = record.values.copy()
    values[n:, :2] = 1e-3 * np.random.default_rng(0).normal(
        size=(silence, 2)
    )  # noise only, far below what excited the filter
    history = idn.RecursiveLeastSquares(truth.arx, forgetting=forgetting).run(
        type(record)(record.time, values, record.signals)
    )
    state, size = history.state, np.abs(truth.theta).max()
    assert np.isfinite(history.coefficients).all()
    assert np.abs(history.coefficients[n:]).max() < 10 * size
    assert state.determined
    diagonal = np.abs(np.diagonal(state.factor))[: len(state.theta)]
    assert diagonal.min() > 1e-3 * np.sqrt(1e-3) * state.peak.min()
    rich = truth.record(moving(300), seed=5)
    again = idn.RecursiveLeastSquares(truth.arx, forgetting=forgetting).run(rich, state)
    # the filter still learns: 300 excited samples leave less than forgetting ** 300 of the silence,
    # and of 1/floor
    np.testing.assert_allclose(again.state.theta, truth.theta, atol=0.05 * size)


def test_wrong_samples_are_refused_by_name():
    rls = idn.RecursiveLeastSquares(structure())
    state = rls.init()
    with pytest.raises(InputError, match=r"y: expected shape \(1,\), got \(2,\)"):
        rls.update(state, [1.0, 2.0], 0.0, 5.0)
    with pytest.raises(InputError, match="u is infinite"):
        rls.update(state, 1.0, np.inf, 5.0)
    with pytest.raises(InputError, match="basis is declared on"):
        rls.update(state, 1.0, 0.0, 50.0)
    with pytest.raises(InputError, match="forgetting"):
        idn.RecursiveLeastSquares(structure(), forgetting=1.1)
