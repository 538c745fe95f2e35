"""h steps ahead and free runs, against the recursion written out."""

import time
from dataclasses import replace

import numpy as np
import pytest
from known_systems import Truth, flown, moving, structure

import identification as idn
from identification.structure.regressors import regression
from symheli.errors import InputError

STRUCTURES = {
    "lag": dict(
        outputs=("a", "b"), inputs=("u",), na=3, nb=2, delay=1, offset=True, offset_rate=True
    ),
    "now": dict(
        outputs=("a", "b"), inputs=("u",), na=3, nb=1, delay=2, offset=True, scheduling_at="now"
    ),
}


def fitted(name, n=260):
    truth = Truth(structure(**STRUCTURES[name]))
    record = truth.record(moving(n), noise=0.2)
    return idn.fit(truth.arx, record), record


@pytest.mark.parametrize("name", STRUCTURES)
def test_one_step_prediction_is_the_regressor_times_the_coefficients(name):
    model, record = fitted(name)
    data = regression(model.structure, record)
    # rounding only: the same sums in another order
    np.testing.assert_allclose(
        model.predict(record, horizon=1)[data.rows], data.phi @ model.theta, atol=1e-12
    )


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("horizon", [2, 3, 7])
def test_prediction_is_a_free_run_started_horizon_samples_before(name, horizon):
    model, record = fitted(name)
    ahead, memory = model.predict(record, horizon=horizon), model.structure.memory
    for start in (memory, memory + 1, 90, 200):
        free = model.simulate(record.rows(slice(start - memory, None)))
        target = start + horizon - 1
        np.testing.assert_allclose(ahead[target], free[memory + horizon - 1], atol=1e-11)
    assert np.isnan(ahead[: memory + horizon - 1]).all()
    assert np.isfinite(ahead[memory + horizon - 1 :]).all()


def test_longer_horizons_reach_the_free_run():
    model, record = fitted("lag")
    last = len(record) - model.structure.memory
    np.testing.assert_allclose(
        model.predict(record, horizon=last)[-1], model.simulate(record)[-1], atol=1e-11
    )


def test_nothing_is_predicted_across_a_gap_or_a_missing_sample():
    model, record = fitted("lag")
    values, t = record.values.copy(), record.time.copy()
    t[100:] += 3.0
    values[150, 2] = np.nan
    holed = type(record)(t, values, record.signals)
    ahead, free = model.predict(holed, horizon=4), model.simulate(holed)
    assert np.isnan(ahead[100 : 100 + 3 + 3]).all()
    assert np.isfinite(ahead[106:150]).all()
    # the input at 150 enters y(151) and y(152) directly, predictions of up to 4 steps start behind
    # it
    assert np.isnan(ahead[151:156]).all()
    assert np.isfinite(ahead[156:]).all()
    assert np.isnan(free[100:103]).all()
    assert np.isnan(free[151:153]).all()
    assert np.isfinite(free[153:]).all()


def test_a_missing_output_does_not_stop_a_free_run():
    model, record = fitted("now")
    values = record.values.copy()
    values[50:60, 0] = np.nan
    np.testing.assert_array_equal(
        model.simulate(type(record)(record.time, values, record.signals)), model.simulate(record)
    )


def test_divergence_is_flagged_as_infinite_without_warnings():
    arx = structure(na=1, nb=1)
    p, u = moving(3000), np.random.default_rng(0).normal(size=(3000, 1))
    stable = flown(arx, [lambda q: np.array([[-0.5]])], [lambda q: np.array([[1.0]])], p, u)
    model = idn.fit(arx, stable)
    explosive = replace(model, theta=4.0 * model.theta)
    free = explosive.simulate(stable)
    assert np.isnan(free[0])
    assert np.isinf(free[-1])
    assert float(explosive.score(stable)["y"]) == -np.inf
    assert np.isinf(explosive.predict(stable, horizon=800)).any()


def test_fifty_steps_on_six_thousand_samples_take_well_under_a_second():
    truth = Truth(structure(outputs=("a", "b", "c", "d"), inputs=("u", "v"), na=3))
    record = truth.record(moving(700), noise=0.1)
    long = type(record)(0.1 * np.arange(6300), np.tile(record.values, (9, 1)), record.signals)
    model = idn.fit(truth.arx, record)
    start = time.perf_counter()
    assert np.isfinite(model.predict(long, horizon=50)[100:]).all()
    assert time.perf_counter() - start < 2.0  # 0.15 s when measured; generous for a busy machine


def test_fit_percent_is_100_for_the_data_and_0_for_their_mean():
    y = np.array([[1.0, 2.0], [3.0, 5.0], [np.nan, 1.0], [2.0, 2.0]])
    np.testing.assert_array_equal(idn.judge.fit_percent(y, y), [100.0, 100.0])
    mean = np.broadcast_to(np.nanmean(y, axis=0), y.shape)
    np.testing.assert_allclose(idn.judge.fit_percent(y, mean), [0.0, 0.0], atol=1e-12)
    assert np.isnan(idn.judge.fit_percent(np.full(3, np.nan), np.zeros(3)))
    with pytest.raises(InputError, match="one shape"):
        idn.judge.fit_percent(y, y[:, 0])


def test_another_sample_period_or_horizon_is_refused():
    model, record = fitted("lag")
    with pytest.raises(InputError, match="resample"):
        model.predict(record.resample(0.05), horizon=1)
    with pytest.raises(InputError, match="horizon"):
        model.predict(record, horizon=0)
