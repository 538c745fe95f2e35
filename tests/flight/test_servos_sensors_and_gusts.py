"""Between the autopilot and the air: servos, sensors, gusts and turbulence in the loop."""

import numpy as np
import pytest

import symheli
from symheli import AirspeedSchedule, fly
from symheli.environment import Dryden, Gust, Wind
from symheli.errors import InputError, UnknownNameError
from symheli.flight import XCELL_SERVOS, Sensor, Servo, ServoBank, fly_batch, gain_scheduled_lqr
from symheli.flight.servo import CYCLIC, TAIL

HOVER = AirspeedSchedule((0.5,), (0.5,), (3.0,), lead=0.5)
INPUTS = ("d_lon", "d_lat", "d_col", "d_ped")
TRAVEL = np.array([0.096, 0.096, 0.183, 0.38])


@pytest.fixture(scope="module")
def behind_servos():
    return gain_scheduled_lqr(
        symheli.Helicopter.load("xcell60", governor="ideal"), 0.0, 8.0, 0.02, servos=XCELL_SERVOS
    )


@pytest.mark.parametrize("servo", [CYCLIC, TAIL])
def test_a_servo_has_the_printed_transfer_function(servo):
    s = 1j * np.array([0.1, 10.0, 36.0, 100.0, 400.0])
    wn, z = servo.natural_frequency, servo.damping
    H = wn**2 / (s**2 + 2 * z * wn * s + wn**2)
    if servo.zero:
        H = H * (s / servo.zero + 1) / (s / servo.pole + 1)
    np.testing.assert_allclose(
        servo.linear("d_lat").frequency_response(s.imag)[:, 0, 0], H, rtol=1e-12
    )


def test_small_steps_follow_the_linear_servo():
    fine = {
        name: Servo(
            natural_frequency=s.natural_frequency, damping=s.damping, zero=s.zero, pole=s.pole
        )
        for name, s in XCELL_SERVOS.items()
    }
    bank, dt, command = (
        ServoBank(fine, INPUTS, TRAVEL, 0.005),
        0.005,
        np.array([0.01, -0.02, 0.03, 0.05]),
    )
    state, out = bank.init(np.zeros(4)), []
    for _ in range(60):
        state, reached = bank.step(state, command)
        out.append(reached)
    for i, name in enumerate(INPUTS):
        model, x = fine[name].linear(name).discretize(dt), np.zeros(3 if fine[name].zero else 2)
        for k in range(60):
            x = model.A @ x + model.B[:, 0] * command[i]
            assert out[k][i] == pytest.approx(float(model.C[0] @ x), abs=1e-14)


def test_a_servo_keeps_its_travel_its_rate_and_its_steps():
    slow = dict.fromkeys(INPUTS, Servo(natural_frequency=200.0, damping=1.0, rate=0.5, steps=10))
    bank = ServoBank(slow, INPUTS, TRAVEL, 0.005)
    state, deflections = bank.init(np.zeros(4)), []
    for _ in range(400):
        state, reached = bank.step(state, np.full(4, 10.0))
        deflections.append(reached)
    deflections = np.array(deflections)
    assert np.all(
        np.abs(np.diff(deflections, axis=0)) <= 0.5 * 0.005 * (1 + 1e-9)
    )  # critically damped: no faster than its command
    np.testing.assert_allclose(deflections[-1], TRAVEL, atol=1e-9)
    state, _ = bank.step(
        bank.init(np.zeros(4)), 0.13 * TRAVEL
    )  # the nearest of the positions 0, 0.2, .. of the travel is 0.2
    while not np.allclose(state.followed, 0.2 * TRAVEL):
        before = state.followed
        state, _ = bank.step(state, 0.13 * TRAVEL)
        assert np.all(state.followed >= before)


