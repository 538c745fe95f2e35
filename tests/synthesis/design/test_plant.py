"""The plant of a design: what each step adds is what it says, frozen point by frozen point, and a
loop closed around it is the loop of all its parts.
"""

import math
from dataclasses import replace

import control
import numpy as np
import pytest

import symheli
import synthesis
from symheli import LinearModel, LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv import CubicSpline, Polynomial, Product
from symheli.lpv.tools import pade_delay
from symheli.values.signal import Signal
from synthesis import Plant

SPEED = Scheduling("airspeed", "m/s", 0.0, 13.0, 3.0)
SERVO = symheli.Servo(natural_frequency=36.0, damping=0.5, zero=104.0, pole=33.0)
OMEGA = np.array([0.2, 1.0, 6.0, 25.0])
SPEEDS = (0.0, 3.7, 13.0)


def roll(dt=None):
    """Roll rate and attitude over airspeed: damping and effectiveness grow with it."""
    A = [[[-8.0, 0.5], [1.0, 0.0]], [[-0.3, -0.1], [0.0, 0.0]]]
    B = [[[120.0, 1.0], [0.0, 0.0]], [[2.0, 0.2], [0.0, 0.0]]]
    lpv = LPVStateSpace.polynomial(
        A,
        B,
        [np.eye(2)],
        [np.zeros((2, 2))],
        SPEED,
        states=["p", "phi"],
        inputs=["d_lat", Signal("gust", "m/s")],
        outputs=["p", "phi"],
    )
    return lpv if dt is None else lpv.discretize(dt, degree=3)


def plant(model=None, performance=("phi", "d_lat")):
    return Plant(
        roll() if model is None else model,
        disturbances=["gust"],
        performance=performance,
        controls=["d_lat"],
        measurements=["phi", "p"],
    )


def transfer(plant, p, output, input):
    """Frozen response from an input to an output of the plant's model."""
    model = plant.nominal.at(p).select(inputs=[input], outputs=[output])
    return model.frequency_response(OMEGA)[:, 0, 0]


def same(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_the_nine_matrices_are_those_of_the_model_by_name():
    own = plant()
    assert (own.model.inputs, own.model.outputs) == (("gust", "d_lat"), ("phi", "d_lat", "p"))
    assert [u.unit for u in own.model.inputs] == ["m/s", "rad"]
    assert (own.states, own.dt, own.parameters) == (("p", "phi"), None, (SPEED,))
    assert own.basis == own.model.basis
    for p in SPEEDS:
        G, model = own.at(p), roll().at(p)
        for name, expected in (
            ("A", model.A),
            ("B1", model.B[:, [1]]),
            ("B2", model.B[:, [0]]),
            ("C1", [[0, 1], [0, 0]]),
            ("C2", [[0, 1], [1, 0]]),
            ("D11", [[0], [0]]),
            ("D12", [[0], [1]]),
            ("D21", [[0], [0]]),
            ("D22", [[0], [0]]),
        ):
            np.testing.assert_allclose(getattr(G, name), expected, atol=1e-12)
    stack = own.matrices(np.array(SPEEDS))
    for M, here in zip(stack, own.at(3.7), strict=True):
        np.testing.assert_array_equal(M[1], here)


def test_models_without_a_parameter_and_of_python_control_are_plants():
    model = roll().at(5.0)
    for given in (model, model.to_control()):
        own = plant(given)
        assert [s.name for s in own.parameters] == ["constant"]
        np.testing.assert_allclose(own.at(0.4).A, model.A)
        assert own.controls[0].unit == "rad"
    assert plant(plant().model).performance == ("phi", "d_lat")  # what it made may be given again


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"disturbances": ["gusts"]}, "unknown disturbance 'gusts'; did you mean 'gust'"),
        ({"controls": ["d_lon"]}, "unknown control 'd_lon'; did you mean 'd_lat'"),
        ({"performance": ["psi"]}, "unknown performance signal 'psi'; did you mean 'phi'"),
        ({"measurements": ["d_lat"]}, "unknown measurement 'd_lat'"),
        ({"disturbances": ["d_lat"]}, "d_lat is a disturbance and a control"),
        ({"measurements": ["p", "p"]}, "names must differ; repeated: p"),
        ({"model": 3.0}, "model: expected an LPVStateSpace"),
    ],
)
def test_wrong_signals_are_named(change, words):
    given = dict(
        model=roll(),
        disturbances=["gust"],
        performance=["phi"],
        controls=["d_lat"],
        measurements=["p"],
    )
    with pytest.raises(InputError, match=words):
        Plant(**{**given, **change})


