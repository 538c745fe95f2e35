"""Rows from samples as they come: what is known is exact, what is not is NaN, and each fault has
its name.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies.live.sample import Sample
from studies.live.stream import Stream, StreamState
from symheli.errors import InputError

DT = 0.02


def line(t):
    """A signal whose straight lines between samples are exact."""
    return 3.0 - 2.0 * t


def sample(t, value=None, sender="a"):
    return Sample(t, {"x": line(t) if value is None else value}, sender)


def rows_of(samples, received=None):
    stream = Stream(["x"], DT)
    rows = []
    for k, one in enumerate(samples):
        rows += stream.take(one, one.time if received is None else received[k])
    return stream, rows


def test_samples_at_even_times_are_rows_at_once():
    stream, rows = rows_of([sample(10.0 + DT * k) for k in range(50)])
    assert len(rows) == 50
    np.testing.assert_allclose([row.values[0] for row in rows], [line(row.time) for row in rows])
    assert stream.state is StreamState.GOOD


@pytest.mark.parametrize("begin", [0.36, 10.0, 312.0, 5000.0, 60000.0])
def test_a_clock_in_single_precision_makes_no_row_late(begin):
    """X-Plane's clock: each sample is a row at once, with its own values."""
    stream = Stream(["x"], DT)
    for k in range(round(begin / DT), round(begin / DT) + 300):
        (row,) = stream.take(Sample(float(np.float32(DT * k)), {"x": k % 100}, "a"), DT * k)
        assert row.values[0] == k % 100


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_a_row_is_the_truth_or_unknown_whatever_the_wire_does(data):
    """Lost, repeated, reordered and shaken samples of a straight line."""
    times = [5.0 + DT * k for k in range(60)]
    shaken = [t + data.draw(st.floats(-0.3 * DT, 0.3 * DT)) for t in times]
    kept = [t for t in shaken if data.draw(st.integers(0, 9)) > 1]
    for _ in range(data.draw(st.integers(0, 6))):
        if len(kept) > 3:
            k = data.draw(st.integers(0, len(kept) - 2))
            kept[k], kept[k + 1] = kept[k + 1], kept[k]
            kept.insert(k, kept[k])
    _, rows = rows_of([sample(t) for t in kept], received=sorted(kept))
    at = np.array([row.time for row in rows])
    values = np.array([row.values[0] for row in rows])
    if len(at) > 1:
        np.testing.assert_allclose(np.diff(at), DT, rtol=1e-9)  # even, none left out
    known = np.isfinite(values)
    # a row within a millionth of the step between two samples takes the values of the later one
    step = len(times) * DT
    np.testing.assert_allclose(values[known], line(at[known]), rtol=1e-9, atol=1e-6 * step * 2.0)


def test_a_hole_is_unknown_and_the_row_at_its_end_is_known():
    times = [DT * k for k in (0, 1, 2, 8, 9)]
    stream, rows = rows_of([sample(t) for t in times])
    values = [row.values[0] for row in rows]
    assert [math.isnan(v) for v in values] == [False] * 3 + [True] * 5 + [False] * 2
    assert stream.counts[StreamState.LOST] == 1


@pytest.mark.parametrize(
    ("late", "state"),
    [
        (sample(0.04), StreamState.REPEATED),
        (sample(0.02), StreamState.REORDERED),
        (sample(0.06, sender="b"), StreamState.OTHER_VEHICLE),
        (sample(math.nan), StreamState.NOT_A_NUMBER),
    ],
)
def test_a_sample_that_is_left_out_says_why(late, state):
    stream = Stream(["x"], DT)
    for t in (0.0, 0.02, 0.04):
        stream.take(sample(t), t)
    assert stream.take(late, 0.05) == []
    assert stream.state is state
    (row,) = stream.take(sample(0.06), 0.06)  # and nothing is spoilt by it
    assert row.values[0] == pytest.approx(line(0.06))


def test_a_value_that_is_no_number_makes_its_row_unknown():
    stream, rows = rows_of([sample(0.0), sample(0.02, math.inf), sample(0.04)])
    assert [math.isnan(row.values[0]) for row in rows] == [False, True, False]
    assert stream.counts[StreamState.NOT_A_NUMBER] == 1


@pytest.mark.parametrize("to", [500.0, -500.0])
def test_a_clock_that_jumps_begins_anew(to):
    stream = Stream(["x"], DT)
    for k in range(5):
        stream.take(sample(600.0 + DT * k), DT * k)
    (row,) = stream.take(sample(600.0 + to), 5 * DT)
    assert stream.state is StreamState.CLOCK_JUMP
    assert row.time == 600.0 + to
    (row,) = stream.take(sample(600.0 + to + DT), 6 * DT)
    assert row.values[0] == pytest.approx(line(row.time))


def test_a_vehicle_that_falls_silent_is_named_and_goes_on():
    stream = Stream(["x"], DT)
    stream.take(sample(0.0), 0.0)
    stream.idle(0.3)
    assert stream.state is StreamState.GOOD
    stream.idle(0.6)
    assert stream.state is StreamState.SILENT
    rows = stream.take(sample(1.0), 1.0)
    assert len(rows) == 50
    assert math.isnan(rows[0].values[0])
    assert rows[-1].values[0] == pytest.approx(line(1.0))


@pytest.mark.parametrize("bad", [1e30, -1e5])
def test_a_value_beyond_any_vehicle_makes_its_row_unknown(bad):
    _, rows = rows_of([sample(0.0), sample(0.02, bad), sample(0.04)])
    assert [math.isnan(row.values[0]) for row in rows] == [False, True, False]


@pytest.mark.parametrize("waited", [600.0, 0.02])
def test_a_long_hole_costs_one_row(waited):
    """Whether the vehicle was silent or its clock was set: rows begin anew."""
    stream = Stream(["x"], DT)
    stream.take(sample(0.0), 0.0)
    (row,) = stream.take(sample(600.0), waited)
    assert row.time == 600.0
    assert stream.state is (StreamState.LOST if waited > 1.0 else StreamState.CLOCK_JUMP)


def test_a_paused_simulator_goes_on_without_a_jump():
    stream = Stream(["x"], DT)
    for received in (0.0, 300.0, 600.0):
        stream.take(sample(0.0), received)
    (row,) = stream.take(sample(0.02), 600.02)
    assert row.values[0] == pytest.approx(line(0.02))
    assert stream.counts[StreamState.REPEATED] == 2
    assert stream.state is StreamState.GOOD


@pytest.mark.parametrize(
    ("start", "kind", "state"),
    [
        (1e3, np.float32, StreamState.GOOD),
        (1e5, np.float32, StreamState.COARSE_CLOCK),
        (1e5, np.float64, StreamState.GOOD),
    ],
)
def test_a_clock_with_too_few_digits_is_said(start, kind, state):
    """X-Plane sends its time in single precision."""
    stream, _ = rows_of([sample(float(kind(start + DT * k)), 0.0) for k in range(50)])
    assert stream.state is state


@pytest.mark.parametrize("pace", [0.5, 2.0])
def test_slow_motion_is_no_fault(pace):
    samples = [sample(DT * k) for k in range(500)]
    stream, rows = rows_of(samples, received=[one.time / pace for one in samples])
    assert set(stream.counts) == {StreamState.GOOD}
    assert len(rows) == 500


def test_a_period_that_is_none_is_refused():
    with pytest.raises(InputError, match="expected a period > 0 s"):
        Stream(["x"], 0.0)
