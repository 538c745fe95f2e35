"""The recursive estimator with known kinematics is batch least squares, gaps or not."""

import numpy as np
import pytest
from known_vehicles import CONTROLS, DT, STATES, Vehicle

import identification as idn
from identification.structure.regressors import regression
from symheli.errors import InputError

SENSORS = np.array([0.02] * 3 + [0.005] * 3 + [0.002] * 2)


@pytest.fixture(scope="module", params=[1, 2])
def vehicle(request):
    return Vehicle(na=request.param, nb=request.param)


@pytest.fixture(scope="module")
def flight(vehicle):
    """With a gap, and samples that were not measured: the first and two others."""
    record = vehicle.record(500, sensors=SENSORS)
    record = record.rows((np.arange(500) < 200) | (np.arange(500) > 220))
    columns = {s: record[s].copy() for s in (*STATES, *CONTROLS)}
    for column in columns.values():
        column[[0, 100, 300]] = np.nan
    return record.with_signals({s: s.unit for s in record.signals if s in columns}, **columns)


def samples(record):
    return zip(
        record.columns(STATES), record.columns(CONTROLS), record["airspeed_command"], strict=True
    )


def test_it_learns_from_every_regressor_of_the_batch_and_from_no_other(vehicle, flight):
    history = idn.RecursiveLeastSquares(vehicle.kin).run(flight)
    learnt = np.flatnonzero(np.isfinite(history.innovations).all(axis=1))
    aero = vehicle.kin.aerodynamics
    assert learnt.tolist() == regression(aero, aero.prepared(flight)).rows.tolist()
    batch = idn.fit(vehicle.kin, flight)
    # both solve the same normal equations; the factor is conditioned as the regressors
    condition = batch.aerodynamics.excitation.condition
    bound = 1e3 * np.finfo(float).eps * condition * np.abs(batch.theta).max()
    assert np.abs(history.model.theta - batch.theta).max() < bound
    np.testing.assert_allclose(history.model.trim, batch.trim, atol=1e-12)
    np.testing.assert_allclose(
        history.model.simulate(flight.rows(np.arange(len(flight)) > 350)),
        batch.simulate(flight.rows(np.arange(len(flight)) > 350)),
        atol=1e-6,
    )


def test_a_sample_with_anything_missing_is_a_missing_sample(vehicle):
    """Attitude too, which no regressor holds but both increments beside it."""
    record = vehicle.record(60)
    for name in ("phi", "d_lon", "w"):
        column = np.where(np.arange(60) == 30, np.nan, record[name])
        holed = record.with_signals({name: "1"}, **{name: column})
        holed = type(record)(record.time, holed.columns(record.signals), record.signals)
        history = idn.RecursiveLeastSquares(vehicle.kin).run(holed)
        lost = np.flatnonzero(np.isnan(history.innovations).any(axis=1)).tolist()
        memory = vehicle.kin.memory
        assert lost == [*range(memory), *range(30, 31 + memory)]


def test_online_is_run_sample_by_sample(vehicle, flight):
    rls = idn.RecursiveLeastSquares(vehicle.kin, forgetting=0.995)
    history, online = rls.run(flight), rls.online(dt=flight.dt)
    steps = np.diff(flight.time, prepend=flight.time[0])
    for k, sample in enumerate(samples(flight)):
        if steps[k] > 1.5 * DT:
            online.forget_past()
        learnt = online.update(*sample)
        assert learnt == bool(np.isfinite(history.innovations[k]).all())
        # increments by sin of one number and of an array differ by an ulp of the states
        np.testing.assert_allclose(online.coefficients, history.coefficients[k], atol=1e-9)


def test_a_refused_sample_is_a_start(vehicle, flight):
    online = idn.RecursiveLeastSquares(vehicle.kin).online(dt=flight.dt)
    given = list(samples(flight))[1:60]
    for sample in given[:40]:
        online.update(*sample)
    y, u, p = given[40]
    for wrong in ((np.inf * y, u, p), (y[:7], u, p), (y, u, 99.0), (y, u * np.inf, p)):
        for sample in given[:10]:
            online.update(*sample)
        with pytest.raises(InputError):
            online.update(*wrong)
        assert [online.update(*s) for s in given[41:45]] == [
            k >= vehicle.kin.memory for k in range(4)
        ]


def test_what_a_state_cannot_know_is_asked_for(vehicle, flight):
    rls = idn.RecursiveLeastSquares(vehicle.kin)
    with pytest.raises(InputError, match="need the sample period"):
        rls.online()
    with pytest.raises(InputError, match="needs the sample before"):
        rls.update(rls.init(), np.zeros(8), np.zeros(4), 3.0)


def test_a_second_flight_goes_on_from_the_state_of_the_first(vehicle, flight, tmp_path):
    rls = idn.RecursiveLeastSquares(vehicle.kin)
    second = vehicle.record(300, seed=5, sensors=SENSORS)
    rls.save(rls.run(flight).state, tmp_path / "s.json")
    both = rls.run(second, rls.load(tmp_path / "s.json")).model
    batch = idn.fit(vehicle.kin, [flight, second])
    condition = batch.aerodynamics.excitation.condition
    bound = 1e3 * np.finfo(float).eps * condition * np.abs(batch.theta).max()
    assert np.abs(both.theta - batch.theta).max() < bound
