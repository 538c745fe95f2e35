"""A record of 50 Hz says 0.02 s, whatever subtraction makes of its stamps, and goes with whatever
else runs at 0.02 s.
"""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symheli import FlightRecord, LinearModel
from symheli.errors import DataWarning
from symheli.lpv import append, nu_gap
from symheli.values.sample_period import same_period


def record(time):
    return FlightRecord(time, np.zeros((len(time), 1)), ("q",))


@pytest.mark.parametrize(
    "dt", [0.02, 0.01, 0.0084, 0.05, 1 / 30, 1 / 400, 0.1, 1.0, 2.5, 60.0, 1 / 3]
)
@pytest.mark.parametrize("start", [0.0, 12.34, 1e5])
def test_the_period_of_a_clean_clock_is_the_number_that_was_meant(dt, start):
    for n in (2, 100, 5000):
        found = record(start + dt * np.arange(n)).dt
        # late on the clock few stamps leave several round numbers
        assert found == dt or (start == 1e5 and n == 2 and same_period(found, dt))
    gap = np.concatenate([np.arange(50), np.arange(400, 700)])
    assert record(start + dt * gap).dt == dt


@given(st.floats(1e-3, 10.0), st.integers(2, 3000), st.floats(0.0, 1e4))
def test_whatever_the_period_it_is_known_to_the_rounding_of_its_stamps(dt, n, start):
    stamps = start + dt * np.arange(n)
    found = record(stamps).dt
    assert abs(found - dt) <= 8 * np.spacing(stamps[-1]) + 4 * np.spacing(dt)


def test_a_clock_that_is_off_is_not_rounded_away():
    """Stamps to the microsecond of 49.98 Hz over a minute: known to 1e-6 / 3000."""
    stamps = np.round(np.arange(3000) / 49.98, 6)
    assert record(stamps).dt == pytest.approx(1 / 49.98, abs=1e-9)
    assert record(stamps).dt != 0.02


def test_models_go_together_where_their_periods_differ_by_rounding_and_not_otherwise():
    def model(dt, pole=0.9):
        return LinearModel([[pole]], [[1.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",), dt=dt)

    assert nu_gap(model(0.02), model(0.019999999999999574)) < 1e-12  # rounding
    assert append(model(0.02), model(0.019999999999999574)).dt == 0.02
    for wrong in (0.0201, None):
        with pytest.raises(ValueError, match="sample period"):
            nu_gap(model(0.02), model(wrong))
        with pytest.raises(ValueError, match="sample period"):
            append(model(0.02), model(wrong))
    assert same_period(None, None)
    assert not same_period(None, 0.02)


@pytest.mark.parametrize(("step", "unit"), [(20.0, "ms"), (20000.0, "us"), (2e7, "ns")])
def test_a_time_in_another_unit_is_asked_for(step, unit):
    with pytest.warns(
        DataWarning,
        match=rf"{re.escape(f'{step:.6g}')} s apart; if the time is in {unit}.*--time-unit {unit}",
    ):
        FlightRecord.from_arrays(step * np.arange(9), {"q": "rad/s"}, q=np.zeros(9))


def test_a_step_no_flight_recorder_has_is_asked_about_once():
    with pytest.warns(
        DataWarning, match="2e-05 s apart; the time is taken in seconds: check its unit"
    ):
        got = FlightRecord.from_arrays(2e-5 * np.arange(9), {"q": "rad/s"}, q=np.zeros(9))
    assert (
        "p" in got.with_signals({"p": "1"}, p=np.zeros(9)).signals
    )  # warnings are errors here: nothing is said again
