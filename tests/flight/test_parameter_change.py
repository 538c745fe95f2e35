"""A helicopter that changes in flight, as where a load is dropped."""

import numpy as np
import pytest

import symheli
from symheli.errors import InputError
from symheli.flight import FlightPlan, ParameterChange, fly_batch, gain_scheduled_lqr

HOVER = symheli.AirspeedSchedule((2.0,), (1.0,), (2.0,))
HEAVIER = {"body.mass": 9.0}


@pytest.fixture(scope="module")
def heli():
    """With its equations."""
    return symheli.Helicopter.load("xcell60", governor="ideal")


@pytest.fixture(scope="module")
def autopilot(heli):
    """The same for all flights: it does not know of the change."""
    return gain_scheduled_lqr(heli, 0.0, 3.0, 0.02).scheduled_controller


def at_once(heli, x, u):
    """Acceleration along the body's z axis, m/s^2."""
    w = symheli.simulate(heli, x, u[None], dt=0.02)["w"]
    return (w[-1] - w[0]) / 0.02


@pytest.mark.parametrize("at", [1.0, 0.99])
def test_nothing_happens_before_and_the_other_helicopter_flies_after(heli, autopilot, at):
    """From the sample on, the accelerations are those of the other parameters."""
    plan = FlightPlan(HOVER, controller=autopilot)
    light = symheli.fly(heli, plan)
    changed = symheli.fly(heli, plan, change=ParameterChange(at, HEAVIER))
    differ = np.abs(light.values - changed.values).max(axis=1)
    first = int(np.flatnonzero(differ)[0])
    assert first == 51  # sample 50 is the last that both have alike
    x = changed.columns(map(str, heli.states))[50]
    u = changed.columns(map(str, heli.inputs))[50]
    heavy = heli.with_parameters(HEAVIER)
    gained = (changed["w"][51] - changed["w"][50]) / 0.02
    assert gained == pytest.approx(at_once(heavy, x, u), abs=0.3)
    assert abs(gained - at_once(heli, x, u)) > 0.5


def test_alone_in_a_batch_and_with_a_controller_in_python_it_is_one_flight(heli, autopilot):
    """The bits of a batch are those of the flight alone; a flight beside it is unchanged."""

    class InPython:
        dt = 0.02

        def reset(self):
            self.state = autopilot.init()

        def step(self, measured, reference, p):
            u, self.state = autopilot.step(self.state, measured, reference, p)
            return u

    change = ParameterChange(1.0, HEAVIER)
    plan = FlightPlan(HOVER, controller=autopilot)
    alone = symheli.fly(heli, plan, change=change)
    both = fly_batch(heli, [plan, FlightPlan(HOVER, controller=autopilot, change=change)]).data
    np.testing.assert_array_equal(both[1].record().values, alone.values)
    np.testing.assert_array_equal(both[0].record().values, symheli.fly(heli, plan).values)
    stepped = symheli.fly(heli, HOVER, controller=InPython(), change=change)
    np.testing.assert_allclose(stepped.values, alone.values, rtol=0, atol=1e-12)


def test_without_a_compiler_it_is_the_same_flight(heli, autopilot, monkeypatch):
    """To rounding."""
    plan = FlightPlan(HOVER, controller=autopilot, change=ParameterChange(1.0, HEAVIER))
    compiled = symheli.fly(heli, plan)
    monkeypatch.setattr("symheli.flight.loops.library", lambda *_: None)
    np.testing.assert_allclose(symheli.fly(heli, plan).values, compiled.values, atol=1e-9)


@pytest.mark.parametrize(
    ("at", "values", "said"),
    [
        (-1.0, HEAVIER, "at: expected a time"),
        (float("nan"), HEAVIER, "at: expected a time"),
        (1.0, {}, "name what changes"),
        (1.0, 9.0, "values"),
    ],
)
def test_what_is_no_change_is_refused(at, values, said):
    """In words."""
    with pytest.raises(InputError, match=said):
        ParameterChange(at, values)


def test_parameters_that_the_helicopter_has_not_are_refused(heli):
    """Before it flies."""
    with pytest.raises(InputError, match=r"body\.mas"):
        symheli.fly(heli, HOVER, change=ParameterChange(1.0, {"body.mas": 9.0}))
    with pytest.raises(InputError, match="change: expected a ParameterChange"):
        symheli.fly(heli, HOVER, change={"body.mass": 9.0})


def test_the_travel_of_controls_cannot_change(heli, autopilot):
    """It had no effect, without a word."""
    plan = FlightPlan(HOVER, controller=autopilot)
    with pytest.raises(InputError, match="travel of controls cannot change in flight"):
        symheli.fly(heli, plan, change=ParameterChange(1.0, {"controls.d_col": 0.01}))


@pytest.mark.parametrize("at", [1e6, 2.0**32 * 0.02 + 1.0, 1e300])
def test_a_change_after_the_flight_is_none(heli, autopilot, at):
    plan = FlightPlan(HOVER, controller=autopilot)
    changed = symheli.fly(heli, plan, change=ParameterChange(at, HEAVIER))
    np.testing.assert_array_equal(changed.values, symheli.fly(heli, plan).values)
