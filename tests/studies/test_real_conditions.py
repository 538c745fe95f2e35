"""The flight under real conditions of the study."""

import numpy as np
import pytest

from studies.transition import tables
from studies.transition.real_conditions import RealConditions, identify_under_real_conditions


@pytest.mark.slow
def test_a_minute_of_flight_finds_the_delay():
    found = identify_under_real_conditions("xcell60", 1, 60.0)
    assert found.delay == pytest.approx(0.02)
    assert found.found is not None
    assert found.found[0] == pytest.approx(found.delay, abs=0.002)  # what counts as found
    assert 0 < found.gap.max() < 0.5


def test_the_table_has_the_numbers_or_why_there_are_none():
    real = RealConditions(
        about="servos", simulator="other", delay=0.02, found=(0.0204, 3e-4), gap=np.array([0.1])
    )
    assert tables.real_conditions(real).rows == [["servos", "0.100", "0.0204 ± 0.0003", "0.0200"]]
    none = tables.real_conditions(
        RealConditions(about="servos", simulator="other", delay=0.02, reason="no engine")
    )
    assert not none.rows
    assert none.remarks == ["No model: no engine"]
