"""The flight under real conditions of the study."""

import numpy as np
import pytest

from studies.known_kinematics.models import PAIRS, simulator_of
from studies.transition import tables
from studies.transition.real_conditions import RealConditions, identify_under_real_conditions
from symheli import Helicopter


@pytest.mark.slow
def test_a_minute_of_flight_finds_the_delay():
    found = identify_under_real_conditions("xcell60", 1, 60.0)
    assert found.delay == pytest.approx(0.02)
    assert found.found is not None
    assert found.found[0] == pytest.approx(found.delay, abs=0.002)  # what counts as found
    assert found.gap is not None
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


@pytest.mark.parametrize("vehicle", PAIRS)
def test_the_instruments_of_an_x_cell_are_flown_in_the_other_one(vehicle):
    name, other = simulator_of(vehicle, Helicopter.load(vehicle, governor="pi"))
    assert name == PAIRS[vehicle]
    assert other.governor == "pi"
    assert other.vehicle.title == Helicopter.load(name).vehicle.title


def test_those_of_any_other_vehicle_in_an_x_cell_of_its_size():
    large = Helicopter.load("yamaha_r50", governor="ideal")
    name, other = simulator_of("yamaha_r50", large)
    radius, mass = "main_rotor.radius", "body.mass"
    assert other.parameters[radius] == pytest.approx(large.parameters[radius], rel=1e-12)
    # Froude: masses as the cube of lengths
    own = Helicopter.load("xcell60").parameters
    factor = large.parameters[radius] / own[radius]
    assert other.parameters[mass] == pytest.approx(own[mass] * factor**3, rel=1e-12)
    assert name == "xcell60 scaled by 1.97"
