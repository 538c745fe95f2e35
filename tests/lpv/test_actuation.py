"""Servos, delay and hold as one value: against their parts, against SciPy, and in every user."""

from dataclasses import replace

import numpy as np
import pytest
from families import random_lpv
from scipy.signal import lsim

import identification as idn
import symheli
import synthesis
from symheli import LinearModel, Servo
from symheli.errors import InputError, UnknownNameError
from symheli.flight import XCELL_SERVOS, gain_scheduled_lqr
from symheli.lpv.tools import Actuation, pade_delay, sample_delay
from symheli.values.signal import Signal, signals
from synthesis.sheet.proven import peak_loop
from synthesis.sheet.sheet import Sheet

DT = 0.02
SERVO = Servo(natural_frequency=33.0, damping=0.7)
SERVOS = {"d_lat": XCELL_SERVOS["d_lat"], "d_ped": XCELL_SERVOS["d_ped"]}
CLIMB = symheli.AirspeedSchedule.transition(4.0, 5.0, acceleration=1.0, hold=0.5)
PLANT = {
    "disturbances": {"gust": 1.0},
    "performance": {"phi": 0.1},
    "controls": {"d_lat": 0.01, "d_ped": 0.01},
    "measurements": {"phi": 0.01},
}
"""Sizes of the signals of a plant."""


def roll(dt=None):
    rng = np.random.default_rng(0)
    inputs, states = ("d_lat", "d_ped", "gust"), ("p", "phi", "r")
    A = rng.standard_normal((3, 3)) - 3 * np.eye(3)
    made = LinearModel(
        A, rng.standard_normal((3, 3)), np.eye(3), np.zeros((3, 3)), states, inputs, states
    )
    return made if dt is None else made.discretize(dt)


def over_airspeed():
    model, _ = random_lpv(2, nx=3, nu=3, ny=3, seed=1)
    return replace(model, inputs=signals(("d_lat", "d_ped", "gust")))


def linear(servos):
    return {u: servo.linear(u) for u, servo in servos.items()}


def same(found, expected):
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert (found.states, found.inputs, found.dt) == (
        expected.states,
        expected.inputs,
        expected.dt,
    )


@pytest.mark.parametrize("model", [roll(), over_airspeed()], ids=["LTI", "LPV"])
def test_a_continuous_model_is_behind_servos_and_pades_delay(model):
    late = {str(u): pade_delay(str(u), 0.03) for u in model.inputs}
    expected = model.driven_by(linear(SERVOS)).driven_by(late)
    same(Actuation(SERVOS, delay=0.03).behind(model), expected)
    same(Actuation(SERVOS, delay=0.03, period=DT).behind(model), expected)  # without the hold
    same(Actuation().behind(model), model)


@pytest.mark.parametrize("model", [roll(), over_airspeed()], ids=["LTI", "LPV"])
def test_a_sampled_model_is_behind_held_commands_and_whole_samples(model):
    held = model.driven_by(linear(SERVOS)).discretize(DT)
    late = {str(u): sample_delay(str(u), 2, DT) for u in model.inputs}
    actuation = Actuation(SERVOS, delay=0.04, period=DT)
    assert actuation.samples == 2
    same(actuation.discretize(model), held.driven_by(late))
    same(Actuation(delay=0.04, period=DT).discretize(held), held.driven_by(late))
    same(Actuation(delay=0.04).behind(held), held.driven_by(late))
    same(Actuation(period=DT).discretize(model), model.discretize(DT))


def test_only_the_controls_that_are_named_are_behind_it():
    model, actuation = roll(), Actuation(SERVOS, delay=0.03)
    own = {"d_lat": SERVOS["d_lat"].linear("d_lat")}
    expected = model.driven_by(own).driven_by({"d_lat": pade_delay("d_lat", 0.03)})
    same(actuation.behind(model, ["d_lat"]), expected)
    held = model.driven_by(own).discretize(DT).driven_by({"d_lat": sample_delay("d_lat", 2, DT)})
    same(Actuation(SERVOS, delay=0.04, period=DT).discretize(model, ["d_lat"]), held)
    straight = actuation.behind(model, ["d_lat"]).select(inputs=["gust"]).frequency_response([5.0])
    np.testing.assert_allclose(straight, model.select(inputs=["gust"]).frequency_response([5.0]))
    assert set(actuation.select(["d_ped", "gust"]).servos) == {"d_ped"}