def test_an_output_that_has_the_name_of_an_input_must_be_that_input():
    model = replace(roll(), outputs=("d_lat", "phi"))
    with pytest.raises(InputError, match="output of its model that is not that input: rename"):
        Plant(model, performance=["d_lat"], controls=["d_lat"])


# what stands between ---------------------------------------------------------------------------


def weight(dt=None):
    model = LinearModel([[-0.5]], [[1.0]], [[2.0]], [[0.1]], ("x",), ("in",), ("out",))
    return model if dt is None else model.discretize(dt, "tustin")


@pytest.mark.parametrize("dt", [None, 0.02])
def test_weights_multiply_what_they_weight(dt):
    bare = plant(roll(dt))
    W = weight(dt).frequency_response(OMEGA)[:, 0, 0]
    system = control.tf([1.0], [0.1, 1.0])
    own = bare.weighted({"gust": weight(), "phi": weight(), "d_lat": system})
    assert own.disturbances == ("gust",)
    assert own.performance == ("weighted_phi", "weighted_d_lat")
    assert [s.unit for s in (*own.disturbances, *own.performance)] == ["1", "1", "1"]
    assert own.measurements == ("phi", "p")
    lag = LinearModel.from_control(system)
    lag = lag if dt is None else lag.discretize(dt, "tustin")
    for p in SPEEDS:
        G = transfer(bare, p, "phi", "gust")
        same(transfer(own, p, "weighted_phi", "gust"), W * G * W)
        same(transfer(own, p, "phi", "gust"), G * W)
        same(transfer(own, p, "weighted_d_lat", "d_lat"), lag.frequency_response(OMEGA)[:, 0, 0])
        same(transfer(own, p, "phi", "d_lat"), transfer(bare, p, "phi", "d_lat"))


def test_a_weight_may_be_a_number_or_scheduled():
    bare = plant(performance=["phi", "p"])
    scheduled = LPVStateSpace.polynomial(
        [[[-1.0]]], [[[1.0]]], [[[1.0]], [[0.5]]], [[[0.0]]], SPEED, inputs=["in"], outputs=["out"]
    )
    own = bare.weighted({"phi": 3.0, "p": scheduled}).weighted({"weighted_phi": 2.0})
    assert own.performance == ("weighted_phi", "weighted_p")
    for p in SPEEDS:
        same(transfer(own, p, "weighted_phi", "gust"), 6.0 * transfer(bare, p, "phi", "gust"))
        W = scheduled.at(p).frequency_response(OMEGA)[:, 0, 0]
        same(transfer(own, p, "weighted_p", "gust"), W * transfer(bare, p, "p", "gust"))
    kept = Plant(roll(), performance=["phi"], disturbances=["gust"]).weighted({"phi": 0.5})
    assert kept.performance == ("phi",)  # measured by nobody: the name stays
    assert kept.performance[0].unit == "1"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"phi": 0.0}, "the weight of phi: expected a number > 0, got 0"),
        ({"phi": math.inf}, "expected a number > 0"),
        ({"phi": "heavy"}, "expected a number > 0, a LinearModel"),
        ({"psi": 1.0}, "unknown disturbance or performance signal 'psi'; did you mean 'phi'"),
        ({"p": 1.0}, "unknown disturbance or performance signal 'p'"),  # only measured
        ({"phi": weight(0.02)}, "dt = None; got 1, 1 and 0.02"),
        ({"phi": roll().at(0.0)}, "one input, one output"),
    ],
)
def test_wrong_weights_are_refused(given, words):
    with pytest.raises(InputError, match=words):
        plant().weighted(given)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_a_servo_drives_the_control_and_the_command_is_performance(dt):
    bare = plant(roll(dt))
    own = bare.with_servo({"d_lat": SERVO})
    assert (own.controls, own.performance) == (("d_lat",), ("phi", "d_lat"))
    assert own.states == ("p", "phi", "d_lat_servo1", "d_lat_servo2", "d_lat_servo3")
    part = SERVO.linear("d_lat")
    H = (part if dt is None else part.discretize(dt)).frequency_response(OMEGA)[:, 0, 0]
    for p in SPEEDS:
        same(transfer(own, p, "phi", "d_lat"), H * transfer(bare, p, "phi", "d_lat"))
        same(transfer(own, p, "d_lat", "d_lat"), 1.0)
        same(transfer(own, p, "phi", "gust"), transfer(bare, p, "phi", "gust"))
    same(
        transfer(bare.with_servo({"d_lat": part}), 3.0, "p", "d_lat"),
        transfer(own, 3.0, "p", "d_lat"),
    )
    with pytest.raises(UnknownNameError, match="unknown control 'gust'"):
        bare.with_servo({"gust": SERVO})
    with pytest.raises(InputError, match="the actuator of d_lat: expected a Servo"):
        bare.with_servo({"d_lat": 36.0})
    with pytest.raises(
        InputError, match="add servos, delays and disturbances first, then the weights"
    ):
        bare.weighted({"d_lat": 2.0}).with_servo({"d_lat": SERVO})


