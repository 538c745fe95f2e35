"""Records: one time axis, gaps and missing samples respected, messages that say where."""

import numpy as np
import pandas as pd
import pytest

from symheli.errors import InputError, UnknownNameError
from symheli.lpv import FlightRecord


def record(time=None, **columns):
    time = 0.1 * np.arange(10) if time is None else np.asarray(time, float)
    columns = columns or {"q": np.sin(time)}
    return FlightRecord.from_arrays(time, dict.fromkeys(columns, "rad/s"), **columns)


def test_units_are_converted_at_the_door_and_kept_in_the_signal():
    frame = pd.DataFrame({"t": [0.0, 10.0, 20.0], "speed": [10.0, 20.0, 30.0], "theta": [0.0, 90.0, 180.0], "junk": ["a", "b", "c"]})
    got = FlightRecord.from_frame(frame, time="t", units={"speed": "kt", "theta": "deg"}, time_unit="ms")
    np.testing.assert_allclose(got["theta"], [0, np.pi / 2, np.pi])
    np.testing.assert_allclose(got["speed"][0], 10 * 1852 / 3600)
    assert got.dt == pytest.approx(0.01)
    assert [(s, s.unit) for s in got.signals] == [("speed", "m/s"), ("theta", "rad")]
    assert list(got.to_frame().columns) == ["t", "speed", "theta"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: record([0.0, 0.1, 0.1, 0.2]), "sample 2 is at 0.1 s after 0.1 s"),
        (lambda: record([0.0, 0.2, 0.1]), "time must increase"),
        (lambda: record([0.0]), "at least two samples"),
        (lambda: record([0.0, np.nan]), r"time: entry \(1,\) is nan"),
        (lambda: record(q=[0.0] * 9 + [np.inf]), "q is infinite at 0.9 s; mark missing samples as NaN"),
        (lambda: record(q=np.zeros(4)), r"q: expected shape \(10\), got \(4,\)"),
        (lambda: FlightRecord.from_arrays([0, 1], {}, q=[0, 1]), "declare the unit of 'q'"),
        (lambda: FlightRecord.from_arrays([0, 1], {"q": "rad/sec"}, q=[0, 1]), "did you mean 'rad/s'"),
        (lambda: record([0, 0.1, 0.23, 0.31]).dt, "sampling is irregular"),
        (lambda: record().resample(0), "positive number"),
        (lambda: record()["p"], "unknown signal 'p'"),
    ],
)
def test_a_record_that_cannot_be_used_says_why(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_misspelt_column_gets_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'theta'"):
        FlightRecord.from_frame(pd.DataFrame({"t": [0, 1], "theta": [0, 1]}), time="t", units={"tetha": "rad"})


def test_gaps_split_the_record_and_nothing_is_invented_across_them():
    time = np.r_[np.arange(5) * 0.1, 2 + np.arange(6) * 0.1]
    got = record(time, q=time**2)
    assert got.segments() == (slice(0, 5), slice(5, 11))
    assert got.dt == pytest.approx(0.1)
    finer = got.resample(0.05)
    assert not np.any((finer.time > 0.41) & (finer.time < 1.99))
    assert len(finer.segments()) == 2
    slope = got.derivative("q")
    np.testing.assert_allclose(slope[1:4], 2 * time[1:4], atol=1e-12)
    assert slope[4] < 1.0  # one-sided at the end of the segment, not a chord over the gap


def test_missing_samples_stay_missing():
    got = record(q=[0.0, 1.0, np.nan, *range(7)])
    assert np.isnan(got["q"][2])
    assert np.isnan(got.resample(0.05)["q"]).any()


def test_resampling_to_the_same_step_changes_nothing():
    got = record()
    np.testing.assert_allclose(got.resample(0.1).values, got.values, atol=1e-12)


def test_cutting_selecting_and_adding_make_new_records():
    got = record(q=np.arange(10.0), p=np.zeros(10))
    np.testing.assert_allclose(got.between(0.2, 0.5).time, [0.2, 0.3, 0.4])
    assert got.select(["p"]).signals == ("p",)
    more = got.with_signals({"q": "deg/s", "n": "1"}, q=np.full(10, 180.0), n=np.ones(10))
    assert set(more.signals) == {"q", "p", "n"}
    np.testing.assert_allclose(more["q"], np.pi)
    np.testing.assert_array_equal(got["q"], np.arange(10.0))
    np.testing.assert_array_equal(got.columns(["q", "p"])[:, 1], np.zeros(10))


def test_arrays_are_copies_that_cannot_be_changed():
    mine = np.zeros(10)
    got = record(q=mine)
    mine[:] = 1.0
    assert not got["q"].any()
    with pytest.raises(ValueError, match="read-only"):
        got.values[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        got.time[0] = 1.0
