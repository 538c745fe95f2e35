"""Any controller flies: what it is made of and where it runs changes no flight."""

import control
import numpy as np
import pytest
from flight.flown import EVERYTHING, INPUTS, SHORT, SLOW, InPython, differences, dynamic

import symheli
from symheli import LinearModel, fly
from symheli.errors import InputError
from symheli.flight import XCELL_SERVOS, Autopilot, ScheduledController, gain_scheduled_lqr
from symheli.flight.autopilot import SIZES


@pytest.fixture(scope="module")
def pilot():
    return gain_scheduled_lqr(symheli.Helicopter.load("xcell60", governor="ideal"), 0.0, 13.0, 0.02)


@pytest.fixture(scope="module")
def at_one_speed(pilot):
    return LinearModel.gain(-pilot.gain(5.0), pilot.states, INPUTS)


def test_only_the_ratios_of_the_sizes_of_an_lqr_matter(ideal):
    """All sizes three times as large are the same weights but for a factor."""
    given = {"points": 2, "dt": 0.02}
    usual = gain_scheduled_lqr(ideal, 5.0, 6.0, **given)
    larger = gain_scheduled_lqr(
        ideal, 5.0, 6.0, sizes={s: 3 * v for s, v in SIZES.items()}, **given
    )
    assert np.allclose(larger.gains, usual.gains, rtol=1e-9)  # of two Riccati equations
    softer = gain_scheduled_lqr(ideal, 5.0, 6.0, sizes={"d_ped": 1e-4}, **given)
    assert np.abs(softer.gains[:, 3]).max() < 0.1 * np.abs(usual.gains[:, 3]).max()


@pytest.mark.parametrize(("sizes", "said"), [({"psi": 1.0}, "psi"), ({"u": 0.0}, "size of u")])
def test_a_size_that_an_lqr_cannot_have_is_named(ideal, sizes, said):
    with pytest.raises(InputError, match=said):
        gain_scheduled_lqr(ideal, 5.0, 6.0, 0.02, 2, sizes=sizes)


@pytest.mark.slow(only=("ideal-table", "pi-table", "pi-lpv"))
@pytest.mark.parametrize("make", ["table", "lpv", "reading"])
def test_machine_code_and_python_ask_the_same(heli, make):
    controller = {
        "table": lambda: gain_scheduled_lqr(heli, 0.0, 13.0, 0.02).scheduled_controller,
        "lpv": lambda: dynamic(heli),
        "reading": lambda: dynamic(heli, "reading"),
    }[make]()
    compiled = fly(heli, SHORT, controller=controller, **EVERYTHING)
    asked = fly(heli, SHORT, controller=InPython(controller), **EVERYTHING)
    # sums of ten products in another order, in a stable loop
    assert differences(compiled, asked) < 1e-11


def test_gains_of_any_kind_fly_alike(ideal, at_one_speed):
    system = control.ss(
        [], [], [], at_one_speed.D, inputs=list(at_one_speed.inputs), outputs=list(INPUTS)
    )
    table = Autopilot([0.0, 13.0], [-at_one_speed.D] * 2, at_one_speed.inputs, dt=0.02)
    flown = [fly(ideal, SHORT, controller=c, dt=0.02) for c in (at_one_speed, system, table)]
    for other in flown[1:]:
        assert differences(other, flown[0]) < 1e-12


def test_a_continuous_controller_is_sampled_as_the_flight_is(ideal, at_one_speed):
    lag = 20.0  # rad/s
    slow = LinearModel(
        -lag * np.eye(4),
        lag * at_one_speed.D,
        np.eye(4),
        np.zeros((4, 8)),
        tuple(f"x{i}" for i in range(4)),
        at_one_speed.inputs,
        INPUTS,
    )
    first, second = (fly(ideal, SHORT, controller=c) for c in (slow, slow.discretize(0.02)))
    np.testing.assert_array_equal(first.values, second.values)


def test_a_table_is_straight_between_its_airspeeds_and_held_beyond_them(pilot):
    at = pilot.airspeeds
    for V in (0.0, 0.3, 6.1, 13.0):
        K = [
            [np.interp(V, at, pilot.gains[:, i, j]) for j in range(len(pilot.states))]
            for i in range(4)
        ]
        np.testing.assert_allclose(pilot.gain(V), K, rtol=1e-13, atol=1e-15)
    np.testing.assert_array_equal(pilot.gain(20.0), pilot.gain(13.0))


def test_two_parameters_and_functions_that_are_no_polynomials(ideal, pilot):
    """Airspeed and acceleration: u = -(K0 + a K1)(x - x0), in machine code and in Python."""
    speed = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0)
    push = symheli.Scheduling("acceleration", "m/s^2", -4.0, 4.0)
    K0, K1 = pilot.gain(4.0), 0.01 * pilot.gain(9.0)
    none = np.zeros((0, 0)), np.zeros((0, 8)), np.zeros((4, 0))
    model = symheli.LPVStateSpace.polynomial(
        *({(0, 0): m} for m in none),
        {(0, 0): -K0, (0, 1): -K1},
        (speed, push),
        dt=0.02,
        inputs=pilot.states,
        outputs=INPUTS,
    )

    class Written:
        dt = 0.02

        def reset(self):
            pass

        def step(self, measured, reference, p):
            e = np.array([measured[s] - reference[s] for s in pilot.states])
            u0 = np.array([reference[s] for s in INPUTS])
            return u0 - (K0 + p["acceleration"] * K1) @ e

    flown, written = (fly(ideal, SHORT, controller=c) for c in (model, Written()))
    assert differences(flown, written) < 1e-11
    waves = symheli.lpv.UserFunctions((lambda p: np.ones_like(p), np.sin), 0.0, 13.0)
    curved = symheli.LPVStateSpace(
        waves,
        np.zeros((2, 0, 0)),
        np.zeros((2, 0, 8)),
        np.zeros((2, 4, 0)),
        np.stack([-K0, -0.02 * K0]),
        speed,
        (),
        pilot.states,
        INPUTS,
        0.02,
    )
    first = fly(ideal, SHORT, controller=curved)
    second = fly(ideal, SHORT, controller=InPython(ScheduledController(curved)))
    assert differences(first, second) < 1e-11