def test_a_bank_starts_at_rest():
    bank = ServoBank(
        {n: Servo(natural_frequency=36.0, damping=0.5, zero=104.0, pole=33.0) for n in INPUTS},
        INPUTS,
        TRAVEL,
        0.005,
    )
    _, reached = bank.step(bank.init(0.3 * TRAVEL), 0.3 * TRAVEL)
    np.testing.assert_allclose(reached, 0.3 * TRAVEL, atol=1e-14)


class HandsOff:
    """The trim at the start, whatever is measured: the flight is the same with any sensor."""

    dt = 0.02

    def reset(self):
        self.u = None

    def step(self, measured, reference, p):
        if self.u is None:
            self.u = [reference[name] for name in INPUTS]
        return self.u


def test_a_sensor_delays_holds_biases_and_rounds(ideal):
    start = AirspeedSchedule((5.0,), (1.0,), (0.5,), start=4.9, lead=0.5)
    coarse = Sensor(bias=0.4, period=0.06, delay=0.03, quantum=0.5)
    truth = fly(ideal, start, controller=HandsOff())
    read = fly(ideal, start, controller=HandsOff(), sensors={"u": coarse, "v": Sensor(delay=0.04)})
    k = np.arange(len(truth))
    # two samples late, a new value every third sample, rounded to halves with 0.4 on top
    late = np.maximum(k - 2, 0)
    expected = np.round((truth["u"][late - late % 3] + 0.4) / 0.5) * 0.5
    np.testing.assert_allclose(read["u"], expected, atol=1e-12)
    np.testing.assert_array_equal(read["v"], truth["v"][late])
    np.testing.assert_array_equal(read["w"], truth["w"])


def test_sensor_noise_has_its_size_and_is_held_with_the_reading(ideal):
    start = AirspeedSchedule((5.0,), (1.0,), (0.4,), start=4.9, lead=0.5)
    noisy, truth = (
        fly_batch(ideal, start, controller=steady(), seeds=range(400), sensors=sensors)
        for sensors in ({"q": Sensor(noise=2.0, period=0.1)}, None)
    )
    source = np.arange(len(noisy[0])) // 5 * 5
    noise = noisy.column("q") - truth.column("q")[:, source]
    np.testing.assert_allclose(noise, noise[:, source], atol=1e-12)
    drawn = noise[:, ::5]
    assert drawn.std() == pytest.approx(2.0, rel=4 / np.sqrt(2 * drawn.size))  # 4 standard errors
    assert np.corrcoef(drawn[:, 0], drawn[:, 1])[0, 1] == pytest.approx(0.0, abs=0.2)  # 4 of them


def steady():
    """No feedback at all, in machine code."""
    return symheli.LinearModel.gain(np.zeros((4, 1)), ["q"], INPUTS).discretize(0.02)


def test_a_flight_behind_servos_stays_in_trim_and_records_both_sides(ideal, behind_servos):
    record = fly(
        ideal,
        AirspeedSchedule((4.0,), (1.0,), (2.0,), start=4.0),
        servos=XCELL_SERVOS,
        controller=behind_servos,
    )
    point = symheli.trim(ideal, 4.0)
    for name in INPUTS:
        step = 2 * ideal.travel[INPUTS.index(name)] / XCELL_SERVOS[name].steps
        assert (
            np.abs(record[name] - point.u[name]).max() < 2 * step
        )  # a limit cycle over a step or two of the servo
        assert f"{name}_command" in record.signals
    assert np.abs(record["airspeed"] - 4.0).max() < 0.3


def test_without_limits_the_deflection_is_the_command_through_the_servo(ideal, behind_servos):
    fine = {
        name: Servo(
            natural_frequency=s.natural_frequency, damping=s.damping, zero=s.zero, pole=s.pole
        )
        for name, s in XCELL_SERVOS.items()
    }
    record = fly(ideal, HOVER, servos=fine, controller=behind_servos)
    model = fine["d_lon"].linear("d_lon").discretize(0.02)
    x = record["d_lon"][0] * np.linalg.solve(np.eye(3) - model.A, model.B[:, 0])
    for k in range(len(record)):
        assert record["d_lon"][k] == pytest.approx(float(model.C[0] @ x), abs=1e-12)
        x = model.A @ x + model.B[:, 0] * record["d_lon_command"][k]


