"""Instruments flown in a simulator: the samples of the record, whatever part of the flight it is,
and estimates that noise does not bias.
"""

from dataclasses import replace

import numpy as np
import pytest
from known_vehicles import Vehicle

import identification as idn
import symheli
from identification.estimators.instrumental_variables import _faded
from symheli.errors import InputError

SENSORS = np.array([0.03] * 3 + [0.01] * 3 + [0.004] * 2)


@pytest.fixture(scope="module")
def flight(ideal):
    plan = symheli.AirspeedSchedule((3.0, 1.0), (1.5, 1.5), (1.0, 1.0), start=2.0)
    excitation = symheli.Excitation(dict.fromkeys(ideal.inputs, 0.01), seed=3)
    return symheli.fly(ideal, plan, excitation=excitation, noise_db=30.0, seed=1)


def test_the_flight_again_is_the_one_without_noise(ideal, flight):
    plan = flight.meta["plan"]
    calm = symheli.fly(ideal, plan.schedule, excitation=plan.excitation)
    clean = symheli.flight.SimulatedFlight(ideal).flown(flight)
    np.testing.assert_array_equal(clean.time, flight.time)
    for name in ("u", "p", "theta", "d_lon"):
        np.testing.assert_array_equal(clean[name], calm[name])
        assert np.abs(flight[name] - clean[name]).max() > 0


def test_a_part_of_the_flight_gets_its_own_samples(ideal, flight):
    source = symheli.flight.SimulatedFlight(ideal)
    whole = source.flown(flight)
    keep = (flight.time > 1.0) & ((flight.time < 1.5) | (flight.time > 2.0))
    part = source.flown(flight.rows(keep))
    np.testing.assert_array_equal(part.time, flight.time[keep])
    np.testing.assert_array_equal(part["q"], whole["q"][keep])
    assert len(part.segments()) == 2


def test_samples_that_are_not_those_of_the_plan_are_refused(ideal, flight):
    source = symheli.flight.SimulatedFlight(ideal)
    for other in (
        flight.resample(0.03),
        replace(flight, time=flight.time + 0.007),
        replace(flight, time=flight.time + 100.0),
    ):
        with pytest.raises(InputError, match="other samples than its plan"):
            source.flown(other)


def test_a_record_without_its_plan_is_told_what_is_missing(ideal, flight):
    with pytest.raises(InputError, match=r"need the plan of the record, meta\['plan'\]"):
        symheli.flight.SimulatedFlight(ideal).flown(replace(flight, meta={}))
    with pytest.raises(InputError, match="expected a Helicopter"):
        symheli.flight.SimulatedFlight("xcell60")


def test_another_vehicle_may_fly_it(ideal, flight):
    other = symheli.Helicopter.load("xcell_kahn_hudson", governor="ideal")
    source = symheli.flight.SimulatedFlight(other)
    flown, own = source.flown(flight), symheli.flight.SimulatedFlight(ideal).flown(flight)
    assert len(flown) == len(flight)
    assert np.abs(flown["p"] - own["p"]).max() > 1e-3
    np.testing.assert_array_equal(flown["airspeed_command"], own["airspeed_command"])


@pytest.mark.slow
@pytest.mark.parametrize("gain", [1.0, 0.7])
def test_more_flights_bring_instruments_to_the_truth_and_least_squares_to_its_bias(gain):
    """Eight flights instead of one: scatter falls as the root of eight, bias stays. Also where the
    simulator's controls are weaker than the vehicle's.
    """
    vehicle, simulator = Vehicle(na=1, nb=1), Vehicle(na=1, nb=1)
    inputs = [e.kind == "input" and e.channel >= 6 for e in vehicle.kin.aerodynamics.entries]
    simulator.theta = vehicle.theta * np.where(np.repeat(inputs, 2), gain, 1.0)[:, None]
    records, clean = zip(
        *(
            (vehicle.record(600, seed=s, sensors=SENSORS), simulator.record(600, seed=s))
            for s in range(8)
        ),
        strict=True,
    )

    class Source:
        def flown(self, record):
            drawn = record["e_d_lon"][0]
            return next(c for c in clean if c["e_d_lon"][0] == drawn)

    scale = np.sqrt(np.mean(vehicle.theta**2))

    def error(record, *method):
        theta = idn.fit(vehicle.kin, record, *method).theta
        return np.sqrt(np.mean((theta - vehicle.theta) ** 2)) / scale

    iv = idn.methods.InstrumentalVariables(Source())
    one_iv = np.sqrt(np.mean([error(r, iv) ** 2 for r in records]))
    assert error(records, iv) < 2 * one_iv / np.sqrt(8)
    assert error(records) > 2 * error(records, iv)


def test_instruments_fade_to_both_ends_of_every_stretch():
    """A hole in one record, and two records one after the other, are alike."""
    rise = [*np.arange(1, 6) / 6, 1.0, 1.0]
    expected = [*rise, *rise[4::-1], *rise, *rise[4::-1]]
    stretch = np.arange(12)
    hole = _faded(np.concatenate([stretch, stretch + 20]), [range(40)])
    two = _faded(np.concatenate([stretch, stretch + 12]), [range(12), range(12)])
    np.testing.assert_allclose(hole, expected)
    np.testing.assert_allclose(two, expected)


@pytest.mark.parametrize(("lost", "dropped"), [(4, 0), (6, 6 + 1)])
def test_instruments_flown_in_a_simulator_bridge_a_tenth_of_a_second(lost, dropped):
    """Of a longer hole its rows and the one behind it, whose past it is, are dropped."""
    vehicle = Vehicle(na=1, nb=1)
    whole, clean = vehicle.record(400, seed=1, sensors=SENSORS), vehicle.record(400, seed=1)

    class Source:
        def flown(self, record):
            return clean.rows(np.rint(record.time / record.dt).astype(int))

    iv = idn.methods.InstrumentalVariables(Source())
    hole = (np.arange(400) >= 200) & (np.arange(400) < 200 + lost)
    found, of_whole = (
        idn.fit(vehicle.kin, record, iv).aerodynamics for record in (whole.rows(~hole), whole)
    )
    assert found.rows_used == of_whole.rows_used - dropped
