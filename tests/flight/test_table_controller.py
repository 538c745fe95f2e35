"""What flies is what is certified: tables in 32 bits, their entry, limits, a wrong airspeed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from flight.flown import SHORT, STORM, InPython, differences, dynamic
from flight.tables import DT, MACH, OUTPUTS, InFlight, over, sampled, static, table

import symheli
import synthesis
from symheli import LinearModel, LPVStateSpace, TableController, fly
from symheli.errors import InputError
from symheli.flight import ParameterMonitor, StepEvents
from symheli.flight.anti_windup import saturated_radius
from symheli.flight.table_file import SCHEMA
from symheli.values import plain_file

ROUNDING = float(np.finfo(np.float32).eps)


def run(controller, errors, airspeed, trim=0.0):
    """Commands (N, ny) from the ground along errors (N, nu) at an airspeed."""
    return InFlight(controller).run(errors, airspeed, trim)


# --- the numbers ---------------------------------------------------------------------------------


def test_the_model_holds_the_very_numbers_of_the_table():
    t = table()
    n, own = t.order, t.order + len(t.inputs)
    at = t.model.matrices(t.knots.astype(float))
    for mine, block in zip(
        at,
        (
            t.matrices[:, :n, :n],
            t.matrices[:, :n, n:own],
            t.matrices[:, n:, :n],
            t.matrices[:, n:, n:own],
        ),
        strict=True,
    ):
        np.testing.assert_array_equal(mine, block.astype(float))
    assert t.matrices.dtype == np.float32
    assert t.model.scheduling.rate == 3.0
    middle = 0.5 * (t.knots[2] + t.knots[3]).astype(float)
    # straight between two knots
    np.testing.assert_allclose(t.model.at(middle).D, at.D[2:4].mean(axis=0), rtol=1e-14)


@pytest.mark.parametrize("knots", [5, (0.0, 0.1, 0.5, 0.6, 1.0)])
def test_the_misfit_is_that_of_a_chord_under_a_parabola(knots):
    """D = p^2 over 0 to 1: between knots h apart, two fifths of the way, .24 h^2 too much."""
    speed = symheli.Scheduling("airspeed", "m/s", 0.0, 1.0)
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
    D = [np.zeros((1, 1)), np.zeros((1, 1)), np.ones((1, 1))]
    model = symheli.LPVStateSpace.polynomial(
        *([m] for m in none), D, speed, dt=DT, inputs=("phi",), outputs=("d_lat",)
    )
    widest = 0.25 if knots == 5 else 0.4
    assert TableController.of(model, knots).misfit == pytest.approx(
        0.24 * widest**2, abs=2 * ROUNDING
    )


def test_a_table_of_a_table_is_the_same_and_its_misfit_rounding():
    first = table(limit=None)
    again = TableController.of(first.model, first.knots.tolist(), correction=0)
    np.testing.assert_array_equal(again.matrices[:, :, :14], first.matrices[:, :, :14])
    assert again.misfit < 1e-15  # differences of doubles


@pytest.mark.parametrize("knots", [2, 3, 4, 33, (0.0, 0.01, 0.5, 7.0, 7.5, 13.0)])
def test_any_airspeed_is_looked_up_between_its_knots(knots):
    t = table(order=2, knots=knots, limit=None, correction=0)
    static_gain = [0.0, *np.random.default_rng(3).uniform(-1, 14, 50), *t.knots, 13.0]
    e = np.random.default_rng(1).standard_normal(8)
    for p in static_gain:
        first, state = t.update(t.init(), e, np.zeros(8), np.zeros(4), p)
        held = np.clip(p, 0.0, 13.0)
        # eight products of numbers of size 1 in 32 bits
        np.testing.assert_allclose(first, t.model.at(held).D @ e, atol=8 * ROUNDING)
        assert state.parameter_used == np.float32(held)


# --- beside 64-bit arithmetic --------------------------------------------------------------------


def test_within_its_limits_a_table_runs_as_its_model_in_double_precision():
    t = table(order=6, limit=None)
    rng = np.random.default_rng(0)
    errors, p = 0.1 * rng.standard_normal((400, 8)), 6.0 + 5.0 * np.sin(0.008 * np.arange(400))
    monitor = ParameterMonitor(rate=math.inf)
    free = InFlight(replace(t, monitor=monitor))
    zeros, trim = np.zeros(8), np.zeros(4)
    mine = np.array([free.update(e, zeros, trim, at) for e, at in zip(errors, p, strict=True)])
    _, exact = t.model.simulate(p, errors)
    # eigenvalues up to .9 add up ten samples of rounding, of sums of 14 products each
    assert np.abs(mine - exact).max() < 140 * ROUNDING * np.abs(exact).max()
    assert np.abs(mine - exact).max() > 0.0  # it is another arithmetic


@pytest.mark.slow
def test_a_table_flies_as_its_model_does(heli):
    t = TableController.of(dynamic(heli).model)
    calm = {"wind": STORM, "delay": 0.02}  # a sensor that rounds would double any difference
    single, double = (fly(heli, SHORT, controller=c, **calm) for c in (t, t.in_double_precision))
    # rounding of 6e-8 in a stable loop of unit gain, through eleven signals and an integral
    assert 0.0 < differences(single, double) < 1e-4
    again = fly(heli, SHORT, controller=t, **calm)
    np.testing.assert_array_equal(again.values, single.values)


# --- commands that integrate ---------------------------------------------------------------------

RATES = tuple(f"{y}_rate" for y in OUTPUTS)


@pytest.mark.parametrize("outputs", [RATES, ("d_lon", "d_lat_rate", "d_col", "d_ped_rate")])
def test_rates_are_integrated_from_the_trim(outputs):
    t = table(order=3, outputs=outputs, limit=None)
    integrates = [y.endswith("_rate") for y in outputs]
    assert t.integrates == tuple(y for y, so in zip(OUTPUTS, integrates, strict=True) if so)
    source, errors = sampled(3, outputs=outputs), 0.1 * np.ones((50, 8))
    errors[25:] *= -1.0
    knot = float(t.knots[3])
    _, answer = source.simulate(np.full(50, knot), errors)
    expected = 0.05 + np.where(integrates, DT * np.cumsum(answer, axis=0), answer)
    trim = 0.05
    np.testing.assert_allclose(run(t, errors, knot, trim), expected, rtol=1e-5)
    _, certified = t.model.simulate(np.full(50, knot), errors)
    np.testing.assert_allclose(trim + certified, expected, rtol=1e-5)


def test_at_its_limit_a_command_that_integrates_waits_there():
    t = InFlight(static(1.0, output="d_lat_rate", limits={"d_lat": (-0.1, 0.1)}))
    up = t.run(np.full((500, 1), 1.0), 5.0)  # 10 s, five times what reaches the limit
    assert up.max() == np.float32(0.1) or up.max() == np.nextafter(np.float32(0.1), np.float32(0))
    assert t.status == StepEvents.SATURATED
    down = t.run(np.full((1, 1), -1.0), 5.0)
    assert down[0, 0] == pytest.approx(0.1 - DT, abs=1e-7)


# --- anti-windup ---------------------------------------------------------------------------------


def integral(correction=None):
    """PI on phi with its integral among the states."""
    model = symheli.LPVStateSpace(
        symheli.lpv.PiecewiseLinear((0.0, 10.0)),
        np.ones((2, 1, 1)),
        np.full((2, 1, 1), DT),
        np.ones((2, 1, 1)),
        np.full((2, 1, 1), 0.2),
        symheli.Scheduling("airspeed", "m/s", 0.0, 10.0, 3.0),
        ("integral",),
        ("phi",),
        ("d_lat",),
        DT,
    )
    limits = {"d_lat": (-0.1, 0.1)}
    return TableController.of(model, 3, correction=correction, limits=limits)


def test_a_saturated_integral_turns_at_once_with_anti_windup_and_late_without():
    """250 samples of an error of 1 up, then of -0.3."""
    up, back = np.full((250, 1), 1.0), np.full((600, 1), -0.3)
    flown = {}
    for name, correction in (("with", None), ("without", 0)):
        t = InFlight(integral(correction))
        t.run(up, 5.0)
        flown[name] = t.run(back, 5.0)[:, 0]
    assert flown["with"][1] < 0.0
    assert flown["without"].min() == flown["without"].max()  # at the limit: 5 up, 3.6 back, - 0.06


@pytest.mark.slow(but="pi")
def test_the_states_follow_saturated_commands_stably_whichever_saturate(heli):
    for t in (table(), TableController.of(dynamic(heli).model, 5)):
        n, own = t.order, t.order + len(t.inputs)
        M = t.matrices.astype(float)
        A, L, C = M[:, :n, :n], M[:, :n, own:], M[:, n:, :n]
        alone = np.abs(np.linalg.eigvals(A)).max(axis=1)
        together = np.abs(np.linalg.eigvals(A - L @ C)).max(axis=1)
        assert (together < 0.9).all()
        # an eigenvalue of magnitude 1 is so to rounding of 32 bits
        assert (saturated_radius(A, L, C) <= np.maximum(alone, 1.0) + 1e-5).all()


# --- entry ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("p", [0.0, 3.3, 13.0, 40.0])
def test_the_first_command_is_the_one_in_force_and_the_difference_fades(p):
    t = InFlight(replace(table(limit=None), fade=0.5))
    rng = np.random.default_rng(0)
    errors, now = rng.standard_normal((60, 8)), np.array([0.15, -0.1, 0.05, 0.19])
    own = t.run(errors, p, trim=0.02)
    t.reset(now)
    entered = t.run(errors, p, trim=0.02)
    np.testing.assert_array_equal(entered[0], now.astype(np.float32))
    faded = np.exp(-DT / 0.5 * np.arange(60))[:, None] * (now - own[0])
    # sums of numbers up to 1, in 32 bits, sixty times
    np.testing.assert_allclose(entered - own, faded, atol=60 * ROUNDING)


def test_an_entered_command_that_integrates_goes_on_from_there():
    t = InFlight(table(order=3, outputs=RATES, limit=None))
    now = np.array([0.1, 0.2, -0.1, 0.0])
    t.reset(now)
    errors = 0.1 * np.ones((3, 8))
    entered = t.run(errors, 5.0)
    np.testing.assert_array_equal(entered[0], now.astype(np.float32))
    t.reset()
    np.testing.assert_allclose(
        np.diff(entered, axis=0), np.diff(t.run(errors, 5.0), axis=0), atol=4 * ROUNDING
    )


def test_a_flight_is_handed_over_without_a_bump(ideal):
    """From an LQR to the table in the middle of a transition, nine states as they then are."""
    t, pilot = TableController.of(dynamic(ideal).model), dynamic(ideal)

    class Handed:
        dt, switch = DT, 120

        def reset(self):
            self.k, self.commands, self.state = 0, [], pilot.init()

        def step(self, measured, reference, p):
            if self.k == self.switch:
                self.state = t.init(self.commands[-1])
            early = self.k < self.switch
            u, self.state = (pilot if early else t).step(self.state, measured, reference, p)
            if early:
                u = 0.97 * u
            self.k += 1
            self.commands.append(u)
            return u

    handed = Handed()
    fly(ideal, SHORT, controller=handed)
    before, at, after = handed.commands[119:122]
    np.testing.assert_allclose(at, before, atol=1e-7)  # 32 bits of 64
    usual = np.abs(np.diff(handed.commands[100:119], axis=0)).max(axis=0)
    assert (np.abs(after - at) < 3 * usual + 1e-3).all()


# --- axes ----------------------------------------------------------------------------------------


def test_an_axis_flown_by_another_stays_and_begins_where_it_was():
    for outputs in (OUTPUTS, RATES):
        t = InFlight(table(order=3, outputs=outputs, limit=0.5))
        errors, trim = 0.1 * np.ones((300, 8)), np.full(4, 0.05)
        t.fly_axes(("d_lon", "d_ped"))
        for e in errors:
            elsewhere = np.array([9.0, 0.31, -0.02, 9.0])
            u = t.update(e, np.zeros(8), trim, 5.0 + 0.01 * e[0], others=elsewhere)
            np.testing.assert_array_equal(u[1:3], elsewhere[1:3].astype(np.float32))
        assert abs(u[0]) <= 0.5 >= abs(u[3])
        t.fly_axes(OUTPUTS)
        back = t.update(errors[0], np.zeros(8), trim, 5.0)
        np.testing.assert_array_equal(back[1:3], elsewhere[1:3].astype(np.float32))
        t.fly_axes(())
        np.testing.assert_array_equal(
            t.update(errors[0], np.zeros(8), trim, 5.0), trim.astype(np.float32)
        )


def test_an_integral_does_not_wind_up_while_another_flies():
    t = InFlight(integral())
    t.fly_axes(())
    t.run(np.full((500, 1), 1.0), 5.0)
    t.fly_axes(("d_lat",))
    after = t.run(np.full((400, 1), -0.1), 5.0)[:, 0]
    assert after[0] == 0.0
    # its own integral alone moves it, -0.1 DT a sample; what it was off by fades in seconds
    assert after[-1] < 0.0
    assert np.abs(after).max() <= 0.1


# --- airspeed ------------------------------------------------------------------------------------


def used_along(t, readings, valid=None):
    out = []
    for k, p in enumerate(readings):
        t.update(
            np.zeros(len(t.inputs)),
            np.zeros(len(t.inputs)),
            np.zeros(len(t.outputs)),
            p,
            valid=True if valid is None else bool(valid[k]),
        )
        out.append((t.state.parameter_used, t.status))
    used, status = zip(*out, strict=True)
    return np.array(used), list(status)


def gain(**monitor):
    return InFlight(static(1.0, follow="reading", monitor=ParameterMonitor(**monitor)))


@pytest.mark.slow
def test_whatever_is_read_the_airspeed_in_use_keeps_to_the_certified_rate():
    rng = np.random.default_rng(0)
    for seed in range(3):
        readings = rng.choice([0.0, 3.0, 9.99, 10.0, 12.0, 50.0, math.nan, -math.inf], 2000)
        readings[::7] = rng.uniform(0, 10, len(readings[::7]))
        t = gain(lag=0.05 * seed, hold=0.1, frozen=0.2)
        used, _ = used_along(t, readings, rng.random(2000) > 0.1)
        assert np.abs(np.diff(used)).max() <= 3.0 * DT  # exactly: of 32-bit numbers in 64 bits
        assert np.abs(np.diff(used)).max() > 0.99 * 3.0 * DT
        assert used.min() >= 0.0
        assert used.max() <= 10.0


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 21.0, -11.0, "invalid", "frozen"])
def test_a_bad_airspeed_is_held_and_then_left_for_the_fallback(wrong):
    good = np.linspace(5.5, 6.0, 50)
    bad = np.full(400, 6.0 if isinstance(wrong, str) else wrong)
    if wrong == "invalid":
        bad = bad + 1e-3 * np.arange(400)
    t = gain(hold=1.0, fallback=2.0, frozen=0.5)
    valid = np.r_[np.ones(50), np.full(400, wrong != "invalid")]
    used, status = used_along(t, [*good, *bad], valid)
    assert not any(status[:50])
    late = 24 if wrong == "frozen" else 0  # the 25th repetition is half a second's
    held = used[50 + late : 50 + late + 50]
    np.testing.assert_array_equal(held, np.float32(6.0))
    assert set(status[50 + late : 50 + late + 50]) == {StepEvents.PARAMETER}
    moving = used[50 + late + 50 :]
    np.testing.assert_allclose(
        moving, np.maximum(6.0 - 3.0 * DT * np.arange(1, len(moving) + 1), 2.0), atol=2e-4
    )
    assert moving[-1] == 2.0
    assert status[-1] == StepEvents.PARAMETER | StepEvents.FALLBACK
    back, _ = used_along(t, np.linspace(6.1, 6.2, 100))
    assert back[0] == pytest.approx(2.06, abs=1e-5)


def test_an_entry_with_a_bad_airspeed_begins_at_the_fallback():
    t = gain(fallback=3.0)
    used, status = used_along(t, [math.nan, 8.0, 8.0])
    np.testing.assert_allclose(used, [3.0, 3.06, 3.12], rtol=1e-5)
    assert status[0] == StepEvents.PARAMETER | StepEvents.FALLBACK


def test_the_filter_before_the_limit_lags_by_its_time_constant():
    t = gain(rate=1000.0, lag=0.4, frozen=math.inf)
    used, _ = used_along(t, [2.0, *np.full(100, 3.0)])
    np.testing.assert_allclose(
        used, 3.0 - np.exp(-DT / 0.4 * np.arange(101)), atol=100 * 3 * ROUNDING
    )


def test_a_constant_command_is_no_frozen_reading():
    t = InFlight(static(1.0, monitor=ParameterMonitor(frozen=0.1)))
    used, status = used_along(t, np.full(100, 7.0))
    assert set(used) == {7.0}
    assert not any(status)


def test_numbers_that_are_none_hold_the_commands_and_harm_nothing():
    clean, t = InFlight(table()), InFlight(table())
    errors = 0.1 * np.random.default_rng(0).standard_normal((50, 8))
    clean.run(errors, 5.0), t.run(errors, 5.0)
    before = t.run(errors[:1], 5.0)[0]
    clean.run(errors[:1], 5.0)
    hurt = errors[1].copy()
    hurt[3] = math.nan
    np.testing.assert_array_equal(t.update(hurt, np.zeros(8), np.zeros(4), 5.0), before)
    assert t.status & StepEvents.HELD
    huge = np.full(8, 3e38)
    np.testing.assert_array_equal(t.update(huge, np.zeros(8), np.zeros(4), 5.0), before)
    np.testing.assert_array_equal(t.run(errors, 6.0), clean.run(errors, 6.0))


# --- files ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0, 5])
def test_a_table_comes_back_from_its_file_to_the_last_bit(tmp_path, order):
    t = table(order=order, limit=None, outputs=("d_lon", "d_lat_rate", "d_col", "d_ped"))
    t = replace(t, limits={"d_lat": (-math.inf, 0.1)}, monitor=ParameterMonitor(hold=math.inf))
    back = TableController.load(t.save(tmp_path / "t.json"))
    for name in ("knots", "matrices"):
        np.testing.assert_array_equal(getattr(back, name), getattr(t, name))
    for name in (
        "states",
        "inputs",
        "outputs",
        "dt",
        "integrates",
        "limits",
        "rate",
        "fade",
        "monitor",
        "follow",
        "misfit",
        "parameter",
    ):
        assert getattr(back, name) == getattr(t, name), name
    assert back.inputs[0].unit == "m/s"
    errors = np.random.default_rng(0).standard_normal((30, 8))
    np.testing.assert_array_equal(run(back, errors, 5.0), run(t, errors, 5.0))


def test_a_file_from_before_tables_named_their_parameter_is_one_over_airspeed(tmp_path):
    t = table(order=1)
    content = plain_file.read(t.save(tmp_path / "new.json"), SCHEMA)
    content["airspeed"] = content.pop("monitor")
    del content["parameter"]
    back = TableController.load(plain_file.write(tmp_path / "old.json", SCHEMA, content))
    assert (back.parameter, back.parameter.unit) == ("airspeed", "m/s")
    assert back.monitor == t.monitor
    np.testing.assert_array_equal(back.matrices, t.matrices)


def test_a_damaged_file_says_so(tmp_path):
    path = table(order=1).save(tmp_path / "t.json")
    whole = path.read_text()
    path.write_text(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a whole file of 'symheli table controller'"):
        TableController.load(path)
    path.write_text(whole.replace('"dt": 0.02', '"dt": 0.03'))
    with pytest.raises(InputError, match="does not match its digest"):
        TableController.load(path)
    path.write_text(json.dumps({"schema": "symheli LPV-ARX model"}))
    with pytest.raises(InputError, match="expected a file of 'symheli table controller'"):
        TableController.load(path)
    with pytest.raises(InputError, match=r"none\.json"):
        TableController.load(tmp_path / "none.json")


# --- any parameter -------------------------------------------------------------------------------


def test_a_table_over_any_parameter_is_the_one_over_airspeed_under_its_name(tmp_path):
    """Name and unit are kept by save and load; the numbers do not depend on them."""
    own = over(MACH)
    other = TableController.of(sampled(2, low=0.2, high=0.9, rate=0.1), 5)
    back = TableController.load(own.save(tmp_path / "mach.json"))
    s = back.model.scheduling
    assert (s.name, s.unit, s.low, s.rate) == ("Mach", "1", np.float32(0.2), 0.1)
    errors = np.random.default_rng(0).standard_normal((30, 8))
    for at in (0.2, 0.55, 1.1):
        np.testing.assert_array_equal(run(back, errors, at), run(other, errors, at))
    with pytest.raises(InputError, match=r"rate: 1e-09 1/s moves Mach by less"):
        over(MACH, monitor=ParameterMonitor(rate=1e-9))
    with pytest.raises(InputError, match=r"within 0\.2 to 0\.9 1, the range of Mach"):
        over(MACH, (0.1, 0.5))


@pytest.mark.parametrize("follow", ["command", "reading"])
def test_a_flight_does_not_feed_its_airspeed_to_a_table_over_something_else(ideal, follow):
    hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    with pytest.raises(InputError, match=r"over Mach \(1\), and a flight provides .*airspeed"):
        fly(ideal, hover, controller=over(MACH, follow=follow))
    wrong = symheli.Scheduling("airspeed", "rad", 0.0, 13.0, 3.0)
    with pytest.raises(InputError, match=r"over airspeed \(rad\)"):
        fly(ideal, hover, controller=over(wrong, follow=follow))


def test_what_a_flight_provides_in_another_unit_is_converted(ideal):
    lqr = symheli.flight.gain_scheduled_lqr(
        ideal, 0.0, 8.0, dt=DT, points=5
    ).scheduled_controller.model
    speed = lqr.with_scheduling(symheli.Scheduling("airspeed", "km/h", 0.0, 28.8, 10.8))
    climb = symheli.AirspeedSchedule.transition(3.0, 5.0, acceleration=2.0, hold=0.5)
    models = lqr.with_rate(3.0), speed
    own, told = (InPython(TableController.of(model, 9)) for model in models)
    flown = [fly(ideal, climb, controller=each).values for each in (told, own)]
    np.testing.assert_allclose(*flown, atol=1e-4)  # 32 bits round the knots otherwise
    used = told.state.parameter_used
    assert used == pytest.approx(3.6 * own.state.parameter_used, rel=1e-5)


def test_a_table_over_the_acceleration_flies_and_one_over_nothing_too(ideal):
    """What the flight commands beside the airspeed serves too; a constant controller needs none."""
    lqr = symheli.flight.gain_scheduled_lqr(
        ideal, 0.0, 8.0, dt=DT, points=5
    ).scheduled_controller.model
    hold = symheli.AirspeedSchedule.transition(3.0, 3.5, acceleration=0.5, hold=0.3)
    box = symheli.Scheduling("acceleration", "m/s^2", -1.0, 1.0, 5.0)
    records = []
    for scheduling in ((box,), ()):
        table = TableController.of(LPVStateSpace.constant(lqr.at(3.0), *scheduling), 3)
        records.append(fly(ideal, hold, controller=table).values)
    np.testing.assert_array_equal(*records)


# --- a design in velocity form -------------------------------------------------------------------


def test_a_table_of_the_velocity_form_is_the_loop_that_was_designed():
    """Where the command is a measurement too, the table reads its own: the plant with a sample of
    delay under the table is the plant behind integrators under the design.
    """
    roll = symheli.LinearModel(
        [[-8.0, 0.0], [1.0, 0.0]], [[120.0, 1.0], [0.0, 0.0]], np.eye(2), np.zeros((2, 2)),
        ("p", "phi"), ("d_lat", "gust"), ("p", "phi"),
    ).discretize(DT)  # fmt: skip
    bare = synthesis.Plant(
        roll, disturbances=["gust"], performance=["phi"], controls=["d_lat"],
        measurements=["phi", "p"],
    )  # fmt: skip
    gains = LinearModel.gain([[-2.0, -0.5, -9.0]], ("phi", "p", "d_lat_command"), ("d_lat_rate",))
    design = LPVStateSpace.constant(replace(gains, dt=DT), MACH)
    t = TableController.of(design, 2)
    assert t.own_commands == {"d_lat_command": "d_lat"}
    loops = (
        bare.velocity_form(measured=True).close(design),
        bare.with_delay(DT).close(t),
    )
    own, flown = (loop.at(0.5).frequency_response(np.geomspace(0.1, 100.0, 9)) for loop in loops)
    np.testing.assert_allclose(flown, own, rtol=1e-5)  # 32 bits
    # in flight too: the response of the closed integrator to a constant error
    model, h, u = t.model.at(0.5), 0.0, []
    for _ in range(20):
        u.append(model.C[0, 0] * h + model.D[0, 0] * 0.01)
        h = model.A[0, 0] * h + model.B[0, 0] * 0.01
    flown, in_force, t = [], np.zeros(1), InFlight(t)
    for _ in range(20):
        in_force = t.update([0.01, 0.0, in_force[0] + 0.1], [0.0, 0.0, 0.1], [0.1], 0.5) - 0.1
        flown.append(float(in_force[0]))
    np.testing.assert_allclose(flown, u, atol=1e-6)


def test_a_controller_that_reads_its_command_flies_on_and_off_the_ground(ideal):
    """`fly` tells it the command in force: the record is that of a controller that keeps it."""
    names = ("phi", "p", "d_lat_command")
    gains = LinearModel.gain([[-2.0, -0.5, -9.0]], names, ("d_lat_rate",))
    speed = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
    design = LPVStateSpace.constant(replace(gains, dt=DT), speed)
    t = TableController.of(design, 2)

    class ByHand:
        dt = DT

        def reset(self):
            self.u = None

        def step(self, measured, reference, p):
            out = np.array([reference[name] for name in OUTPUTS])
            before = out[1] if self.u is None else self.u
            error = [measured[s] - reference[s] for s in names[:2]] + [before - out[1]]
            self.u = out[1] = before + DT * float(gains.D[0] @ error)
            return out

    hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    own, hand = (fly(ideal, hover, controller=c) for c in (t, ByHand()))
    np.testing.assert_allclose(own.values, hand.values, atol=1e-4)
    assert np.ptp(own["d_lat"]) > 1e-6
    with pytest.raises(InputError, match=r"d_lat_rate: .* integrated by a TableController"):
        symheli.flight.ScheduledController(design)
    bad = replace(gains, dt=DT, inputs=("phi", "p", "d_ped_command"))
    other = TableController.of(LPVStateSpace.constant(bad, speed), 2)
    with pytest.raises(InputError, match="unknown measured signal 'd_ped_command'"):
        fly(ideal, hover, controller=other)
    held = TableController.of(design, 2, integrates=()).outputs
    assert [(str(y), y.unit) for y in held] == [("d_lat_rate", "1")]
    with pytest.raises(InputError, match="unknown command that integrates 'd_ped'"):
        TableController.of(design, 2, integrates=["d_ped"])


def missile(**names):
    """A controller of another vehicle over the Mach number, with integral action on its fin."""
    speed = symheli.Scheduling("Mach", "1", 2.0, 4.0, 0.5)
    signals = {"states": ("filter",), "inputs": ("az_error", "q"), "outputs": ("fin_rate",)} | names
    basis = symheli.lpv.Polynomial(1, 2.0, 4.0)
    matrices = ([[0.8]], [[0.1, 0.2]], [[0.5]], [[-0.3, 0.4]])
    A, B, C, D = (np.stack([np.array(m), 0.05 * np.array(m)]) for m in matrices)
    return LPVStateSpace(
        basis,
        A,
        B,
        C,
        D,
        speed,
        dt=DT,
        **{k: symheli.values.signals(v) for k, v in signals.items()},
    )


def test_names_and_units_of_another_vehicle_are_kept(ideal, tmp_path):
    model = missile(outputs=(symheli.values.Signal("fin_rate", "deg/s"),))
    t = TableController.of(model, 5, limits={"fin": (-20.0, 20.0)})
    assert [*t.inputs, *t.outputs, *t.integrates] == ["az", "q", "fin", "fin"]
    assert (t.outputs[0].unit, t.model.states[-1], t.model.states[-1].unit) == (
        "deg",
        "fin_held",
        "deg",
    )
    back = TableController.load(t.save(tmp_path / "fin.json"))
    assert back.outputs[0].unit == "deg"
    # one step by hand: e = measured - reference, of az with the other sign
    p, e = 3.0, np.array([0.5, -0.2])
    u, _ = back.update(back.init(), e, np.zeros(2), [1.0], p)
    by_hand = 1.0 + DT * (np.tensordot(model.basis(p), model.D, axes=1) @ (e * [-1, 1])).item()
    assert float(u[0]) == pytest.approx(by_hand, rel=1e-6)
    hover = symheli.AirspeedSchedule((2.0,), (1.0,), (0.0,), lead=0.2)
    with pytest.raises(InputError, match=r"over Mach \(1\), and a flight provides"):
        fly(ideal, hover, controller=back)
    with pytest.raises(InputError, match=r"limits\['fin'\]: expected \(low, high\) in deg"):
        TableController.of(model, 5, limits={"fin": (1.0, -1.0)})
    turning = sampled(1, outputs=(symheli.values.Signal("d_lon", "deg"),))
    with pytest.raises(InputError, match=r"d_lon in deg, and a flight has it in rad"):
        fly(ideal, hover, controller=TableController.of(turning, 5))


# --- bad input -----------------------------------------------------------------------------------


def test_what_is_no_table_is_refused():
    good = sampled(2)
    height = symheli.Scheduling("height", "m", 0.0, 13.0)

    def bad(**change):
        return replace(good, **change)

    for model, knots, said in (
        (3.0, 5, "expected an LPVStateSpace, .* got float"),
        (bad(dt=None), 5, "is continuous"),
        (good.with_parameter(height), 5, "one scheduling parameter, .* over airspeed, height"),
        (good, 1, "at least 2"),
        (good, (0.0, 5.0, 4.0), "that increase"),
        (good, (0.0, 5.0, 5.0 + 1e-9), "in 32 bits too"),
        (good, (0.0, math.nan), r"entry \(1,\) is nan"),
        (good, (0.0, 14.0), "within 0 to 13 m/s"),
        (bad(D=1e41 * good.D), 5, "beyond the largest number of 32 bits"),
    ):
        with pytest.raises(InputError, match=said):
            TableController.of(model, knots)
    for options, said in (
        ({"limits": {"d_lon": (0.1, -0.1)}}, r"limits\['d_lon'\]: expected \(low, high\)"),
        ({"limits": {"roll": (0.1, 0.2)}}, "unknown output with a limit 'roll'"),
        ({"limits": 0.1}, "limits: expected"),
        ({"fade": 0.0}, "fade"),
        ({"follow": "wind"}, "unknown way to schedule 'wind'"),
        ({"correction": np.zeros((3, 3))}, r"correction: expected \(states, outputs\) \(2, 4\)"),
        ({"correction": np.full((2, 4), math.nan)}, "matrices: entry"),
        ({"monitor": ParameterMonitor(fallback=20.0)}, "fallback: expected a value of the"),
        ({"monitor": ParameterMonitor(rate=1e-6)}, "than 32 bits resolve"),
    ):
        with pytest.raises(InputError, match=said):
            TableController.of(good, 5, **options)
    undecaying = bad(A=np.eye(2)[None] * good.basis.constant()[:, None, None], C=0.0 * good.C)
    with pytest.raises(InputError, match="neither decays nor shows in a command"):
        TableController.of(undecaying, 5)
    t = TableController.of(good, 5)
    with pytest.raises(InputError, match="measured: expected 8 numbers"):
        t.update(t.init(), [0.0], np.zeros(8), np.zeros(4), 5.0)
    with pytest.raises(InputError, match="unknown output 'roll'"):
        t.fly_axes(t.init(), ("roll",))
    with pytest.raises(InputError, match="unknown output 'roll'"):
        t.init(axes=("roll",))
    with pytest.raises(InputError, match="command: expected shape"):
        t.init([0.0])
    for state in (None, np.zeros(4), table(order=3).init()):
        with pytest.raises(InputError, match=r"state: expected that of init\(\)"):
            t.update(state, np.zeros(8), np.zeros(8), np.zeros(4), 5.0)
    with pytest.raises(InputError, match="integrate from a command on"):
        _ = table(outputs=RATES).in_double_precision


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"rate": -1.0}, "rate: expected a number >= 0"),
        ({"lag": math.nan}, "lag"),
        ({"lag": math.inf}, "lag: expected a finite"),
        ({"hold": "long"}, "hold"),
        ({"fallback": math.inf}, "fallback"),
        ({"plausible": (3.0, 3.0)}, "plausible"),
        ({"plausible": 3.0}, "plausible"),
    ],
)
def test_a_monitor_of_nonsense_is_refused(options, said):
    with pytest.raises(InputError, match=said):
        ParameterMonitor(**options)
