"""The alarm at several thresholds, and what the table says of false alarms and delays."""

import math

import numpy as np
import pytest

from evidence import circle
from studies.circle.alarm import ALLOWED, VehicleAlarm


@pytest.mark.parametrize("threshold", [5.0, 10.0])
def test_an_alarm_is_given_at_its_threshold_and_begins_anew(threshold):
    """Errors one deviation beyond what is allowed: one more of the threshold every second."""
    alarm = VehicleAlarm(None, np.ones(8), threshold)
    looks = np.full((20, 8), ALLOWED + 1.0)
    every = int(threshold)
    assert circle._alarms(alarm, looks) == list(range(every - 1, 20, every))


def test_a_row_counts_false_alarms_an_hour_and_changes_that_are_missed():
    found = [
        [circle.InGusts(10.0, false, 0.5, delays)]
        for false, delays in ((0, (3.0, 5.0)), (3, (8.0, math.inf)))
    ]
    row = circle.table_in_gusts(found).splitlines()[-1]
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells == ["10", "3.0", "1 of 2", "6", "none", "2 of 4"]