def test_a_wrong_airspeed_moves_the_controller_that_follows_it(ideal):
    late = {"airspeed": symheli.Sensor(bias=3.0)}
    with_error, without = (
        fly(ideal, SHORT, controller=dynamic(ideal, "reading"), sensors=sensors)
        for sensors in (late, None)
    )
    assert differences(with_error, without) > 1e-4
    blind, seeing = (
        fly(ideal, SHORT, controller=dynamic(ideal), sensors=sensors) for sensors in (late, None)
    )
    np.testing.assert_array_equal(blind.values, seeing.values)


def test_a_slower_record_keeps_every_nth_sample(ideal, pilot):
    fine, coarse = (fly(ideal, SHORT, controller=pilot, dt=dt) for dt in (0.02, 0.06))
    n = min(len(coarse), -(-len(fine) // 3))
    np.testing.assert_allclose(coarse.values[:n], fine.values[::3][:n], rtol=1e-10, atol=1e-12)


def test_a_delay_is_one_of_the_command(ideal, pilot):
    late = fly(ideal, SHORT, controller=pilot, delay=0.04)
    for name in INPUTS:
        np.testing.assert_array_equal(late[name][2:], late[f"{name}_command"][:-2])
        assert late[name][0] == late[f"{name}_reference"][0]


def test_level_trims_leave_the_drift_to_the_controller(ideal, pilot):
    quasi, level = (fly(ideal, SHORT, controller=pilot, trims=t) for t in ("quasi-steady", "level"))
    k = int(np.abs(np.gradient(quasi["airspeed_command"])).argmax())
    V = level["airspeed_command"][k]
    assert level["theta_reference"][k] == pytest.approx(symheli.trim(ideal, V).x["theta"], abs=1e-4)
    assert abs(quasi["theta_reference"][k] - level["theta_reference"][k]) > 0.1
    behind = [np.abs(r["airspeed"] - r["airspeed_command"]).max() for r in (quasi, level)]
    assert behind[1] > 1.5 * behind[0]


def test_references_are_those_of_the_wind(ideal, pilot):
    level = symheli.AirspeedSchedule((4.0,), (1.0,), (0.4,), start=4.0, lead=0.4)
    record = fly(ideal, level, controller=pilot, wind=(-2.0, 1.0, 0.0))
    point = symheli.trim(ideal, 4.0, wind=(-2.0, 1.0, 0.0))
    for name in ("u", "v", "phi", "d_lat"):
        held = point.x[name] if name in point.x else point.u[name]
        np.testing.assert_allclose(record[f"{name}_reference"], held, atol=1e-9)
        np.testing.assert_allclose(record[name], held, atol=1e-7)


def test_what_is_no_controller_is_refused(ideal, pilot):
    speed = symheli.Scheduling("airspeed", "m/s", 0.0, 13.0)
    height = symheli.Scheduling("height", "m", 0.0, 100.0)
    K = np.zeros((1, 1))
    none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))

    def model(parameter=speed, inputs=("phi",), outputs=("d_lat",), dt=0.02):
        return symheli.LPVStateSpace.polynomial(
            *([m] for m in (*none, K)), parameter, dt=dt, inputs=inputs, outputs=outputs
        )

    class Mute:
        dt = 0.02

        def reset(self):
            pass

        def step(self, measured, reference, p):
            return [np.nan] * 4

    for controller, said in (
        (3.0, "expected gains over airspeed"),
        (Mute, "expected gains over airspeed"),
        (Mute(), r"returned \[nan, nan, nan, nan\] at 0 s: expected d_lon d_lat d_col d_ped"),
        (
            model(inputs=("bank",)),
            "unknown name of a signal of the controller: unknown measured signal 'bank'",
        ),
        (model(inputs=("a1",)), "unknown measured signal 'a1'"),
        (model(outputs=("roll",)), "unknown helicopter input 'roll'"),
        (model(height), r"this model is scheduled by height \(m\)"),
        (model(dt=0.013), "was designed for 0.013 s"),
        (control.ss(-1, 1, 1, 0), "unknown name of a signal of the controller"),
        (Autopilot([0.0, 5.0], np.zeros((2, 4, 1)), ["a1"], 0.02), "unknown measured signal 'a1'"),
    ):
        with pytest.raises(InputError, match=said):
            fly(ideal, SHORT, controller=controller)
    with pytest.raises(InputError, match="is continuous"):
        ScheduledController(model(dt=None))
    with pytest.raises(InputError, match="only a controller over airspeed alone"):
        ScheduledController(model(symheli.Scheduling("acceleration", "m/s^2", -1, 1)), "reading")
    with pytest.raises(InputError, match="gains: expected shape"):
        Autopilot([0.0, 5.0], np.zeros((3, 4, 8)), pilot.states, 0.02)


def test_the_rate_of_a_servo_is_limited_in_flight(ideal, pilot):
    """Where the limit is not reached nothing else differs: these flights reach it."""
    limited, free = (
        fly(ideal, SHORT, controller=pilot, **{**EVERYTHING, "servos": servos})
        for servos in (SLOW, XCELL_SERVOS)
    )
    assert differences(limited, free) > 1e-3
