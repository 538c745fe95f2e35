"""Delay and servos between recorded commands and deflections."""

import numpy as np
import pytest
from scipy.linalg import expm

import identification as idn
import symheli
from symheli.errors import InputError
from symheli.flight import XCELL_SERVOS

CONTROLS = ("d_lon", "d_lat", "d_col", "d_ped")


@pytest.mark.slow(but="0.02")
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.02, 0.047])
def test_the_mean_deflection_is_that_of_the_servo_integrated_finely(delay):
    """Trapezoids over 200 steps a sample: their error is (dt w / 200)^2 / 12 of the deflection,
    below 1e-6 for servos of 36 rad/s at 20 ms.
    """
    dt, fine = 0.02, 200
    commands = 0.1 * np.random.default_rng(0).normal(size=(40, 4))
    made = idn.Actuators(XCELL_SERVOS, delay=delay).deflections(commands, dt)
    for j, name in enumerate(CONTROLS):
        model = XCELL_SERVOS[name].linear(name)
        n, h = len(model.A), dt / fine
        E = expm(np.block([[model.A, model.B], [np.zeros((1, n + 1))]]) * h)
        x, mean = -np.linalg.solve(model.A, model.B[:, 0] * commands[0, j]), []
        for k in range(len(commands)):
            area = 0.0
            for i in range(fine):
                at = k * dt + (i + 0.5) * h - delay
                u = commands[max(int(np.floor(at / dt)), 0), j]
                before = model.C[0] @ x
                x = E[:n, :n] @ x + E[:n, n] * u
                area += 0.5 * (before + model.C[0] @ x) * h
            mean.append(area / dt)
        np.testing.assert_allclose(made[:, j], mean, atol=1e-6)


@pytest.fixture(scope="module")
def flight(ideal):
    schedule = symheli.AirspeedSchedule.transition(2.0, 6.0, acceleration=2.0, hold=2.0)
    lqr = symheli.flight.gain_scheduled_lqr(ideal, 0.0, 8.0, 0.02, servos=XCELL_SERVOS)
    shaken = symheli.Excitation(
        {"d_lon": 0.015, "d_lat": 0.01, "d_ped": 0.015}, "multisine", (0.1, 4.0), 1
    )
    return symheli.fly(
        ideal,
        schedule,
        controller=lqr,
        excitation=shaken,
        servos=XCELL_SERVOS,
        delay=0.02,
        noise_db=30.0,
    )


@pytest.mark.slow
def test_a_delay_is_estimated_beside_the_parameters(ideal, flight):
    """Two milliseconds are asked for; the parameter as without actuators."""
    wrong = ideal.with_parameters({"body.Ixx": 0.25})
    actuators = idn.Actuators(XCELL_SERVOS, delay=0.035, delay_deviation=0.02)
    found = idn.calibrate(wrong, flight, ["body.Ixx"], actuators=actuators)
    value, deviation = found.actuators["delay"]
    assert value == pytest.approx(0.02, abs=0.002)
    assert 0.0 < deviation < 0.002
    assert found.values[0] == pytest.approx(ideal.parameters["body.Ixx"], rel=0.02)
    assert "delay of the actuators" in str(found)


def test_what_cannot_be_an_actuator_is_refused():
    with pytest.raises(InputError, match="none given for d_lat"):
        idn.Actuators({"d_lon": XCELL_SERVOS["d_lon"]}).deflections(np.zeros((3, 4)), 0.02)
    with pytest.raises(InputError, match="delay"):
        idn.Actuators(XCELL_SERVOS, delay=-0.1)
    with pytest.raises(InputError, match="bandwidth_deviation"):
        idn.Actuators(XCELL_SERVOS, bandwidth_deviation=float("nan"))