def test_a_delay_is_exact_in_samples_and_pades_in_continuous_time():
    bare = plant(roll(0.02))
    own = bare.with_delay(0.06)
    assert own.states[2:] == ("d_lat_delay1", "d_lat_delay2", "d_lat_delay3")
    late = np.exp(-0.06j * OMEGA)
    for p in SPEEDS:
        same(transfer(own, p, "phi", "d_lat"), late * transfer(bare, p, "phi", "d_lat"))
    smooth = plant().with_delay(0.06, ["d_lat"], order=3)
    pade = pade_delay("d_lat", 0.06, 3).frequency_response(OMEGA)[:, 0, 0]
    same(transfer(smooth, 3.7, "phi", "d_lat"), pade * transfer(plant(), 3.7, "phi", "d_lat"))
    with pytest.raises(InputError, match=r"0\.05 s is no whole.*are 0\.04 s and 0\.06 s"):
        bare.with_delay(0.05)
    with pytest.raises(InputError, match=r"nearest are 0\.02 s$"):
        bare.with_delay(0.004)
    with pytest.raises(InputError, match="the delay: expected a number > 0"):
        bare.with_delay(-0.02)
    with pytest.raises(UnknownNameError, match="unknown control 'gust'"):
        bare.with_delay(0.02, ["gust"])


def test_pades_delay_is_the_limit_of_ever_shorter_samples():
    """At 6 rad/s: the hold of dt is a further delay of dt/2, and the error halves with dt."""
    smooth = transfer(plant().with_delay(0.08), 3.7, "phi", "d_lat")[2]
    errors = []
    for dt in (0.02, 0.01, 0.005):
        own = plant().sampled(dt, degree=3).with_delay(0.08)
        errors.append(abs(transfer(own, 3.7, "phi", "d_lat")[2] / smooth - 1))
        assert errors[-1] == pytest.approx(6.0 * dt / 2, rel=0.05)
    assert errors[0] / errors[2] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_a_filter_stands_before_the_controller_alone(dt):
    bare = plant(roll(dt))
    own = bare.with_filter({"phi": 30.0, "p": weight()})
    assert (own.measurements, own.performance) == (("phi", "p"), ("true_phi", "d_lat"))
    lag = LinearModel([[-30.0]], [[30.0]], [[1.0]], [[0.0]], ("x",), ("in",), ("out",))
    H = (lag if dt is None else lag.discretize(dt, "tustin")).frequency_response(OMEGA)[:, 0, 0]
    for p in SPEEDS:
        G = transfer(bare, p, "phi", "gust")
        same(transfer(own, p, "true_phi", "gust"), G)
        same(transfer(own, p, "phi", "gust"), H * G)
        W = weight(dt).frequency_response(OMEGA)[:, 0, 0]
        same(transfer(own, p, "p", "d_lat"), W * transfer(bare, p, "p", "d_lat"))
    assert own.weighted({"phi": 2.0}).performance == ("true_phi", "d_lat")
    with pytest.raises(InputError, match="bandwidth of the filter of phi: expected a number > 0"):
        bare.with_filter({"phi": -1.0})
    with pytest.raises(UnknownNameError, match="unknown measurement 'd_lat'"):
        bare.with_filter({"d_lat": 3.0})


