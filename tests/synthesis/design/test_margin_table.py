"""Margins over the parameter are those of the frozen loops."""

import math

import numpy as np
import pytest

from symheli import LPVStateSpace, Scheduling
from symheli.errors import UnknownNameError
from synthesis import margin_table, margins
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
