"""Gain against acceleration and jerk: what the page shows, and how it is put together."""

import math
from functools import partial

import numpy as np
import pytest

import synthesis
from evidence.figures import save
from evidence.jerk.figure import plot
from evidence.jerk.flown import Fastest, fastest
from evidence.jerk.gains import Cell, Knots, Loop, carried_over, cell, with_jerk
from evidence.jerk.table import jerk_table
from studies.loops.lateral import lateral_loop
from symheli import FlightRecord
from symheli.errors import InputError


@pytest.fixture(scope="module")
def lateral(ideal):
    return lateral_loop(ideal, points=14)


def test_the_loop_over_airspeed_and_acceleration_is_the_loop(lateral):
    both = with_jerk(lateral, 3.0, 5.0)
    assert [s.rate for s in both.parameters] == ["acceleration", 5.0]
    for v, a in ((0.0, -3.0), (4.2, 1.0), (13.0, 3.0)):
        for name in "ABCD":
            np.testing.assert_array_equal(
                getattr(both.at(v, a), name), getattr(lateral.at(v), name)
            )


@pytest.mark.slow
def test_a_bounded_jerk_proves_less_gain_and_an_unbounded_one_no_more(lateral):
    """Two segments: coarse, and quick."""
    knots = Knots((2, 1), 2)
    alone = synthesis.l2_gain(lateral, 2.0, form=knots.alone, search=None).gamma
    bounded, jumping = (cell(lateral, 2.0, jerk, knots, None) for jerk in (1.0, math.inf))
    assert bounded.lower <= bounded.proven < 0.7 * jumping.proven
    # the bounds are loosened by 1e-6 of gamma^2 until they are verified
    assert jumping.proven <= alone * (1 + 2e-6)


def test_what_holds_for_more_holds_for_less_and_flights_the_other_way():
    cells = [
        Cell(1.0, 1.0, 3.0, 1.5),
        Cell(1.0, math.inf, 2.5, 1.2),
        Cell(2.0, 1.0, 2.8, 1.1),
        Cell(2.0, math.inf, math.inf, 1.0),
    ]
    assert carried_over(cells) == [
        Cell(1.0, 1.0, 2.5, 1.5),
        Cell(1.0, math.inf, 2.5, 1.5),
        Cell(2.0, 1.0, 2.8, 1.5),
        Cell(2.0, math.inf, math.inf, 1.5),
    ]


def test_the_table_says_where_nothing_is_proven():
    cells = [Cell(1.0, 3.0, 2.5, 2.0), Cell(4.5, 3.0, math.inf, math.inf)]
    loop = Loop(0.98, {1.0: 2.6, 4.5: math.inf}, {1.0: 2.55, 4.5: 104.8}, cells)
    assert jerk_table(loop).splitlines() == [
        "| acceleration, m/s² | jerk 3 m/s³ | P(V), same knots | P(V), knots chosen |",
        "|---|---|---|---|",
        "| 1 | 2.50 (2.00) | 2.60 | 2.55 |",
        "| 4.5 | nothing (grows) | nothing | 105 |",
    ]


def test_the_fastest_change_of_a_sine_is_found_and_a_shake_is_smoothed_away():
    t = 0.02 * np.arange(1500)
    slow, shake = 4 * np.sin(0.5 * t), 0.02 * np.sin(25 * t)
    record = FlightRecord.from_arrays(t, {"airspeed": "m/s"}, airspeed=6 + slow + shake)
    found = fastest(record)
    # the cubic keeps a little of the shake, whose own derivatives are 0.5 m/s^2 and 12 m/s^3
    assert found.acceleration == pytest.approx(2.0, abs=0.05)
    assert found.jerk == pytest.approx(1.0, abs=0.5)
    with pytest.raises(InputError, match="expected 5 of them or more"):
        fastest(record, window=0.04)


def test_the_figure_has_a_panel_a_loop(tmp_path):
    cells = [Cell(a, j, 2 + a, 1 + a) for a in (1.0, 3.0) for j in (1.0, math.inf)]
    loop = Loop(0.98, {1.0: 3.0, 3.0: 5.0}, {1.0: 3.0, 3.0: 5.0}, cells)
    save([partial(plot, "lateral", loop, {"test": Fastest(3.2, 2.0)})], tmp_path / "gain.png")
    assert (tmp_path / "gain.png").read_bytes().startswith(b"\x89PNG")
