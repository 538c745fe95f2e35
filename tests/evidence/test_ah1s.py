"""A helicopter that is not ours: JSBSim's AH-1S held, trimmed, linearized on two routes, flown."""

import sys

import numpy as np
import pytest

from evidence.ah1s import flight, simulator, trim, truth
from evidence.ah1s.compared import STRUCTURES, phugoid
from evidence.ah1s.simulator import AH1S, DEFLECTIONS, DT, LAGS, STATES, STICKS
from symheli.errors import FlightLostError, InputError
from symheli.flight import AirspeedSchedule, Excitation

SPEEDS = (1.0, 10.0, 20.0, 31.0)
"""m/s, up to 60 kt."""

SHORT = AirspeedSchedule.transition(5.0, 20.0, acceleration=1.5, hold=2.0)
EXCITATION = Excitation({"d_lon": 0.1, "d_lat": 0.15, "d_col": 0.06, "d_ped": 0.1}, band=(0.1, 2.5))


@pytest.fixture(scope="module")
def ah1s():
    pytest.importorskip("jsbsim", reason="needs jsbsim: pip install 'symheli[jsbsim]'")
    return AH1S()


@pytest.fixture(scope="module")
def trims(ah1s):
    """Level flight at each of the speeds."""
    found, guess = {}, trim.GUESS
    for speed in SPEEDS:
        found[speed] = trim.trim(ah1s, speed, guess=guess)
        guess = flight.unknown(found[speed])
    return found


@pytest.fixture(scope="module")
def noisy(ah1s):
    return flight.fly(flight.Plan(SHORT, EXCITATION, noise_db=30.0, seed=3))


def test_without_jsbsim_the_door_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    with pytest.raises(
        InputError, match=r"the AH-1S needs jsbsim: pip install 'symheli\[jsbsim\]'"
    ):
        AH1S()


@pytest.mark.slow
def test_hover_is_that_of_the_flight_script_of_the_aircraft(ah1s):
    """Its script sets roll -0.049254 and pitch -0.006428 rad for hover; the sticks there are
    rounded to 1e-3 of their travel, worth a few 1e-4 rad.
    """
    hover = trim.trim(ah1s, 0.0)
    np.testing.assert_allclose(hover.state[6:], [-0.049254, -0.006428], atol=5e-4)
    assert np.abs(ah1s.hold(*hover)).max() < 2 * trim.ACCURACY


@pytest.mark.slow
def test_a_trim_with_acceleration_accelerates_along_the_nose(ah1s):
    """Let go, speed grows by a t and height stays: over 0.5 s the change of both angles of attack
    and drag is of second order.
    """
    found = trim.trim(ah1s, 15.0, acceleration=1.5)
    ah1s.hold(*found)
    ah1s.release()
    for _ in range(25):
        state = ah1s.step(found.sticks)
    assert np.linalg.norm(state[:3]) - 15.0 == pytest.approx(0.75, rel=0.03)
    np.testing.assert_allclose(state[6:], found.state[6:], atol=5e-3)


@pytest.mark.slow
def test_lags_of_the_controls_are_those_of_the_aircraft_file_at_this_step_too(noisy):
    """r(k+1) = a r(k) + b s(k) + c s(k-1) + offset of mixed sticks, by least squares. By the
    trapezoidal rule at h = 1/150 s the pole of a lag c is log((2 - hc)/(2 + hc))/h, (hc)^2/12 from
    -c: 0.2 %.
    """
    r, s = (noisy.columns(map(str, names)) for names in (DEFLECTIONS, STICKS))
    rows = np.hstack([r[1:-1], s[1:-1], s[:-2], np.ones((len(r) - 2, 1))])
    found = np.linalg.lstsq(rows, r[2:], rcond=None)[0]
    assert np.abs(rows @ found - r[2:]).max() < 1e-6  # rad: one lag each is all there is
    np.testing.assert_allclose(np.log(np.diag(found[:4])) / DT, -np.array(LAGS), rtol=2e-3)


