"""Margins over the parameter are those of the frozen loops."""

import math
from dataclasses import replace

import numpy as np
import pytest

from symheli import LinearModel, LPVStateSpace, Scheduling, TableController
from symheli.errors import UnknownNameError
from synthesis import Plant, margin_table, margins
from synthesis.analysis import open_loop

P = Scheduling("p", "1", low=0.0, high=2.0)
p = P.symbol
PLANT = LPVStateSpace.from_expressions(
    [[0, 1, 0], [0, -1, 1 + p], [0, 0, -2]], [[0], [0], [2]], [[1, 0, 0]], [[0]], P
)
GAIN = {("u1", "y1"): -1.0}


def test_a_row_has_the_margins_of_its_frozen_loop():
    """(1 + p)/(s (s + 1)(s/2 + 1)) with gain 1 stays stable up to a gain of 3: by Routh."""
    table = margin_table(PLANT, GAIN, "u1", [0.0, 1.0, 2.5 - 1.0])
    for (at,), found in table.rows:
        assert found == margins(open_loop(PLANT.at(at), GAIN, "u1"))
    values = table.values()
    np.testing.assert_allclose(10 ** (values[:, 2] / 20), 3 / (1 + values[:, 0]), rtol=1e-6)
    assert "gain up (dB)" in str(table)
    assert len(str(table).splitlines()) == 4
    assert list(table.to_frame()["delay"]) == list(values[:, 4])


def test_at_the_end_of_the_range_the_loop_is_lost_and_has_no_margin():
    table = margin_table(PLANT, {("u1", "y1"): -1.1}, "u1")
    assert [m.stable for _, m in table.rows] == [True] * 6 + [False]
    assert math.isnan(table.values()[-1, 2])


def test_a_scheduled_controller_is_frozen_with_its_plant():
    controller = LPVStateSpace.from_expressions(
        [[-3]], [[1]], [[-3 / (1 + p)]], [[0]], P, inputs=["y1"], outputs=["u1"]
    )
    gains = margin_table(PLANT, controller, "u1", [0.0, 2.0]).values()[:, 2]
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-9)  # the gain is scheduled away
    with pytest.raises(UnknownNameError):
        margin_table(PLANT, GAIN, "u2")


def test_a_plant_with_references_and_its_table_have_the_margins_of_the_loop():
    """What the table reads with the other sign, as reference minus measured, is turned."""
    speed = LPVStateSpace.constant(PLANT.at(0.5), Scheduling("speed", "km/h", 0.0, 50.0, 1.0))
    made = Plant(speed, [], ["y1"], ["u1"], ["y1"]).with_input_disturbance().with_reference(["y1"])
    plant = made.weighted({"y1_error": 2.0}).sampled(0.01)
    gain = LinearModel.gain([[1.0]], ["y1_error"], ["u1"])
    design = LPVStateSpace.constant(replace(gain, dt=0.01), speed.parameters)
    table = TableController.of(design, 2)
    own = PLANT.at(0.5).discretize(0.01)
    direct = margins(open_loop(own, GAIN, "u1"))
    for given in (table, design):
        ((_, found),) = margin_table(plant, given, "u1", [10.0]).rows
        np.testing.assert_allclose(found.gain, direct.gain, rtol=1e-6)
        assert found.phase == pytest.approx(direct.phase, rel=1e-6)