def test_held_late_commands_through_a_servo_are_those_of_scipy():
    """wn^2 / (s (s^2 + 2 z wn s + wn^2)): the command steps at the samples, two of them later."""
    integrator = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ("x",), ("d_lat",), ("y",))
    found = Actuation({"d_lat": SERVO}, delay=2 * DT, period=DT).discretize(integrator)
    u, every = np.random.default_rng(0).standard_normal(60), 20
    wn, z = SERVO.natural_frequency, SERVO.damping
    held = np.repeat(np.concatenate([[0.0, 0.0], u])[: len(u)], every)
    time = DT / every * np.arange(len(held))
    system = ([wn**2], [1.0, 2 * z * wn, wn**2, 0.0])
    _, expected, _ = lsim(system, held, time, interp=False)
    x, y = np.zeros(len(found.states)), []
    for command in u:
        y.append(found.C[0] @ x)
        x = found.A @ x + found.B[:, 0] * command
    np.testing.assert_allclose(y, expected[::every], atol=1e-12)


def test_python_control_and_scheduled_servos_are_taken():
    control = pytest.importorskip("control")
    model, lag = roll(), control.tf([20.0], [1.0, 20.0])
    found = Actuation({"d_lat": lag}).behind(model).select(inputs=["d_lat"])
    np.testing.assert_allclose(
        found.frequency_response([7.0]),
        model.select(inputs=["d_lat"]).frequency_response([7.0]) * 20.0 / (20.0 + 7.0j),
        rtol=1e-12,
    )
    scheduled, _ = random_lpv(2, nx=1, nu=1, ny=1, seed=3)
    wide = over_airspeed()
    same(Actuation({"d_lat": scheduled}).behind(wide), wide.driven_by({"d_lat": scheduled}))
    with pytest.raises(InputError, match=r"of d_lat: expected a LinearModel .* got LPVStateSpace"):
        Actuation({"d_lat": scheduled}).behind(model)
    frozen = scheduled.at(4.0)
    same(Actuation({"d_lat": frozen}).behind(model), model.driven_by({"d_lat": frozen}))


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: Actuation(delay=-0.02), "delay: expected a number of seconds >= 0, got -0.02"),
        (lambda: Actuation(delay=True), "delay: expected a number of seconds >= 0, got True"),
        (lambda: Actuation(delay=np.nan), "delay: expected a finite number of seconds"),
        (lambda: Actuation(period=0.0), "period: expected a number > 0, got 0.0"),
        (lambda: Actuation(period=True), "period: expected a number > 0, got True"),
        (lambda: Actuation([SERVO]), "servos: expected {input: servo}"),
        (lambda: Actuation({"d_lat": 33.0}), "the actuator of d_lat: expected a Servo"),
        (lambda: Actuation(delay=0.03, period=DT).samples, "the nearest are 0.02 s and 0.04 s"),
        (lambda: Actuation(delay=0.03).samples, "give period too"),
        (lambda: Actuation(delay=0.03).behind(roll(DT)), "no whole number of samples"),
        (
            lambda: Actuation(SERVOS).behind(roll(DT)),
            r"dt = 0\.02, got .* with dt = None",
        ),
        (lambda: Actuation(SERVOS).discretize(roll()), "give its period"),
        (lambda: Actuation(SERVOS, 0.0, DT).discretize(roll(DT)), "in front of the sampling"),
        (lambda: Actuation(period=0.05).discretize(roll(DT)), "must have that period, got 0.05"),
        (lambda: Actuation.of(Actuation(delay=0.02), 0.02), "leave one out"),
        (lambda: Actuation.of(Actuation(period=DT), period=0.05), "they must agree"),
    ],
)
def test_what_does_not_fit_says_what_to_do(made, said):
    with pytest.raises(InputError, match=said):
        made()


def test_a_servo_of_no_input_is_refused():
    with pytest.raises(UnknownNameError, match="unknown input 'd_lon'"):
        Actuation({"d_lon": SERVO}).behind(roll())
    with pytest.raises(UnknownNameError, match="unknown input 'd_lon'"):
        Actuation().behind(roll(), ["d_lon"])


def test_separate_arguments_fill_what_an_actuation_lacks():
    whole = Actuation(SERVOS, 0.04, DT)
    assert Actuation.of(SERVOS, 0.04, DT) == whole
    assert Actuation.of(Actuation(SERVOS), 0.04, DT) == whole
    assert Actuation.of(whole) == whole
    assert Actuation.of(whole, period=DT) == whole


# --- users ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [None, DT])
def test_a_flight_through_an_actuation_is_that_of_its_parts(ideal, period):
    one = symheli.fly(ideal, CLIMB, servos=Actuation(XCELL_SERVOS, 0.02, period))
    two = symheli.fly(ideal, CLIMB, servos=XCELL_SERVOS, delay=0.02)
    assert one.meta["plan"] == two.meta["plan"]
    assert one.meta["plan"].actuation == Actuation(XCELL_SERVOS, 0.02)
    for name in two.signals:
        np.testing.assert_array_equal(one[name], two[name])


