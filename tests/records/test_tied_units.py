"""Units that two signals contradict are seen with these two signals alone."""

import numpy as np
import pytest

import symheli
from studies.log.units import contradicted
from symheli import FlightRecord
from symheli.records.tied_units import tied_units

TIME = 0.02 * np.arange(3000)
UNITS = {
    **dict.fromkeys(("p", "q"), "rad/s"),
    **dict.fromkeys(("phi", "theta"), "rad"),
    **dict.fromkeys(("airspeed", "u"), "m/s"),
    **dict.fromkeys(("x_n", "x_e"), "m"),
}


def flown(names, lost=0, **factors):
    """Small angles and a turning path in wind, with noise; some samples lost, units changed."""
    rng = np.random.default_rng(1)
    w, heading = 2.1, 0.1 * TIME
    theta = 0.1 * np.sin(w * TIME)
    speed = 6 + 3 * np.sin(0.3 * TIME)
    ground = speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]) + [2.0, -1.5]
    position = np.cumsum(0.02 * ground, axis=0)
    signals = {
        **dict.fromkeys(("theta", "phi"), theta + rng.normal(0, 0.004, 3000)),
        **dict.fromkeys(("q", "p"), 0.1 * w * np.cos(w * TIME) + rng.normal(0, 0.02, 3000)),
        **dict.fromkeys(("airspeed", "u"), speed + rng.normal(0, 0.3, 3000)),
        "x_n": position[:, 0],
        "x_e": position[:, 1],
    }
    columns = {n: factors.get(n, 1.0) * signals[n] for n in names}
    kept = np.sort(rng.choice(3000, 3000 - lost, replace=False))
    return FlightRecord.from_arrays(TIME, {n: UNITS[n] for n in names}, **columns).rows(kept)


PAIRS = [("q", "theta"), ("p", "phi"), ("airspeed", "x_n", "x_e"), ("airspeed", "u")]


@pytest.mark.parametrize("names", PAIRS)
@pytest.mark.parametrize("lost", [0, 150])
def test_sound_pairs_are_of_one_unit(names, lost):
    found = tied_units(flown(names, lost))
    assert [tie.signal for tie in found] == [names[0]]
    assert found[0].ratio == pytest.approx(1.0, abs=0.1)
    assert contradicted(flown(names, lost), {}) == []


@pytest.mark.parametrize(
    ("names", "factors", "declared", "typed"),
    [
        (("q", "theta"), {"q": 57.3}, {}, "--units q=deg/s"),
        (("q", "theta"), {"theta": 57.3}, {}, "--units theta=deg"),
        (("p", "phi"), {"p": 57.3}, {}, "--units p=deg/s"),
        (("q", "theta"), {"q": 1 / 57.3}, {"q": "deg/s"}, "--units q=rad/s"),
        (("airspeed", "x_n", "x_e"), {"airspeed": 3.6}, {}, "--units airspeed=km/h"),
        (("airspeed", "x_n", "x_e"), {"airspeed": 1.944}, {}, "--units airspeed=kt"),
        (("airspeed", "u"), {"airspeed": 3.28}, {}, "--units airspeed=ft/s"),
    ],
)
def test_another_unit_is_named(names, factors, declared, typed):
    (sentence,) = contradicted(flown(names, 60, **factors), declared)
    assert typed in sentence


def test_columns_are_known_by_their_names():
    record = flown(("q", "theta"), q=57.3)
    renamed = FlightRecord.from_arrays(
        record.time,
        {"GyroPitch_dps": "rad/s", "PitchAngle_deg": "rad"},
        GyroPitch_dps=record["q"],
        PitchAngle_deg=record["theta"],
    )
    (sentence,) = contradicted(renamed, {})
    assert "GyroPitch_dps is 5" in sentence
    assert "--units GyroPitch_dps=deg/s" in sentence


def test_signals_that_do_not_move_together_say_nothing():
    rng = np.random.default_rng(0)
    units = {"q": "rad/s", "theta": "rad"}
    noise = {n: rng.standard_normal(3000) for n in units}
    assert tied_units(FlightRecord.from_arrays(TIME, units, **noise)) == ()


def test_noise_of_small_motions_and_wind_are_no_other_unit():
    """Bank hardly moves in this flight; its noise makes 1.6 of the ratio."""
    record = symheli.fly(
        symheli.Helicopter.load("xcell60", governor="ideal"),
        symheli.AirspeedSchedule.transition(0.0, 8.0, acceleration=2.0),
        excitation=symheli.Excitation({"d_lon": 0.012}, seed=1),
        noise_db=40,
        wind=(4.0, 2.0, 0.0),
        seed=1,
    )
    assert len(tied_units(record)) > 1
    assert contradicted(record, {}) == []
