"""Rows out of the order of their clock are put in order, or left out, and told."""

import numpy as np
import pytest

from symheli.errors import DataWarning, InputError
from symheli.logs.order import in_order

TIME = 0.02 * np.arange(400)
Y = np.sin(TIME)


def ordered(time, y=Y, said=None):
    with pytest.warns(DataWarning, match=said):
        stamps, columns = in_order(np.asarray(time), {"y": np.asarray(y)}, "log.csv")
    assert np.all(np.diff(stamps) > 0)
    return stamps, columns["y"]


def test_rows_in_order_are_left_as_they_are():
    stamps, columns = in_order(TIME, {"y": Y}, "log.csv")
    np.testing.assert_array_equal(stamps, TIME)
    np.testing.assert_array_equal(columns["y"], Y)


@pytest.mark.parametrize("seed", range(3))
def test_late_rows_are_sorted(seed):
    order = np.arange(400)
    for k in np.random.default_rng(seed).integers(0, 370, 8):
        order = np.insert(np.delete(order, k), k + 12, order[k])
    stamps, y = ordered(TIME[order], Y[order], "that come late sorted")
    np.testing.assert_array_equal(stamps, TIME)
    np.testing.assert_array_equal(y, Y)


@pytest.mark.parametrize("block", [1, 20])
def test_copies_are_left_out(block):
    order = np.insert(np.arange(400), 100 + block, np.arange(100, 100 + block))
    stamps, y = ordered(TIME[order], Y[order], f"{block} rows? that repeat a time left out")
    np.testing.assert_array_equal(stamps, TIME)
    np.testing.assert_array_equal(y, Y)


@pytest.mark.parametrize("back", [0.3, 5.0, 200 * 0.02])
def test_what_follows_a_clock_set_back_is_another_part(back):
    time = np.where(np.arange(400) < 200, TIME, TIME - back)
    stamps, y = ordered(time, said="the clock was set back 1 time, what follows")
    np.testing.assert_array_equal(y, Y)
    assert stamps[200] - stamps[199] == pytest.approx(10.0)
    np.testing.assert_allclose(np.diff(np.delete(stamps, slice(0, 200))), 0.02)


def test_a_stamp_astray_and_rows_without_a_time_are_left_out():
    time = TIME.copy()
    time[150] = 1e6
    time[[40, 60]] = np.nan
    stamps, y = ordered(time, said="2 rows without a time left out, 1 row with a time far")
    kept = np.delete(np.arange(400), [40, 60, 150])
    np.testing.assert_array_equal(stamps, TIME[kept])
    np.testing.assert_array_equal(y, Y[kept])


def test_a_coarse_clock_is_refused():
    with pytest.raises(InputError, match="log it with more digits"):
        in_order(np.floor(TIME * 10) / 10, {"y": Y}, "log.csv")