def test_a_flight_refuses_what_it_would_not_fly(ideal):
    for given, said in (
        ({"servos": Actuation(delay=0.02), "delay": 0.02}, "leave one out"),
        ({"servos": Actuation(period=0.05)}, "0.02 s, .* 0.05 s: they must agree"),
        ({"servos": Actuation({"d_lon": SERVO})}, "none given for d_lat, d_col, d_ped"),
        ({"servos": Actuation(linear(XCELL_SERVOS))}, r"servos\['d_lon'\]: expected a Servo"),
    ):
        with pytest.raises(InputError, match=said):
            symheli.FlightPlan(CLIMB, **given)


def test_an_autopilot_is_checked_behind_an_actuation(ideal):
    given = {"low": 4.0, "high": 6.0, "dt": DT, "points": 2}
    two = gain_scheduled_lqr(ideal, **given, servos=XCELL_SERVOS)
    one = gain_scheduled_lqr(ideal, **given, servos=Actuation(XCELL_SERVOS, period=DT))
    late = gain_scheduled_lqr(ideal, **given, servos=Actuation(XCELL_SERVOS, delay=DT))
    np.testing.assert_array_equal(one.gains, two.gains)
    assert one.radius == two.radius != late.radius  # the delay is in the model


@pytest.mark.parametrize("period", [None, DT])
def test_a_plant_behind_an_actuation_is_that_of_its_calls(period):
    model, actuation = roll(), Actuation(SERVOS, 0.04, period)
    names = [[*group] for group in PLANT.values()]
    names[1] += names[2]
    bare = synthesis.Plant(model, *names)
    by_call = bare.with_servo(SERVOS)
    by_call = (by_call if period is None else by_call.sampled(period)).with_delay(0.04)
    for plant in (bare.behind(actuation), bare.with_servo(actuation)):
        same(plant.nominal, by_call.nominal)
    sized = synthesis.Plant.sized(model, **PLANT, servos=actuation)
    weights = {"gust": 1.0, "phi": 10.0, "d_lat": 100.0, "d_ped": 100.0}
    same(sized.nominal, by_call.with_noise({"phi": 0.01}).weighted(weights).nominal)
    if period is None:
        same(
            sized.nominal, synthesis.Plant.sized(model, **PLANT, servos=SERVOS, delay=0.04).nominal
        )
    with pytest.raises(InputError, match="leave one out"):
        synthesis.Plant.sized(model, **PLANT, servos=actuation, delay=0.02)
    with pytest.raises(InputError, match="they must agree"):
        synthesis.Plant(roll(0.05), *names).behind(Actuation(period=DT))


def test_a_sheet_behind_an_actuation_is_that_of_its_parts(ideal):
    family = symheli.sweep(ideal, [3.0, 4.0, 5.0])
    autopilot = gain_scheduled_lqr(ideal, 3.0, 5.0, DT, points=2, servos=XCELL_SERVOS)
    K = LinearModel.gain(-autopilot.gains[0], autopilot.states, family.inputs)
    held = replace(K, dt=DT)

    def values(K, **given):
        return synthesis.specifications(family, {"": K}, at=[3.0, 5.0], **given).values[""]

    two = values(held, servos=XCELL_SERVOS, delay=0.02)
    assert np.isfinite(two).any()
    for own, period in ((held, None), (held, DT), (K, DT)):
        one = values(own, servos=Actuation(XCELL_SERVOS, 0.02, period))
        np.testing.assert_array_equal(one, two)
    assert not np.array_equal(values(K, servos=XCELL_SERVOS, delay=0.02), two, equal_nan=True)
    with pytest.raises(InputError, match="they must agree"):
        values(held, servos=Actuation(period=0.05))
    axis = next(axis for axis in Sheet.load().axes.values() if axis.control == "d_lat")
    model = family.interpolate("polynomial", 2)
    parts = peak_loop(model, held, axis, "input_peak", servos=XCELL_SERVOS, delay=0.02)
    same(peak_loop(model, K, axis, "input_peak", servos=Actuation(XCELL_SERVOS, 0.02, DT)), parts)


def test_actuators_of_identification_are_those_of_an_actuation():
    one = idn.Actuators(Actuation(XCELL_SERVOS, 0.013, DT), delay_deviation=0.01)
    two = idn.Actuators(XCELL_SERVOS, 0.013, delay_deviation=0.01, period=DT)
    assert one == two
    commands = np.random.default_rng(0).standard_normal((30, 4))
    np.testing.assert_array_equal(one.deflections(commands, DT), two.deflections(commands, DT))
    u = {"d_lat": Signal("d_lat_command", "rad")}
    same(one.sampled(u, DT)[u["d_lat"]], two.sampled(u, DT)[u["d_lat"]])
    with pytest.raises(InputError, match="leave one out"):
        idn.Actuators(Actuation(delay=0.02), delay=0.02)
