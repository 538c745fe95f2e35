"""Flights of the nonlinear model: where they go, what is recorded, what noise does."""

import numpy as np
import pytest

import symheli
from symheli import AirspeedSchedule, Excitation, fly
from symheli.codegen.numeric import Numeric
from symheli.errors import FlightLostError, SymheliError
from symheli.flight import gain_scheduled_lqr
from symheli.flight.controller import MEASURED
from symheli.integrate import runge_kutta

SMALL = Excitation({"d_lon": 0.006, "d_lat": 0.006, "d_col": 0.005, "d_ped": 0.01})
SHORT = AirspeedSchedule((6.0, 0.0), (3.0, 3.0), (1.0, 4.0), lead=1.0)


@pytest.fixture(scope="module")
def pilot():
    return gain_scheduled_lqr(symheli.Helicopter.load("xcell60", governor="ideal"), 0.0, 13.0, 0.02)


@pytest.fixture(scope="module")
def short(pilot):
    return fly(
        symheli.Helicopter.load("xcell60", governor="ideal"),
        SHORT,
        excitation=SMALL,
        controller=pilot,
    )


def test_a_transition_reaches_its_airspeed_and_returns_to_hover(ideal, pilot):
    record = fly(ideal, AirspeedSchedule.transition(0.0, 13.0, 3.0, hold=3.0), controller=pilot)
    assert record.dt == 0.02  # as asked for, not what differences of its stamps leave of it
    assert record["airspeed"].max() == pytest.approx(13.0, abs=1.5)
    np.testing.assert_allclose(record["airspeed"][-1], 0.0, atol=1.0)
    assert np.abs(record["airspeed"] - record["airspeed_command"]).max() < 1.5
    hover = symheli.trim(ideal, 0.0)
    assert record["theta"][-1] == pytest.approx(hover.x["theta"], abs=0.05)


def test_a_flight_that_starts_in_trim_stays_there(ideal, pilot):
    record = fly(ideal, AirspeedSchedule((5.0,), (1.0,), (2.0,), start=5.0), controller=pilot)
    point = symheli.trim(ideal, 5.0)
    for name in ("u", "w", "phi", "theta"):
        np.testing.assert_allclose(record[name], point.x[name], atol=1e-8)


def test_both_governors_fly(pi):
    record = fly(pi, AirspeedSchedule((3.0,), (2.0,), (1.0,), lead=0.5))
    assert "Om" in record.signals
    assert record["airspeed"][-1] == pytest.approx(3.0, abs=1.0)


@pytest.mark.slow
def test_runge_kutta_is_of_order_four(ideal):
    point = symheli.trim(ideal, 6.0)  # no wake edge nearby: the equations are smooth there
    cp, sp, ct, st = (
        f(v / 2) for v in (point.x["phi"], point.x["theta"]) for f in (np.cos, np.sin)
    )
    start = np.concatenate(
        [
            point.x.array[:6] + 0.1,
            [cp * ct, sp * ct, cp * st, -sp * st],
            np.zeros(3),
            point.x.array[8:],
        ]
    )
    controls = point.u.array + 0.01

    def end(steps):
        return Numeric(runge_kutta(ideal, 0.16, steps))(start, controls, np.zeros(3))[0]

    exact = end(256)
    errors = [np.abs(end(n) - exact).max() for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4) < 0.4), orders


def test_integration_error_of_a_flight_stays_below_its_promise(ideal, pilot, short, monkeypatch):
    monkeypatch.setattr("symheli.flight.course.INTEGRATION_STEP", 0.0025)
    finer = fly(ideal, SHORT, excitation=SMALL, controller=pilot)
    states = [str(s) for s in ideal.states]
    size = np.abs(short.columns(states)).max(axis=0)
    assert np.all(np.abs(finer.columns(states) - short.columns(states)).max(axis=0) < 1e-5 * size)


def test_noise_has_the_asked_size_and_follows_its_seed(ideal, pilot, short):
    first, again, other = (
        fly(ideal, SHORT, excitation=SMALL, controller=pilot, noise_db=30.0, seed=s)
        for s in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.values, again.values)
    assert not np.array_equal(first.values, other.values)
    # white noise seen through second differences: a smooth flight adds little to them where it
    # moves slowly against 50 Hz
    clean = short.columns(("u", "v", "w", "phi", "theta"))
    noisy = first.columns(("u", "v", "w", "phi", "theta"))
    noise = (np.diff(noisy, n=3, axis=0) - np.diff(clean, n=3, axis=0)).std(axis=0) / np.sqrt(20)
    level = 20 * np.log10(clean.std(axis=0) / noise)
    np.testing.assert_allclose(
        level, 30.0, atol=1.0
    )  # the autopilot answers the noise, and 500 samples scatter by 0.3 dB
    assert "30 dB" in first.note


def test_the_record_holds_what_its_documentation_says(ideal, short):
    wanted = {
        *map(str, ideal.states),
        *map(str, ideal.inputs),
        *(f"e_{i}" for i in ideal.inputs),
        "airspeed",
        "airspeed_command",
        "acceleration_command",
        *(f"{s}_reference" for s in (*ideal.states, *ideal.inputs)),
    }
    assert set(short.signals) == wanted
    assert set(MEASURED) <= wanted
    assert short.dt == pytest.approx(0.02)
    added = SMALL(short.time)
    np.testing.assert_allclose(short["e_d_col"], added["d_col"], atol=1e-12)
    assert np.all(np.abs(short.columns([str(i) for i in ideal.inputs])) <= ideal.travel + 1e-12)


def test_airspeed_is_that_of_the_air(ideal, pilot):
    windy = fly(
        ideal,
        AirspeedSchedule((4.0,), (2.0,), (2.0,), start=4.0),
        controller=pilot,
        wind=(-2.0, 0.0, 0.0),
    )
    np.testing.assert_allclose(windy["airspeed"], 4.0, atol=0.1)
    np.testing.assert_allclose(windy["u"], 2.0, atol=0.1)  # against 2 m/s of headwind


def test_a_lost_flight_says_when_and_what_to_change(ideal, pilot):
    wild = Excitation({"d_lon": 0.5, "d_lat": 0.5}, band=(0.1, 0.5))
    with pytest.raises(
        FlightLostError, match=r"the flight was lost at .* s near .* m/s \(.*\): reduce excitation"
    ) as lost:
        fly(ideal, AirspeedSchedule.transition(0.0, 6.0, 2.0), excitation=wild, controller=pilot)
    record = lost.value.record
    assert "was lost" in record.note
    assert np.abs(record.columns(("phi", "theta"))).max() <= 1.4  # until then it was not lost
    last = np.abs(record.columns(("phi", "theta"))[-1]).max()
    rate = np.abs(record.columns(("p", "q"))[-1]).max()
    assert last + 2 * record.dt * rate > 1.4  # and the record reaches to the moment it was
    assert "d_lon at its stop" in str(lost.value)
    assert "d_lat at its stop" in str(lost.value)


def test_an_autopilot_of_another_period_and_an_impossible_step_are_refused(ideal, pilot):
    with pytest.raises(SymheliError, match=r"was designed for 0\.02 s"):
        fly(ideal, SHORT, dt=0.01, controller=pilot)
    with pytest.raises(SymheliError, match="dt must be a positive"):
        fly(ideal, SHORT, dt=0.0)
