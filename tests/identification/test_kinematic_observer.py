"""States in flight from noisy sensors: closer than the sensors, honest about how close."""

import numpy as np
import pytest
from known_vehicles import CONTROLS, STATES, Vehicle

import identification as idn
import symheli
from symheli.errors import AccuracyError, InputError, UnknownNameError

SENSORS = np.array([0.05] * 3 + [0.02] * 3 + [0.01] * 2)
NOISE = dict(zip(STATES, SENSORS.tolist(), strict=True))
PROCESS = 2e-3


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle()


@pytest.fixture(scope="module")
def flown(vehicle):
    """The states as they were and as they were measured, under equation noise."""
    record = vehicle.record(900, process=PROCESS)
    y = record.columns(STATES)
    blur = SENSORS * np.random.default_rng(7).normal(size=y.shape)
    columns = dict(zip(STATES, (y + blur).T, strict=True))
    units = {s: s.unit for s in record.signals if s in STATES}
    return y, record.with_signals(units, **columns)


def model_of(vehicle, record):
    return vehicle.model(vehicle.record(600))


@pytest.mark.slow
def test_the_error_is_that_of_its_own_covariance(vehicle, flown):
    """Normalized error squared, averaged over 870 samples of 8 states: 1 for a consistent filter,
    of a correlated sequence within 15 %.
    """
    truth, measured = flown
    observer = model_of(vehicle, measured).observer(NOISE, PROCESS)
    y, u, p = (measured.columns(c) for c in (STATES, CONTROLS, ["airspeed_command"]))
    squares, errors = [], []
    for k in range(len(y)):
        error = observer.step(y[k], u[k], p[k]) - truth[k]
        if k >= 30:
            squares.append(error @ np.linalg.solve(observer.covariance, error) / 8)
            errors.append(error)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.15)
    assert (np.std(errors, axis=0) < 0.7 * SENSORS).all()
    np.testing.assert_array_equal(observer.run(measured)[-1] - truth[-1], errors[-1])


@pytest.mark.slow
def test_a_missing_measurement_is_predicted_over(vehicle, flown):
    truth, measured = flown
    observer = model_of(vehicle, measured).observer(NOISE, PROCESS)
    holes = {s: measured[s].copy() for s in STATES}
    for name in STATES:
        holes[name][400:410] = np.nan
    holes["u"][600:650] = np.nan
    units = {s: s.unit for s in measured.signals if s in STATES}
    found = observer.run(measured.with_signals(units, **holes))
    assert np.isfinite(found).all()
    error = np.abs(found - truth) / SENSORS
    assert error[400:410].max() < 4
    assert error[600:650, 1:].max() < 4


@pytest.mark.slow
def test_a_gap_and_a_missing_input_start_anew(vehicle, flown):
    _, measured = flown
    observer = model_of(vehicle, measured).observer(NOISE, PROCESS)
    gap = measured.rows((np.arange(900) < 300) | (np.arange(900) >= 330))
    found, memory = observer.run(gap), vehicle.kin.memory
    y = gap.columns(STATES)
    for start in (0, 300):
        np.testing.assert_array_equal(found[start : start + memory], y[start : start + memory])
        assert (found[start + memory] != y[start + memory]).all()
    unknown = np.where(np.arange(900) == 500, np.nan, measured["d_lon"])
    found = observer.run(measured.with_signals({"d_lon": "rad"}, d_lon=unknown))
    y = measured.columns(STATES)
    np.testing.assert_array_equal(found[500 : 501 + memory], y[500 : 501 + memory])
    after = measured.rows(np.arange(900) > 500)
    np.testing.assert_array_equal(found[501:], observer.run(after))


@pytest.mark.slow
def test_in_a_simulated_flight_it_is_closer_than_the_sensors(ideal):
    """A helicopter whose flapping the model does not know, identified from another noisy flight."""
    plan = symheli.AirspeedSchedule((6.0, 2.0), (1.5, 1.5), (2.0, 2.0), start=2.0)
    clean, noisy, training = (
        symheli.fly(
            ideal,
            plan,
            noise_db=db,
            seed=seed,
            excitation=symheli.Excitation(dict.fromkeys(ideal.inputs, 0.01), seed=excited),
        )
        for db, seed, excited in ((None, 1, 1), (30.0, 1, 1), (30.0, 2, 2))
    )
    kin = idn.KinematicARX(ideal.inputs, "airspeed_command", basis=idn.Polynomial(1, 2.0, 6.0))
    source = idn.methods.InstrumentalVariables(symheli.flight.SimulatedFlight(ideal))
    model = idn.fit(kin, training, source)
    truth, measured = clean.columns(STATES), noisy.columns(STATES)
    sensors = np.std(measured - truth, axis=0)
    found = model.observer(dict(zip(STATES, sensors, strict=True)), 0.01).run(noisy)
    late = slice(50, None)
    rms = np.sqrt(np.mean((found - truth)[late] ** 2, axis=0))
    assert (rms < sensors).all()


def test_what_it_must_be_told_is_asked_for(vehicle, flown):
    model = model_of(vehicle, flown[1])
    with pytest.raises(InputError, match="process: give the standard deviation"):
        model.observer(NOISE)
    with pytest.raises(InputError, match="none given for theta"):
        model.observer({s: 0.1 for s in STATES[:-1]}, PROCESS)
    with pytest.raises(UnknownNameError, match="velocity in process"):
        model.observer(NOISE, {"phi": 0.1})
    with pytest.raises(InputError, match="expected positive"):
        model.observer(NOISE, -1.0)
    with pytest.raises(InputError, match="declare the basis over the whole range"):
        model.observer(NOISE, PROCESS).run(
            flown[1].with_signals({"airspeed_command": "m/s"}, airspeed_command=np.full(900, 99.0))
        )


@pytest.mark.slow(but="1e+100")
@pytest.mark.parametrize("size", [1e100, 1e300])
def test_an_estimate_that_leaves_the_range_of_numbers_is_refused_and_begun_anew(
    vehicle, flown, size
):
    """NaN from there on, or LinAlgError."""
    _, measured = flown
    observer = model_of(vehicle, measured).observer(NOISE, PROCESS)
    with pytest.raises(AccuracyError, match="range of numbers"):
        observer.run(measured.with_signals({"q": "rad/s"}, q=np.full(len(measured), size)))
    y, u, p = (measured.columns(c)[0] for c in (STATES, CONTROLS, ["airspeed_command"]))
    np.testing.assert_array_equal(observer.step(y, u, p), y)
