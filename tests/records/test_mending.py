"""Logs as loggers leave them: stamps that scatter, frozen and slower sensors, short holes."""

import re

import numpy as np
import pytest

from symheli import FlightRecord
from symheli.errors import DataWarning
from symheli.records.mending import all_repeats, bridged

N, DT = 1000, 0.02
UNITS = {"u": "m/s", "q": "rad/s", "theta": "rad"}


def noisy(time=None, **changed):
    rng = np.random.default_rng(0)
    columns = {name: np.cumsum(rng.normal(size=N)) for name in UNITS} | changed
    time = DT * np.arange(N) if time is None else time
    return FlightRecord.from_arrays(time, UNITS, **columns)


def test_stamps_that_scatter_are_put_on_one_clock_before_and_behind_a_gap():
    true = DT * np.delete(np.arange(N), slice(400, 650))
    rng = np.random.default_rng(1)
    record = noisy(DT * np.arange(N)).rows(np.delete(np.arange(N), slice(400, 650)))
    late = FlightRecord(true + 2e-4 * rng.uniform(-1, 1, len(true)), record.values, record.signals)
    with pytest.warns(DataWarning, match=r"scatter by up to 0\.0002 s"):
        found = late.mended()
    np.testing.assert_allclose(found.time, true, rtol=0, atol=3e-5)
    assert found.dt == pytest.approx(DT, rel=1e-5)
    np.testing.assert_array_equal(found.values, record.values)


def test_a_log_without_damage_is_left_as_it_is(recwarn):
    record = noisy()
    found = record.mended()
    np.testing.assert_array_equal(found.values, record.values)
    np.testing.assert_allclose(found.time, record.time, rtol=0, atol=1e-9)
    assert not recwarn


def test_a_frozen_sensor_is_named_and_its_repeats_are_missing():
    q = np.random.default_rng(2).normal(size=N)
    q[300:350] = q[300]
    words = "q stands still from 6.00 to 6.98 s (0.98 s): frozen"
    with pytest.warns(DataWarning, match=re.escape(words)):
        found = noisy(q=q).mended()
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found["q"])), np.arange(301, 350))
    assert np.isfinite(found.columns(["u", "theta"])).all()


def test_sensors_that_stand_still_together_are_at_rest_not_frozen():
    rng = np.random.default_rng(2)
    columns = {}
    for name in UNITS:
        columns[name] = rng.normal(size=N)
        columns[name][300:350] = 0.0
    assert not any(one.mask.any() for one in all_repeats(noisy(**columns), UNITS).values())


def test_a_coarse_sensor_that_repeats_itself_by_chance_is_not_frozen():
    coarse = np.round(np.random.default_rng(3).normal(size=N))
    assert not all_repeats(noisy(theta=coarse), UNITS)["theta"].mask.any()


def test_a_slower_sensor_is_named_and_what_it_holds_is_missing():
    u = np.repeat(np.random.default_rng(4).normal(size=N // 2), 2)
    with pytest.warns(DataWarning, match=r"u: a new value every 2 samples \(0\.04 s\) only"):
        found = noisy(u=u).mended()
    np.testing.assert_array_equal(np.isnan(found["u"]), np.arange(N) % 2 == 1)


@pytest.mark.parametrize("longest", [0.12, 0.5])
def test_rows_that_are_lost_come_back_beside_another_flight(longest):
    """The difference of the flights is a line, and is interpolated exactly. A hole as long as the
    longest, .12 s, is bridged however its ends are rounded.
    """
    whole = noisy()
    lost = whole.rows((np.arange(N) % 50) > 4)
    other = whole.with_signals(UNITS, **{n: whole[n] + 1.0 + whole.time for n in UNITS})
    found = bridged(lost, UNITS, longest, lambda record: other.rows(slice(5, None)))
    np.testing.assert_allclose(found.values, whole.values[5:], rtol=0, atol=1e-9)
    assert found.meta["filled"]["q"].sum() == N - 5 - len(lost)


def test_a_hole_longer_than_that_stays():
    u = noisy()["u"].copy()
    u[100:103], u[500:520] = np.nan, np.nan
    found = bridged(noisy(u=u), UNITS)
    assert np.isfinite(found["u"][100:103]).all()
    assert np.isnan(found["u"][500:520]).all()


def test_a_slow_signal_that_is_rounded_is_not_frozen():
    """Its repeats end by one step of rounding; a frozen one goes on where the vehicle is."""
    time = 0.02 * np.arange(600)
    slow = np.round(3.0 + np.sin(0.01 * np.arange(600)), 1)
    fast = np.round(np.sin(0.1 * np.arange(600)), 2)
    fast[200:250] = fast[200]
    theta = np.random.default_rng(0).normal(size=600)
    logged = FlightRecord.from_arrays(time, UNITS, u=slow, q=fast, theta=theta)
    with pytest.warns(DataWarning, match="q stands still from 4.00 to 4.98"):
        found = logged.mended()
    assert not np.isnan(found["u"]).any()
    assert np.isnan(found["q"]).sum() == 49


@pytest.mark.parametrize("holes", [slice(500, 501), slice(0, None, 10), slice(0, None, 60)])
def test_a_sensor_that_never_moves_is_not_called_frozen(holes, recwarn):
    """A yaw rate on a bench, heading on a straight track: with a hole in it as well."""
    q = np.full(N, 0.3)
    q[holes] = np.nan
    record = noisy(q=q)
    np.testing.assert_array_equal(record.mended().values, record.values)
    assert not recwarn


def test_only_what_moves_at_other_times_is_a_sign_of_rest():
    q = np.random.default_rng(2).normal(size=N)
    q[300:350] = q[300]
    still, nothing = np.zeros(N), np.full(N, np.nan)
    slow = np.repeat(np.random.default_rng(4).normal(size=N // 20), 20)
    whole = np.floor(0.03 * np.arange(N))  # a heading in whole degrees
    for theta in (still, nothing, slow, whole):
        found = all_repeats(noisy(q=q, u=still, theta=theta), UNITS)
        assert found["q"].spells == ((300, 349),)


def test_a_dead_sensor_does_not_hide_that_the_vehicle_is_at_rest():
    rng = np.random.default_rng(2)
    columns = {name: rng.normal(size=N) for name in UNITS}
    for values in columns.values():
        values[300:350] = 0.0
    columns["theta"][250:400] = np.nan
    assert not any(one.mask.any() for one in all_repeats(noisy(**columns), UNITS).values())
