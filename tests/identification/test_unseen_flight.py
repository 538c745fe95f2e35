"""A flight that the model, with the noise it was identified with, cannot have made."""

from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import STATES, Vehicle

import identification as idn
from symheli.errors import InputError

SENSORS = np.array([0.02] * 3 + [0.005] * 3 + [0.002] * 2)
NOISE = dict(zip(STATES, SENSORS.tolist(), strict=True))


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle(na=1, nb=1)


@pytest.fixture(scope="module")
def model(vehicle):
    method = idn.FilterError(vehicle.without_noise(seed=1), noise=NOISE)
    return idn.fit(vehicle.kin, vehicle.record(1600, seed=1, sensors=SENSORS), method)


@pytest.mark.slow
def test_other_flights_of_the_vehicle_are_explained(vehicle, model):
    """Ten of them: what is left is chi-squared, three standard deviations are rarely passed."""
    judged = [
        idn.unseen_flight(model, vehicle.record(300, seed=s, sensors=SENSORS))
        for s in range(10, 20)
    ]
    assert sum(flight.explained for flight in judged) >= 9
    allowed = np.mean([flight.largest for flight in judged])
    assert 0.8 < np.mean([flight.power for flight in judged]) < allowed


def test_louder_sensors_and_another_vehicle_are_not(vehicle, model):
    assert not idn.unseen_flight(
        model, vehicle.record(300, seed=5, sensors=1.2 * SENSORS)
    ).explained
    other = Vehicle(na=1, nb=1)
    other.theta = vehicle.theta * 1.3
    found = idn.unseen_flight(model, other.record(300, seed=5, sensors=SENSORS))
    with pytest.raises(InputError, match="no certificate about it holds"):
        found.require()


@pytest.mark.slow
def test_noise_of_its_own_size_in_every_flight_is_no_other_vehicle(vehicle):
    """Noise so many decibels below the signals is louder in a livelier flight: two flights pooled
    to one level made every third unlikely.
    """
    method = idn.FilterError(vehicle.without_noise(seed=1))
    flights = [vehicle.record(800, seed=s, sensors=k * SENSORS) for s, k in ((1, 1.0), (2, 2.0))]
    model = idn.fit(vehicle.kin, flights, method)
    other = Vehicle(na=1, nb=1)
    other.theta = vehicle.theta * 1.3
    for loud in (0.7, 1.5, 3.0):
        found, wrong = (
            idn.unseen_flight(model, one.record(600, seed=7, sensors=loud * SENSORS))
            for one in (vehicle, other)
        )
        assert 0.7 < found.power < found.largest < 1.5
        assert not wrong.explained


def test_a_model_that_does_not_know_its_noise_is_refused(vehicle, model):
    record = vehicle.record(300, seed=5, sensors=SENSORS)
    with pytest.raises(InputError, match="fit by FilterError"):
        idn.unseen_flight(idn.fit(vehicle.kin, record), record)
    with pytest.raises(InputError, match="shorter than 1 s"):
        idn.unseen_flight(model, record.rows(np.arange(300) < 12))


def test_the_noise_it_judges_by_is_kept_in_files(model, vehicle, tmp_path):
    record = vehicle.record(300, seed=5, sensors=SENSORS)
    again = idn.KinematicModel.load(model.save(tmp_path / "model.json"))
    assert idn.unseen_flight(again, record) == idn.unseen_flight(model, record)
    assert replace(again, trim=model.trim).details == model.details