def test_gusts_move_the_helicopter_and_stand_in_the_record(ideal, behind_servos):
    wind = Wind((2.0, 0.0, 0.0), (Gust((0.0, 3.0, 0.0), 1.5, 1.0),), Dryden(5.0, 15.0), seed=2)
    record = fly(ideal, HOVER, wind=wind, controller=None)
    calm = fly(ideal, HOVER, wind=(2.0, 0.0, 0.0))
    np.testing.assert_allclose(
        record.columns(("wind_n", "wind_e", "wind_d")),
        wind.history(record.time, record["airspeed_command"]),
    )
    assert np.abs(record["v"] - calm["v"]).max() > 0.3
    assert "wind_n" not in calm.signals


def test_sensors_reach_the_autopilot_and_the_record(ideal, behind_servos):
    biased = fly(ideal, HOVER, sensors={"phi": Sensor(bias=0.02)}, controller=behind_servos)
    clean = fly(ideal, HOVER, controller=behind_servos)
    assert biased["phi"][0] == pytest.approx(clean["phi"][0] + 0.02, abs=1e-12)
    assert biased["d_lat"][0] != clean["d_lat"][0]


def test_the_gains_are_softened_until_slow_servos_allow_them(ideal, behind_servos):
    stiff = gain_scheduled_lqr(ideal, 0.0, 8.0, 0.02)
    np.testing.assert_array_equal(
        behind_servos.gains, stiff.gains
    )  # those of the X-Cell are fast enough
    slow = gain_scheduled_lqr(
        ideal,
        0.0,
        8.0,
        0.02,
        servos=dict.fromkeys(INPUTS, Servo(natural_frequency=3.0, damping=0.5)),
    )
    assert slow.radius < 1
    assert np.linalg.norm(slow.gains) < 0.8 * np.linalg.norm(stiff.gains)
    with pytest.raises(InputError, match="unstable on the full model"):
        gain_scheduled_lqr(
            ideal,
            0.0,
            8.0,
            0.02,
            servos=dict.fromkeys(INPUTS, Servo(natural_frequency=0.3, damping=0.05)),
        )


def test_what_cannot_be_flown_is_refused(ideal):
    with pytest.raises(InputError, match="either noise_db or sensors"):
        fly(ideal, HOVER, noise_db=30.0, sensors={})
    with pytest.raises(UnknownNameError, match="measured signal"):
        fly(ideal, HOVER, sensors={"thta": Sensor()})
    with pytest.raises(InputError, match="none given for d_lat, d_col, d_ped"):
        fly(ideal, HOVER, servos={"d_lon": TAIL})
    with pytest.raises(InputError, match="none given for d_lat"):
        ServoBank({"d_lon": TAIL}, ("d_lon", "d_lat"), TRAVEL[:2], 0.005)
    with pytest.raises(InputError, match="both given"):
        Servo(natural_frequency=36.0, damping=0.5, zero=104.0)
    with pytest.raises(InputError, match="expected a Wind or"):
        fly(ideal, HOVER, wind=(1.0, 2.0))
    with pytest.raises(InputError, match="noise"):
        Sensor(noise=-1.0)


def test_what_is_later_than_the_flight_stays_at_its_start(ideal):
    start = AirspeedSchedule((5.0,), (1.0,), (0.4,), start=4.9, lead=0.4)  # 0.8 s
    late = {"q": Sensor(delay=1e300), "u": Sensor(period=1e12)}
    record = fly(ideal, start, controller=HandsOff(), sensors=late)
    for name in late:
        np.testing.assert_array_equal(record[name], record[name][0])
    never = fly(ideal, start, delay=1.0)
    for name in INPUTS:
        np.testing.assert_array_equal(never[name], never[f"{name}_reference"][0])
