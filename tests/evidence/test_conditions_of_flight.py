"""What the table of real conditions says of marks, delays and winds."""

from dataclasses import replace

import numpy as np
import pytest

from evidence.marks import conditions
from studies.known_kinematics import conditions as real
from symheli import FlightPlan, FlightRecord
from symheli.flight import AirspeedSchedule


def mark(seed, gap, **found):
    return conditions.Marks(seed=seed, gap=gap, airspeed=5.0, found=found)


def test_a_row_says_whether_the_mark_is_met_and_the_delay_found():
    marks = [
        mark(k, g, actuators={"delay": (0.0203 + 1e-3 * k, 1e-4)})
        for k, g in enumerate((0.1, 0.2, 0.11))
    ]
    row = conditions.row("servos", marks)
    assert row[1:5] == ("0.12", "0.110", "0.200 (1)", "met")
    assert "(2 of 3 within 2)" in row[5]
    worse = conditions.row("servos", [*marks, mark(3, 0.25), mark(4, 0.25)])
    assert worse[4] == "MISSED"


def test_rows_that_are_not_flown_now_stay_in_the_order_of_the_conditions():
    shown = [("steady", "gone"), (conditions.CONDITIONS["delay"].about, "kept")]
    text = conditions.table("xcell60", {"servos": [mark(0, 0.1)]}, shown)
    rows = [line.split(" | ")[0].removeprefix("| ") for line in text.splitlines()[4:]]
    assert rows == [conditions.CONDITIONS[name].about for name in ("servos", "delay")]


def test_a_wind_is_held_against_the_one_that_blew():
    true = real.wind_of(3)
    assert np.hypot(*true) == pytest.approx(real.WIND)
    wind = {"north": (true[0] + 0.3, 0.2), "east": (true[1], 0.1)}
    assert conditions.row("wind", [mark(3, 0.1, wind=wind)])[5].startswith("wind off by 0.30")


def test_a_flight_begun_northwards_is_turned_with_the_wind_that_it_met():
    """Into the wind of a seed, whatever its direction, lies the opposite of where it blows to."""
    plan = FlightPlan(AirspeedSchedule.transition(1.0, 2.0, 1.0), wind=(-5.0, 0.0, 0.0))
    still = {name: np.zeros(50) for name in ("q", "r", "phi", "theta")}
    logged = FlightRecord.from_arrays(
        0.02 * np.arange(50),
        {"q": "rad/s", "r": "rad/s", "phi": "rad", "theta": "rad", "airspeed_command": "m/s"},
        **still,
        airspeed_command=np.full(50, 8.0),
    )
    record = replace(logged, meta={"plan": plan})
    turned = real.with_heading(record, real.into_the_wind(7))
    psi, towards = turned["psi"][0], real.wind_of(7)
    ahead = towards @ [np.cos(psi), np.sin(psi)]
    assert ahead == pytest.approx(-real.WIND)
    np.testing.assert_allclose(turned[real.OVER_GROUND], 8.0 + ahead)