def test_noise_enters_the_measurement_and_not_the_performance():
    own = plant().with_noise({"phi": 0.01, "p": 0.2})
    assert own.disturbances == ("gust", "phi_noise", "p_noise")
    assert own.disturbances[1].unit == "1"
    for p in SPEEDS:
        G = own.at(p)
        np.testing.assert_allclose(G.D21, [[0, 0.01, 0], [0, 0, 0.2]], atol=1e-15)
        np.testing.assert_allclose(G.D11, 0.0, atol=1e-15)
        np.testing.assert_allclose(G.C1[0], [0, 1], atol=1e-15)
    with pytest.raises(InputError, match="the noise of phi: expected a number > 0"):
        plant().with_noise({"phi": 0.0})
    with pytest.raises(InputError, match="has an input phi_noise already"):
        own.with_noise({"phi": 0.1})


def test_a_cost_is_a_performance_signal_of_its_own():
    own = plant().with_cost({"d_lat": 0.3})
    assert own.performance == (*plant().performance, "d_lat_cost")
    for p in SPEEDS:
        G, before = own.at(p), plant().at(p)
        np.testing.assert_allclose(G.D12, [*before.D12.tolist(), [0.3]], atol=1e-15)
        np.testing.assert_allclose(G.C1[:-1], before.C1, atol=1e-15)
        np.testing.assert_allclose(G.C1[-1], 0.0, atol=1e-15)
    with pytest.raises(InputError, match="the cost of d_lat: expected a number > 0"):
        plant().with_cost({"d_lat": -1.0})
    with pytest.raises(UnknownNameError, match="unknown control 'd_lta'"):
        plant().with_cost({"d_lta": 1.0})


def test_an_input_disturbance_acts_where_the_control_does():
    """Before `with_servo` behind the servo, after it through it; the command that is performance
    stays the command alone.
    """
    behind = plant().with_input_disturbance().with_servo({"d_lat": SERVO})
    through = plant().with_servo({"d_lat": SERVO}).with_input_disturbance(["d_lat"])
    for own in (behind, through):
        assert own.disturbances == ("gust", "d_lat_disturbance")
        assert own.disturbances[1].unit == "rad"
    for p in SPEEDS:
        bare = transfer(plant(), p, "phi", "d_lat")
        same(transfer(behind, p, "phi", "d_lat_disturbance"), bare)
        same(transfer(through, p, "phi", "d_lat_disturbance"), transfer(through, p, "phi", "d_lat"))
        assert np.abs(transfer(through, p, "phi", "d_lat") / bare - 1).max() > 0.1
        for own in (behind, through):
            same(transfer(own, p, "d_lat", "d_lat_disturbance"), 0.0)
    with pytest.raises(InputError, match=r"add servos, delays and disturbances first"):
        plant().weighted({"d_lat": 2.0}).with_input_disturbance()
    with pytest.raises(UnknownNameError, match="unknown control 'gust'"):
        plant().with_input_disturbance(["gust"])
    with pytest.raises(InputError, match=r"\.with_input_disturbance\(\['d_lat'\]\) adds"):
        Plant(roll(), disturbances=["d_lat"], controls=["d_lat"])


def test_what_flies_is_closed_with_the_errors_of_a_design():
    """A table reads measured minus reference, the plant of the design gives reference minus
    measured: one loop, to the rounding of the table.
    """
    own = plant(roll(0.02)).with_reference()
    K = LPVStateSpace.polynomial(
        [[[0.5]], [[0.01]]],
        [[[0.1, 0.3]]],
        [[[0.2]]],
        [[[0.02, -0.001]], [[0.001, 0.0]]],
        SPEED,
        states=["k"],
        inputs=["phi_error", "p"],
        outputs=["d_lat"],
        dt=0.02,
    )
    flies = symheli.flight.ScheduledController(K)
    assert flies.model.inputs == ("phi", "p")
    table = symheli.TableController.of(K, 2)
    for p in SPEEDS:
        expected = own.close(K).at(p)
        np.testing.assert_allclose(own.close(flies).at(p).A, expected.A, atol=1e-12)
        np.testing.assert_allclose(own.close(table).at(p).A, expected.A, atol=1e-6)
        np.testing.assert_allclose(own.close(table).at(p).B, expected.B, atol=1e-6)
    with pytest.raises(InputError, match="reads phi and phi_error: give it one of the two"):
        symheli.flight.ScheduledController(replace(K, inputs=("phi_error", "phi")))


