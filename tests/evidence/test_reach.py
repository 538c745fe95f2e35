"""How far the LFT tests reach on the helicopter's loops."""

import pytest

import synthesis
from evidence.reach.measured import largest, on, proven, tables
from studies.loops.lateral import lateral_loop
from studies.loops.longitudinal import longitudinal_loop


def test_the_largest_range_is_found_by_bisection():
    asked = []

    def succeeds(low, high):
        asked.append((low, high))
        return high < 3.7

    found = largest("a test", lambda v: (0.0, v), succeeds, 13.0)
    assert found.high < 3.7 <= found.failed[1]
    assert found.failed[1] - found.high < 0.04
    assert len(asked) < 14
    assert largest("a test", lambda v: (0.0, v), lambda low, high: True, 13.0) == (
        "a test",
        0.0,
        13.0,
        None,
    )


def test_a_jumping_airspeed_costs_the_longitudinal_loop_almost_nothing(ideal):
    """The negative result of the page: here a P that varies with the airspeed gains nothing over D
    and G.
    """
    lft = longitudinal_loop(ideal, points=14).to_lft().reduce()
    certificate = synthesis.lft_gain(lft, "DG", search=None)
    assert certificate.verified
    assert certificate.gamma < 1.01 * certificate.frozen
    assert certificate.verify(rigorous=True)


@pytest.mark.slow
def test_on_the_lateral_loop_each_scaling_proves_more_of_the_range_but_none_all(ideal):
    loop = lateral_loop(ideal, points=14)
    # inside the reach of the richer class, outside that of the poorer one
    for test, poorer, low, high in (("D", "small gain", 5.0, 8.0), ("DG", "D", 3.0, 10.0)):
        assert proven(on(loop, low, high), test)
        assert not proven(on(loop, low, high), poorer)
    assert not proven(loop, "DG")


def test_the_tables_of_the_page_hold_every_range_and_say_what_failed():
    found = {
        "order": {"LFT": 18, "reduced": 15},
        "gains on [0, 1] m/s": {"DG": 4.581, "small gain": "INFEASIBLE", "frozen": 0.957},
        "gains on [0, 13] m/s": {"DG": "INFEASIBLE", "frozen": 0.984},
        "whole range, jumping airspeed": {"grows": True},
        "from the low end, DG": {"test": "DG", "low": 0.0, "high": 1.56, "failed": (0.0, 1.57)},
        "from the low end, growth": {
            "test": "no growth found",
            "low": 0.0,
            "high": 3.99,
            "failed": (0.0, 4.0),
        },
        "about 2 m/s, DG": {"test": "DG", "low": 0.57, "high": 3.43, "failed": None},
    }
    assert tables("lateral", found).splitlines() == [
        "| lateral: gain on | DG | small gain | frozen |",
        "|---|---|---|---|",
        "| [0, 1] m/s | 4.581 | INFEASIBLE | 0.957 |",
        "| [0, 13] m/s | INFEASIBLE |  | 0.984 |",
        "",
        "| lateral: stable | DG | growth |",
        "|---|---|---|",
        "| from the low end | 0 - 1.56 m/s | from 4 m/s |",
        "| about 2 m/s | 0.57 - 3.43 m/s |  |",
    ]