@pytest.mark.slow
def test_the_structure_takes_a_stick_for_its_deflection_but_for_a_scale(noisy):
    """The longitudinal stick is mixed with no other: its deflection is a multiple of what the known
    lag makes of it. The mean over a sample is not that of its ends: 2 %; a sample off, 10 %.
    """
    aerodynamics = STRUCTURES["known lags"](34.0, False).aerodynamics
    lagged = aerodynamics.prepared(noisy)[aerodynamics.inputs[-4]]
    k = slice(50, -1)
    reached = noisy[str(DEFLECTIONS[0])]
    middle = 0.5 * (reached[k] + reached[51:])
    rows = np.column_stack([lagged[k], np.ones(len(middle))])
    left = middle - rows @ np.linalg.lstsq(rows, middle, rcond=None)[0]
    assert left.std() < 0.03 * middle.std()


@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
def test_pulses_and_central_differences_tell_of_one_helicopter(ah1s, trims, speed):
    """The held simulator, rotors and lags settled, has the same static gains; what lags that fast
    do to the phugoid is below 0.01 1/s.
    """
    pulses = truth.realization(ah1s, trims[speed])
    held = truth.held_model(ah1s, trims[speed])
    found, wanted = (
        m.frequency_response(np.zeros(1))[0].real * truth.SCALE[:, None] for m in (pulses, held)
    )
    assert np.linalg.norm(found - wanted) < truth.STATIC * np.linalg.norm(wanted)
    assert abs(phugoid(pulses) - phugoid(held.discretize(DT))) < 0.01
    assert (phugoid(pulses).real > 0) == (speed < 25.0)  # unstable in hover, stable at 60 kt


@pytest.mark.slow
def test_a_flight_repeats_itself_and_holds_to_its_reference(noisy):
    again = flight.fly(noisy.meta["plan"])
    np.testing.assert_array_equal(again.values, noisy.values)
    calm = flight.CalmFlight().flown(noisy)
    assert noisy.dt == DT
    names = [str(s) for s in STATES]
    spread = calm.columns(names).std(axis=0)
    # what the controller makes of the noise is beside it in the difference
    ratio = (noisy.columns(names) - calm.columns(names)).std(axis=0) / (spread * 10**-1.5)
    assert np.all((ratio > 0.95) & (ratio < 3.0))
    reference = noisy.columns([f"{name}_reference" for name in names])
    assert np.abs(calm.columns(names) - reference).max(axis=0)[:3].max() < 3.0  # m/s
    assert np.abs(calm["airspeed"] - calm["airspeed_command"]).max() < 3.0
    assert {str(s) for s in (*STICKS, *DEFLECTIONS)} <= set(map(str, noisy.signals))


@pytest.mark.slow
def test_the_sensors_of_the_record_are_compatible(noisy):
    found = noisy.check_kinematics()
    found.require()
    assert found["q"].verdict == found["theta"].verdict == "consistent"


@pytest.mark.slow
def test_the_pilot_steps_as_it_flies(noisy):
    pilot, k = noisy.meta["plan"].controller, 700
    row = {str(s): noisy[str(s)][k] for s in noisy.signals}
    reference = {str(s): row[f"{s}_reference"] for s in (*STATES, *STICKS)}
    sticks = pilot.step(row, reference, {"airspeed": row["airspeed_command"]})
    added = [row[f"e_{s}"] for s in STICKS]
    np.testing.assert_allclose(sticks + added, [row[str(s)] for s in STICKS], atol=1e-12)


@pytest.mark.slow
def test_a_lost_flight_says_when(ah1s):
    wild = Excitation({"d_lat": 3.0}, kind="prbs", band=(0.1, 0.3))
    with pytest.raises(FlightLostError, match=r"the AH-1S was lost at .* reduce excitation"):
        flight.fly(flight.Plan(SHORT, wild))


@pytest.mark.slow
def test_a_response_is_the_markov_parameters_of_the_model(ah1s, trims):
    """One pulse of the realization against the pulse it was made of."""
    model = truth.realization(ah1s, trims[10.0])
    pulse = np.zeros((50, 4))
    pulse[0, 0] = simulator.STEPS  # any size: the model is linear
    made = truth.response(model, pulse) / simulator.STEPS
    flown = truth.markov(ah1s, trims[10.0])[:50, :, 0]
    assert np.linalg.norm((made - flown) * truth.SCALE) < 0.01 * np.linalg.norm(flown * truth.SCALE)