def test_a_reference_makes_errors_of_signals():
    own = plant().with_reference()
    assert own.disturbances == ("gust", "phi_reference")
    assert own.disturbances[1].unit == "rad"
    assert (own.measurements, own.performance) == (("phi_error", "p"), ("phi_error", "d_lat"))
    for p in SPEEDS:
        same(transfer(own, p, "phi_error", "phi_reference"), 1.0)
        same(transfer(own, p, "phi_error", "gust"), -transfer(plant(), p, "phi", "gust"))
    noisy = plant().with_noise({"phi": 0.1}).with_reference(["phi"])
    assert noisy.performance == ("true_phi_error", "d_lat")
    other = plant().with_reference().with_noise({"phi_error": 0.1})
    assert (other.performance, other.measurements) == (noisy.performance, noisy.measurements)
    for p in SPEEDS:  # the error that counts is that of the signal, not of its reading
        G, H = noisy.at(p), other.at(p)
        np.testing.assert_allclose(G.D11[0], [0.0, 0.0, 1.0], atol=1e-15)  # gust, noise, reference
        np.testing.assert_allclose(G.D21[0], [0.0, -0.1, 1.0], atol=1e-15)
        np.testing.assert_allclose(H.D11[0], [0.0, 1.0, 0.0], atol=1e-15)  # gust, reference, noise
        np.testing.assert_allclose(H.D21[0], [0.0, 1.0, 0.1], atol=1e-15)
    assert noisy.with_reference("p").measurements == ("phi_error", "p_error")
    with pytest.raises(InputError, match="give the signals that follow a reference"):
        Plant(roll(), performance=["phi"], measurements=["p"]).with_reference()
    with pytest.raises(UnknownNameError, match="performance signal or measurement 'd_lat'"):
        plant().with_reference(["d_lat"])


@pytest.mark.parametrize("dt", [None, 0.02])
def test_the_velocity_form_has_the_integrators(dt):
    bare = plant(roll(dt))
    own = bare.velocity_form(measured=True)
    assert (own.controls, own.controls[0].unit) == (("d_lat_rate",), "rad/s")
    assert own.states == ("p", "phi", "d_lat_command")
    assert own.measurements == ("phi", "p", "d_lat_command")
    assert own.performance == ("phi", "d_lat")
    at_rest = 0.0 if dt is None else 1.0
    s = 1j * OMEGA if dt is None else (np.exp(1j * OMEGA * dt) - 1) / dt
    for p in SPEEDS:
        poles = own.nominal.at(p).poles()
        expected = np.append(bare.nominal.at(p).poles(), at_rest)
        np.testing.assert_allclose(np.sort(poles), np.sort(expected), atol=1e-9)
        same(transfer(own, p, "phi", "d_lat_rate"), transfer(bare, p, "phi", "d_lat") / s)
        for name in ("d_lat", "d_lat_command"):
            same(transfer(own, p, name, "d_lat_rate"), 1 / s)
    wide = replace(own, performance=(*own.performance, "d_lat_rate"))
    np.testing.assert_allclose(wide.at(3.0).D12, [[0], [0], [1]], atol=1e-15)
    with pytest.raises(UnknownNameError, match="unknown control 'd_lat'"):
        own.velocity_form(["d_lat"])


def test_a_sampled_plant_is_the_hold_of_the_frozen_plants():
    own = plant().with_servo({"d_lat": SERVO}).sampled(0.02, degree=4)
    assert own.dt == 0.02
    for p in SPEEDS:
        frozen = plant().with_servo({"d_lat": SERVO}).model.at(p).discretize(0.02)
        found = own.model.at(p)
        # a polynomial of degree 4 holds the exponentials to about 1e-6 of themselves
        np.testing.assert_allclose(found.A, frozen.A, atol=1e-4)
        assert np.abs(own.model.residuals.A).max() < 1e-4
    np.testing.assert_allclose(own.at(1.0).D12, [[0], [1]], atol=1e-14)
    with pytest.raises(InputError, match="already discrete"):
        own.sampled(0.01)


def test_rates_and_ranges_are_those_of_the_model():
    assert plant().with_rate(1.5).parameters[0].rate == 1.5
    narrow = plant().with_scheduling(replace(SPEED, high=8.0))
    assert narrow.model.scheduling.high == 8.0


