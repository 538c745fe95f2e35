"""A flight that the model, with the noise it was identified with, cannot have made."""

from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import STATES, Vehicle

import identification as idn
from identification.estimators.residual_power import BANDS, window_powers
from identification.judge import unseen_flight as judge
from symheli.errors import InputError

SENSORS = np.array([0.02] * 3 + [0.005] * 3 + [0.002] * 2)
NOISE = dict(zip(STATES, SENSORS.tolist(), strict=True))


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle(na=1, nb=1)


@pytest.fixture(scope="module")
def model(vehicle):
    method = idn.methods.FilterError(vehicle.without_noise(seed=1), noise=NOISE)
    return idn.fit(vehicle.kin, vehicle.record(1600, seed=1, sensors=SENSORS), method)


@pytest.mark.slow
def test_other_flights_of_the_vehicle_are_explained(vehicle, model):
    """Ten of them: what is left is chi-squared, three standard deviations are rarely passed."""
    judged = [
        idn.judge.validate(model, vehicle.record(300, seed=s, sensors=SENSORS))
        for s in range(10, 20)
    ]
    assert sum(flight.explained for flight in judged) >= 9
    allowed = np.mean([flight.largest for flight in judged])
    assert 0.8 < np.mean([flight.power for flight in judged]) < allowed


def test_louder_sensors_and_another_vehicle_are_not(vehicle, model):
    assert not idn.judge.validate(
        model, vehicle.record(300, seed=5, sensors=1.2 * SENSORS)
    ).explained
    other = Vehicle(na=1, nb=1)
    other.theta = vehicle.theta * 1.3
    found = idn.judge.validate(model, other.record(300, seed=5, sensors=SENSORS))
    with pytest.raises(InputError, match=r"\(residual power is .* no certificate about it holds"):
        found.require()


@pytest.mark.slow
def test_noise_of_its_own_size_in_every_flight_is_no_other_vehicle(vehicle):
    """Noise so many decibels below the signals is louder in a livelier flight: two flights pooled
    to one level made every third unlikely.
    """
    method = idn.methods.FilterError(vehicle.without_noise(seed=1))
    flights = [vehicle.record(800, seed=s, sensors=k * SENSORS) for s, k in ((1, 1.0), (2, 2.0))]
    model = idn.fit(vehicle.kin, flights, method)
    other = Vehicle(na=1, nb=1)
    other.theta = vehicle.theta * 1.3
    for loud in (0.7, 1.5, 3.0):
        found, wrong = (
            idn.judge.validate(model, one.record(600, seed=7, sensors=loud * SENSORS))
            for one in (vehicle, other)
        )
        assert 0.7 < found.power < found.largest < 1.5
        assert not wrong.explained


def test_a_model_that_does_not_know_its_noise_is_refused(vehicle, model):
    record = vehicle.record(300, seed=5, sensors=SENSORS)
    with pytest.raises(InputError, match="fit by FilterError"):
        idn.judge.validate(idn.fit(vehicle.kin, record), record)
    with pytest.raises(InputError, match="shorter than 1 s"):
        idn.judge.validate(model, record.rows(np.arange(300) < 12))


def test_the_noise_it_judges_by_is_kept_in_files(model, vehicle, tmp_path):
    record = vehicle.record(300, seed=5, sensors=SENSORS)
    again = idn.model.KinematicModel.load(model.save(tmp_path / "model.json"))
    assert idn.judge.validate(again, record) == idn.judge.validate(model, record)
    assert replace(again, trim=model.trim).details == model.details


DT, LONG = 0.02, 1000


def white(seed, windows=1):
    return np.random.default_rng(seed).standard_normal((windows * LONG, 8))


def test_power_by_band_is_one_for_white_noise_and_stays_in_its_band():
    found = window_powers([white(1, 6), white(2, 2)[:-1]], DT)
    assert found.shape == (7, len(BANDS) - 1, 8)
    assert np.abs(found.mean(axis=0) - 1).max() < 0.4  # 7 windows of 20 lines: 4.7 deviations
    slow = np.zeros((LONG, 8))
    slow[:, 2] = np.sin(2 * np.pi * 0.5 * DT * np.arange(LONG))
    bands = window_powers([slow], DT)[0]
    assert bands[0, 2] > 1e6 * bands[1:, 2].max()
    assert not bands[:, [0, 1, 3]].any()
    assert window_powers([white(1)[:-1]], DT).shape == (0, len(BANDS) - 1, 8)


def test_bands_refuse_one_flight_of_a_hundred_and_find_what_is_slow():
    known = window_powers([white(1, 8)], DT)
    refused = sum(
        bool(judge._unlikely(known, [white(s)], DT, np.zeros(8))) for s in range(100, 200)
    )
    assert refused <= 4  # binomial, .01: more than 4 of 100 in three of a thousand
    # power 1.05 in all, but half a band's in one equation
    slow = white(300)
    slow[:, 3] += 1.3 * np.sin(2 * np.pi * 0.5 * DT * np.arange(LONG) + 0.2)
    (worst, *_) = judge._unlikely(known, [slow], DT, np.zeros(8))
    assert (worst.equation, worst.low, worst.high) == ("p", 0.0, 1.0)
    assert str(worst) == "p, 0 to 1 Hz"
    found = judge.UnseenFlight(power=1.0, largest=1.1, samples=1, bands=(worst,))
    assert [(row.name, row.verdict) for row in found.criteria] == [
        ("residual power", "fit"),
        ("p, 0 to 1 Hz", "not fit"),
    ]
    assert not found.explained
    assert judge.UnseenFlight(power=1.0, largest=1.1, samples=1).explained
    # too few windows, or too short a flight, are not judged by bands
    assert judge._unlikely(known[:3], [slow], DT, np.zeros(8)) == ()
    assert judge._unlikely(known, [slow[:200]], DT, np.zeros(8)) == ()


def test_a_slower_sensor_is_no_other_vehicle(vehicle, model):
    """Every second velocity is missing: what bridges it counts as badly measured."""
    record = vehicle.record(300, seed=11, sensors=SENSORS)
    columns = {name: record[name].copy() for name in STATES[:3]}
    for column in columns.values():
        column[1::2] = np.nan
    slow = record.with_signals(dict.fromkeys(columns, "m/s"), **columns)
    found = idn.judge.validate(model, slow)
    assert found.explained
    assert found.samples > 290