# loops -----------------------------------------------------------------------------------------

K = np.array([[-0.10, -0.02]])


def loop_by_python_control(own, p, compensator):
    """u = C y around the frozen plant, by python-control's own lower interconnection."""
    G = own.at(p)
    whole = control.ss(
        G.A,
        np.hstack([G.B1, G.B2]),
        np.vstack([G.C1, G.C2]),
        np.block([[G.D11, G.D12], [G.D21, G.D22]]),
        own.dt or 0,
    )
    return whole.lft(compensator, len(own.controls), len(own.measurements))


def same_loop(found, expected):
    s = 1j * OMEGA if found.dt is None else np.exp(1j * OMEGA * found.dt)
    there = np.stack([np.atleast_2d(expected(z, squeeze=False)).reshape(2, -1) for z in s])
    np.testing.assert_allclose(found.frequency_response(OMEGA), there, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_every_way_to_write_a_controller_closes_the_same_loop(dt):
    own = plant(roll(dt)).with_delay(0.02, order=2)
    static = LinearModel.gain(K, ["phi", "p"], ["d_lat"])
    named = static.to_control()
    ways = [
        {("d_lat", "phi"): -0.10, ("d_lat", "p"): -0.02},
        K,
        K.tolist(),
        static,
        named,
        control.ss([], [], [], K),
        LPVStateSpace.constant(static, SPEED),
        LPVStateSpace.constant(static.select(inputs=["p", "phi"])),
        type("Designed", (), {"model": LPVStateSpace.constant(static, SPEED)})(),
    ]
    for given in ways:
        loop = own.close(given)
        assert (loop.inputs, loop.outputs) == (("gust",), ("phi", "d_lat"))
        for p in SPEEDS:
            same_loop(loop.at(p), loop_by_python_control(own, p, control.ss([], [], [], K)))
    nothing = own.close({})
    same(nothing.at(3.7).frequency_response(OMEGA)[:, 0, 0], transfer(own, 3.7, "phi", "gust"))


def scheduled(basis, dt, parameters=SPEED):
    rng = np.random.default_rng(2)
    n = basis.size
    return LPVStateSpace(
        basis,
        0.1 * rng.standard_normal((n, 2, 2)),
        rng.standard_normal((n, 2, 2)),
        0.1 * rng.standard_normal((n, 1, 2)),
        0.1 * rng.standard_normal((n, 1, 2)),
        parameters,
        ("k1", "phi"),
        ("p", "phi"),
        ("d_lat",),
        dt=dt,
    )


@pytest.mark.parametrize(
    "basis", [Polynomial(2, 0.0, 13.0), CubicSpline((0.0, 2.0, 5.0, 9.0, 13.0))]
)
@pytest.mark.parametrize("dt", [None, 0.02])
def test_scheduled_controllers_close_every_frozen_loop(basis, dt):
    own = (
        plant(roll(dt))
        .with_servo({"d_lat": SERVO})
        .with_noise({"phi": 0.01})
        .weighted({"phi": weight()})
    )
    given = scheduled(basis, dt)
    loop = own.close(given)
    assert loop.states == (*own.states, "k1", "controller_phi")
    assert loop.inputs == ("gust", "phi_noise")
    for p in np.linspace(0.1, 12.9, 5):
        C = given.at(p).select(inputs=["phi", "p"])
        expected = loop_by_python_control(own, p, control.ss(C.A, C.B, C.C, C.D, own.dt or 0))
        same_loop(loop.at(p), expected)


def test_a_controller_over_airspeed_closes_a_plant_over_airspeed_and_acceleration():
    acceleration = Scheduling("acceleration", "m/s^2", -3.0, 3.0, 5.0)
    model = roll().with_parameter(acceleration)
    moved = model.A + 0.01 * np.random.default_rng(0).standard_normal(model.A.shape)
    basis = Product((Polynomial(1, 0.0, 13.0), Polynomial(1, -3.0, 3.0)))
    wide = replace(
        model,
        basis=basis,
        **{
            name: np.stack([M[0], 0.1 * M[0], M[1], 0.05 * M[1]])
            for name, M in (("A", moved), ("B", model.B), ("C", model.C), ("D", model.D))
        },
    )
    own = plant(wide)
    given = scheduled(CubicSpline((0.0, 2.0, 5.0, 9.0, 13.0)), None)
    loop = own.close(given)
    for p in ((1.0, -2.0), (8.8, 2.9)):
        C = given.at(p[0]).select(inputs=["phi", "p"])
        G = own.at(*p)
        u = C.D @ G.C2
        expected = np.block([[G.A + G.B2 @ u, G.B2 @ C.C], [C.B @ G.C2, C.A]])
        np.testing.assert_allclose(loop.at(*p).A, expected, rtol=1e-9, atol=1e-9)


def uncertain():
    lpv = roll(0.02)
    n = lpv.basis.size
    rng = np.random.default_rng(1)
    model = replace(
        lpv,
        B=np.concatenate([lpv.B, 0.01 * rng.standard_normal((n, 2, 1))], axis=2),
        C=np.concatenate([lpv.C, rng.standard_normal((n, 1, 2))], axis=1),
        D=np.pad(lpv.D, ((0, 0), (0, 1), (0, 1))),
        inputs=(*lpv.inputs, "d"),
        outputs=(*lpv.outputs, "v"),
        residuals=None,
        trim=None,
    )
    return UncertainStateSpace(model, ["d"], ["v"], 0.5, 0.95, "by choice")


def test_the_steps_and_the_loop_of_an_uncertain_plant_are_those_of_each_of_its_models():
    def steps(model):
        return (
            plant(model)
            .with_delay(0.02)
            .velocity_form()
            .with_noise({"phi": 0.1})
            .weighted({"phi": weight(), "gust": 2.0})
            .with_reference(["p"])
        )

    unc, gains = uncertain(), {("d_lat_rate", "phi"): -0.1, ("d_lat_rate", "p_error"): 0.02}
    own = steps(unc)
    loop = own.close(gains)
    assert isinstance(loop, UncertainStateSpace)
    assert loop.bound == 0.5
    for delta in (0.0, 0.4):
        one = steps(unc.perturbed([[delta]]))
        for p in SPEEDS:
            np.testing.assert_allclose(
                loop.perturbed([[delta]]).at(p).frequency_response(OMEGA),
                one.close(gains).at(p).frequency_response(OMEGA),
                rtol=1e-8,
            )
            if delta == 0.0:
                for here, there in zip(own.at(p), one.at(p), strict=True):
                    np.testing.assert_allclose(here, there, atol=1e-12)
    with pytest.raises(InputError, match="an uncertain plant is not sampled"):
        own.sampled(0.02)
    with pytest.raises(UnknownNameError, match="unknown control 'd'"):
        Plant(unc, controls=["d"])


def test_a_constant_plant_takes_a_scheduled_controller_over_its_parameters():
    """Whatever rate the parameter was given on which nothing depends."""
    own = plant(roll().at(5.0)).with_rate(0.0)
    given = scheduled(Polynomial(1, 0.0, 13.0), None)
    loop = own.close(given)
    assert loop.parameters == (SPEED,)
    C = given.at(9.0).select(inputs=["phi", "p"])
    G = own.at(0.5)
    whole = np.block([[G.A + G.B2 @ C.D @ G.C2, G.B2 @ C.C], [C.B @ G.C2, C.A]])
    np.testing.assert_allclose(loop.at(9.0).A, whole, atol=1e-10)


def test_wrong_controllers_say_what_was_expected():
    own = plant()
    with pytest.raises(UnknownNameError, match="unknown output 'psi'"):
        own.close({("d_lat", "psi"): 1.0})
    with pytest.raises(InputError, match=r"controller: expected shape \(1, 2\)"):
        own.close(K.T)
    with pytest.raises(InputError, match=r"controller: expected \{\(control"):
        own.close("pid")
    with pytest.raises(UnknownNameError, match="unknown measurement 'phi_error'"):
        own.close(LinearModel.gain([[1.0]], ["phi_error"], ["d_lat"]))
    with pytest.raises(UnknownNameError, match="unknown control 'gust'"):
        own.close(LinearModel.gain([[1.0]], ["phi"], ["gust"]))
    with pytest.raises(InputError, match=r"has 1 inputs without names, the plant 2: phi, p"):
        own.close(control.tf([1.0], [1.0, 1.0]))
    sampled = scheduled(Polynomial(1, 0.0, 13.0), 0.02)
    with pytest.raises(InputError, match="the plant is continuous and the controller sampled"):
        own.close(sampled)


def test_the_gain_of_a_closed_integrator_is_the_one_on_paper():
    """x' = w + u, z = (x, u), y = x, u = -k x: G = (1, -k)/(s + k), largest at rest."""
    model = LinearModel(
        *(np.array(M) for M in ([[0.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]])),
        ("x",),
        ("w", "u"),
        ("y",),
    )
    own = Plant(
        model, disturbances=["w"], performance=["y", "u"], controls=["u"], measurements=["y"]
    )
    for k in (0.5, 2.0):
        expected = math.hypot(1.0, k) / k
        cert = synthesis.l2_gain(own.close({("u", "y"): -k}), search=None)
        assert cert.verified
        assert expected <= cert.gamma <= 1.001 * expected  # proven, and within the solver's margin


def test_a_scheduled_gain_that_cancels_the_scheduling_leaves_a_constant_loop():
    """x' = p x + u + w with u = -(p + 2) y is x' = -2 x + w, whatever p does: gain 1/2 at any
    rate.
    """
    p = Scheduling("p", "1", 0.0, 1.0)
    model = LPVStateSpace.polynomial(
        [[[0.0]], [[1.0]]],
        [[[1.0, 1.0]]],
        [[[1.0]]],
        [[[0.0, 0.0]]],
        p,
        states=["x"],
        inputs=["w", "u"],
        outputs=["y"],
    )
    none = np.zeros
    gain = LPVStateSpace.polynomial(
        [none((0, 0))],
        [none((0, 1))],
        [none((1, 0))],
        [[[-2.0]], [[-1.0]]],
        p,
        inputs=["y"],
        outputs=["u"],
    )
    own = Plant(model, disturbances=["w"], performance=["y"], controls=["u"], measurements=["y"])
    cert = synthesis.l2_gain(own.close(gain), rate=math.inf, search=None)
    assert 0.5 <= cert.gamma <= 0.5005


@pytest.mark.parametrize("given", [roll(), roll().at(3.0), None])
@pytest.mark.parametrize(
    "design",
    [
        synthesis.output_feedback,
        synthesis.state_feedback,
        synthesis.estimator,
        synthesis.designs.lft_feedback,
        lambda plant: synthesis.multiobjective(plant, [synthesis.objectives.L2()]),
        lambda plant: synthesis.certify_sampled({}, plant),
        lambda plant: synthesis.analysis.with_scheduling_error(plant, {}, 0.1),
        lambda plant: synthesis.analysis.proven_around(plant, {}, 3.0),
    ],
)
def test_a_design_of_a_model_says_that_it_needs_a_plant(design, given):
    said = (
        rf"expected a synthesis\.Plant, got {type(given).__name__}; .*Plant\(model, disturbances="
    )
    with pytest.raises(InputError, match=said):
        design(given)


def test_a_point_design_of_a_plant_says_where_its_model_is():
    with pytest.raises(InputError, match=r"got Plant; .* a Plant \.nominal\.at\(p\)"):
        synthesis.designs.ncfsyn(plant())
    with pytest.raises(InputError, match=r"depends on airspeed .*model=plant\.nominal\.at\("):
        synthesis.hinf(plant())


@pytest.mark.parametrize("dt", [None, 0.02])
def test_a_plant_of_sizes_is_that_of_its_parts(dt):
    of = plant(roll(dt))
    servos = {"d_lat": SERVO}
    parts = of.with_servo(servos).with_delay(0.04).with_noise({"phi": 0.01})
    parts = parts.weighted({"gust": 2.0, "phi": 1 / 0.2, "d_lat": 1 / 0.05})
    whole = Plant.sized(
        roll(dt),
        disturbances={"gust": 2.0},
        performance={"phi": 0.2},
        controls={"d_lat": 0.05},
        measurements={"phi": 0.01, "p": 0.0},
        servos=servos,
        delay=0.04,
    )
    assert whole.performance == parts.performance
    assert whole.disturbances == parts.disturbances
    for p in SPEEDS:
        for found, expected in zip(whole.at(p), parts.at(p), strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-14, atol=0)


@pytest.mark.parametrize("size", [0.0, -1.0, np.nan, "2"])
def test_a_size_that_is_none_is_refused_by_name(size):
    with pytest.raises(InputError, match="the size of phi"):
        Plant.sized(roll(), performance={"phi": size}, controls={"d_lat": 1.0}, measurements={})
