"""Tubes of loops with governor, observer, servos and a sampled controller."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import symheli
from evidence.tube_flights import from_its_border, worst
from evidence.tube_loops import EIGHT, FINE
from symheli import Helicopter, LinearModel, trim
from symheli.errors import InputError, UnknownNameError
from symheli.flight import XCELL_SERVOS
from symheli.lpv import connect
from symheli.lpv.tools import Actuation
from symheli.values.signal import Signal
from synthesis.tubes import Tube, coverage, tube
from synthesis.tubes.controllers import Choice
from synthesis.tubes.deviations import CommandCell, Deviations
from synthesis.tubes.equipment import LoopEquipment, of_periods
from synthesis.tubes.proof import falls_in, is_within
from synthesis.tubes.reference import held
from synthesis.tubes.travel import fastest, why_not_free

PERIOD = 0.02


@pytest.fixture(scope="module")
def at_3():
    heli = Helicopter.load("xcell60", governor="ideal")
    steady = trim(heli, airspeed=3.0)
    x, u = np.array(steady.x), np.array(steady.u)
    A, B, _ = (np.asarray(m) for m in heli.jacobian(x, u, np.zeros(3)))
    return heli, x, u, A, B


def closed(A, B, gain, equipment):
    """The linear loop (n + m, n + m) between samples."""
    n, rows = len(A), equipment.flow(gain)[0]
    F = np.zeros((len(rows) - 4 + n,) * 2)
    F[:n, :n] = A
    F[:n] += B @ rows[:4]
    F[n:] = rows[4:]
    return F


def flown_law(heli, x, u):
    """The regulator's gains from the states that flights measure, sampled."""
    K = Choice(slow=True).regulator(heli, x, u)[:, : len(EIGHT)]
    return replace(LinearModel.gain(K, heli.states[: len(EIGHT)], heli.inputs), dt=PERIOD)


def sorted_poles(M):
    return np.sort_complex(np.linalg.eigvals(M).round(6))


def test_the_observer_leaves_the_poles_of_the_regulator(at_3):
    heli, x, u, A, B = at_3
    gain, states = Choice(known=EIGHT).gains(heli, x[None], u[None], np.array([3.0]))
    assert states == ("a1_observer", "b1_observer")
    poles = sorted_poles(closed(A, B, gain, LoopEquipment(states)))
    K = Choice().regulator(heli, x, u)
    for pole in np.linalg.eigvals(A + B @ K):
        # each again; of 1e-8 relative accuracy of these eigenvalues, far below their distances
        assert np.abs(poles - pole).min() < 1e-5
    assert poles.real.max() < 0


def test_servos_and_clock_make_the_loop_that_connections_make(at_3):
    heli, x, u, A, B = at_3
    K = Choice(slow=True).regulator(heli, x, u)
    names = tuple(map(str, heli.inputs))
    shape = heli.states, heli.inputs, heli.states
    plant = LinearModel(A, B, np.eye(10), np.zeros((10, 4)), *shape)
    law = LinearModel.gain(K, heli.states, [Signal(f"{name}_command", "rad") for name in names])
    servos = [FINE[name].linear(name) for name in names]
    loop = connect(plant, law, *servos, inputs=[], outputs=["phi"])
    own = LoopEquipment(actuation=Actuation(FINE))
    np.testing.assert_allclose(
        sorted_poles(closed(A, B, K[None], own)), sorted_poles(loop.A), atol=1e-4
    )
    # sampled, one period late: plant and servos by their exact discretization, and a memory
    driven = connect(
        plant, *servos, inputs=[f"{name}_command" for name in names], outputs=list(heli.states)
    ).discretize(PERIOD)
    late = np.block([[driven.A, driven.B], [K @ driven.C, np.zeros((4, 4))]])
    sampled = LoopEquipment(actuation=of_periods(FINE, PERIOD, 1))
    F = closed(A, B, K[None], sampled)
    step = expm(F * PERIOD) @ sampled.jump(K[None])
    own_poles, other = (np.sort(np.abs(np.linalg.eigvals(M))) for M in (step, late))
    # those of the commands that are overwritten are at 0; here the slow ones
    np.testing.assert_allclose(own_poles[-20:], other[-20:], atol=1e-6)


def test_the_reference_of_servos_follows_the_controls():
    heli = Helicopter.load("xcell60", governor="ideal")
    reference = held(heli, 3.0, Choice(slow=True), XCELL_SERVOS)
    loop = Deviations(heli, reference, 0.1)
    e, w, c = np.zeros(21), np.zeros(3), np.zeros(4)
    assert np.abs(np.asarray(loop.rate(e, w, c, reference.data[0]))).max() < 1e-6  # of the trim
    moved, added = reference.equipment.forward
    bank = reference.equipment.bank
    # settled at 1 rad the servos' pitch is 1 and does not change
    np.testing.assert_allclose(bank.C @ bank.settled, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(bank.A @ bank.settled + bank.B, 0, atol=1e-9)
    np.testing.assert_array_equal(moved, -bank.settled)
    np.testing.assert_array_equal(added, bank.B)


def test_an_output_is_bounded_by_the_ellipsoid_and_no_less():
    rng = np.random.default_rng(0)
    L = rng.standard_normal((2, 4, 4))
    P = L @ np.swapaxes(L, 1, 2) + np.eye(4)
    k = rng.standard_normal((2, 4))
    most = max(np.sqrt(row @ np.linalg.inv(own) @ row) for own, row in zip(P, k, strict=True))
    assert is_within(P, k, most * (1 + 1e-9))
    assert not is_within(P, k, most * (1 - 1e-9))
    assert not is_within(P, k, -most * 2)


def test_a_jump_is_seen_to_fall_or_to_rise():
    P, R = np.diag([1.0, 2.0]), np.array([[0.0, 1.0], [0.5, 0.0]])
    assert falls_in(R, P, P)  # R'P R = diag(.5, 1)
    assert not falls_in(1.5 * R, P, P)  # diag(1.125, 2.25)


def test_the_clock_changes_nothing_of_the_equations(at_3):
    loop = Deviations(at_3[0], held(at_3[0], 3.0, Choice(slow=True, period=PERIOD)), 0.2)
    e, w = 1e-2 * np.random.default_rng(0).normal(size=len(loop.states)), np.ones(3)
    rates = [loop.rate(e, w, [s, 1.0, 0.0, 0.0], loop.reference.data[0]) for s in (0.0, 0.3, 1.0)]
    assert np.ptp(np.array(rates), axis=0).max() == 0
    assert np.abs(np.array(rates[0])).max() > 0


@pytest.fixture(scope="module")
def enclosed():
    heli = Helicopter.load("xcell60", governor="ideal")
    loop = Deviations(heli, held(heli, 3.0, Choice(slow=True), FINE), 0.1)
    cell = CommandCell(0, (0.0, 0.0), (0.0, 0.0))
    factor = 0.05 * np.diag([*(0.4, 0.5, 0.8, 0.1, 0.1, 0.3, 0.08, 0.06, 0.02, 0.02), *[0.05] * 11])
    (over,) = loop.enclosed([cell], factor[None], loop.drifts([cell]))
    return loop, cell, over, factor


@pytest.mark.slow
def test_rates_of_commands_are_bounded_on_a_tube(enclosed):
    loop, _, over, factor = enclosed
    row = loop.reference.equipment.commands(loop.reference.gain)[0, 1]
    bound, rng = fastest(row, over, factor), np.random.default_rng(0)
    z = rng.standard_normal((300, len(factor)))
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    w = rng.standard_normal((300, 3))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    rates = [
        abs(row @ np.asarray(loop.rate(factor @ a, b, np.zeros(4), loop.reference.data[0]))[:, 0])
        for a, b in zip(z, w, strict=True)
    ]
    assert 0.3 * bound < max(rates) <= bound


@pytest.mark.slow
def test_a_tube_that_reaches_the_travel_or_a_rate_limit_is_refused(enclosed):
    loop, cell, over, factor = enclosed
    P = np.linalg.inv(factor @ factor.T)[None]
    assert why_not_free(loop, [cell], P, [(over, factor)]) == ""
    assert "travel" in why_not_free(loop, [cell], P / 1e6, [(over, factor)])
    slow = {name: replace(servo, rate=1e-4) for name, servo in FINE.items()}
    equipment = replace(loop.reference.equipment, actuation=Actuation(slow))
    limited = replace(loop, reference=replace(loop.reference, equipment=equipment))
    assert "faster" in why_not_free(limited, [cell], P, [(over, factor)])


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_rate_limit_is_that_of_its_control_in_any_order(enclosed, share):
    """Every control at its own bound, which differ; the servos in another order."""
    loop, cell, over, factor = enclosed
    P = np.linalg.inv(factor @ factor.T)[None]
    own = loop.reference.equipment
    for u, row in zip(FINE, own.commands(loop.reference.gain)[0], strict=True):
        limit = replace(FINE[u], rate=share * fastest(row, over, factor))
        servos = {**dict(reversed(FINE.items())), u: limit}
        equipment = replace(own, actuation=Actuation(servos))
        limited = replace(loop, reference=replace(loop.reference, equipment=equipment))
        why = why_not_free(limited, [cell], P, [(over, factor)])
        assert why == ("" if share > 1 else f"{u}_command may change faster than its servo follows")


def test_equipment_is_the_same_when_read_again():
    for own in (
        LoopEquipment(),
        LoopEquipment(("z",), Actuation(XCELL_SERVOS)),
        LoopEquipment(actuation=of_periods(FINE, PERIOD, 2), parts=3),
    ):
        again = LoopEquipment.read(json.loads(json.dumps(own.written())))
        assert again.written() == own.written()
        assert again.names == own.names


@pytest.mark.parametrize(
    "given",
    [
        {"period": -1.0},
        {"period": np.nan},
        {"delay": 1},
        {"delay": -1, "period": PERIOD},
        {"parts": 0},
        {"servos": {"d_lon": FINE["d_lon"]}},
        {"period": PERIOD, "servos": {n: replace(s, rate=1.0) for n, s in FINE.items()}},
    ],
)
def test_equipment_that_does_not_fit_is_refused(given):
    of = {"servos": None, "period": 0.0, "delay": 0, "parts": 1, **given}
    with pytest.raises(InputError):
        LoopEquipment((), of_periods(of["servos"], of["period"], of["delay"]), of["parts"])
    with pytest.raises(InputError, match="no whole number of samples"):
        LoopEquipment(actuation=Actuation(delay=0.03, period=PERIOD))


@pytest.mark.slow
def test_the_seconds_of_an_actuation_are_the_periods_of_a_tube(at_3):
    """The same proof, to the last digit of its file; and no delay is given twice."""
    heli, given = at_3[0], {"gust": 0.1, "period": PERIOD, "delay": 1}
    counted = tube(heli, 3.0, **given)
    timed = tube(heli, 3.0, gust=0.1, servos=Actuation(delay=PERIOD, period=PERIOD))
    assert counted.verified
    assert timed.stored == counted.stored
    with pytest.raises(InputError, match="leave one out"):
        tube(heli, 3.0, servos=Actuation(delay=PERIOD), **given)


def test_controllers_that_do_not_fit_are_refused(at_3):
    heli = at_3[0]
    with pytest.raises(UnknownNameError):
        tube(heli, 3.0, gust=0.1, gain=LinearModel.gain(np.zeros((1, 1)), ["speed"], ["d_lat"]))
    slow = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("z",), ("phi",), ("d_lat",))
    with pytest.raises(InputError, match="sample period"):
        tube(heli, 3.0, gust=0.1, gain=slow, period=PERIOD)
    with pytest.raises(InputError, match="sample period"):
        tube(heli, 3.0, gust=0.1, gain=slow.discretize(PERIOD))
    with pytest.raises(InputError, match="expected"):
        tube(heli, 3.0, gust=0.1, gain=3.0)
    limited = {name: replace(servo, rate=1.0) for name, servo in FINE.items()}
    with pytest.raises(InputError, match="rate limit"):
        tube(heli, (3.0, 4.0), gust=0.1, acceleration=1.0, jerk=1.0, servos=limited)


def test_the_integral_of_the_governor_stops_as_printed():
    heli = Helicopter.load("xcell60")
    own = heli.vehicle.values("drivetrain")
    steady, rng = trim(heli, airspeed=3.0), np.random.default_rng(0)
    rhs = heli.numeric("rhs")
    for _ in range(20):
        x = np.array(steady.x)
        x[10:] = rng.uniform(100, 240), rng.uniform(-60, 100)
        error = own["nominal_speed"] - x[10]
        wanted = own["governor_kp"] * error + own["governor_ki"] * x[11]
        pushed = (wanted - np.clip(wanted, 0, 1)) * error > 0
        assert rhs(x, np.array(steady.u), np.zeros(3))[0][11] == (0.0 if pushed else error)


def test_the_first_hypothesis_that_a_flight_breaks_is_named(at_3):
    heli, x, u, *_ = at_3
    law = flown_law(heli, x, u)
    loop = Deviations(heli, held(heli, 3.0, Choice(law, period=PERIOD)), 0.2)
    n = len(loop.states)
    given = Tube(loop, np.tile(100 * np.eye(n), (2, 1, 1)), (), np.zeros((0, n, n)), (), True, "")
    calm = symheli.AirspeedSchedule((3.0,), (1.0,), (0.2,), lead=0.1, start=3.0)
    climb = symheli.AirspeedSchedule.transition(3.0, 3.1, acceleration=1.0, hold=0.1)
    for schedule, options, words in (
        (calm, {}, ""),
        (calm, {"controller": None}, "the controller is that of the tube"),
        (calm, {"noise_db": 30.0}, "sensors without noise and bias"),
        (calm, {"delay": PERIOD}, "servos and delay are those of the tube"),
        (calm, {"wind": (0.3, 0.0, 0.0)}, "gusts, m/s: 0.3 flown, 0.2 in the tube"),
        (climb, {}, "commanded airspeed, m/s, at most: 3.1 flown, 3 in the tube"),
    ):
        flight = symheli.fly(heli, schedule, **{"controller": law, "dt": PERIOD, **options})
        assert coverage(given, flight).fails == words
    with pytest.raises(InputError, match="proven"):
        coverage(replace(given, verified=False), flight)


# --- whole tubes --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sampled(at_3):
    found = tube(at_3[0], 3.0, gust=0.2, period=PERIOD)
    assert found.verified, found.why
    return found


@pytest.mark.slow
def test_no_flight_of_the_sampled_loop_leaves_its_tube(sampled):
    assert from_its_border(sampled, 100, 1.0) < 1 + 1e-6  # that of the integration
    assert 0.4 < worst(sampled) < 1


@pytest.mark.slow
def test_a_sampled_tube_is_proven_again_and_its_forgeries_are_not(sampled, tmp_path):
    path = sampled.save(tmp_path / "tube.json")
    again = Tube.load(path)
    assert again.verified
    assert again.hypotheses == sampled.hypotheses
    whole = path.read_text()
    for forge in (
        lambda c: c["equipment"].update(period=2 * PERIOD),
        lambda c: c["equipment"].update(period=0.5 * PERIOD),
        lambda c: c.update(gain=(1.2 * np.array(c["gain"])).tolist()),
        lambda c: c.update(P=c["P"][::-1]),
        lambda c: c.update(gust=1.5 * c["gust"]),
    ):
        content = json.loads(whole)
        forge(content)
        path.write_text(json.dumps(content))
        assert not Tube.load(path).verified
    with pytest.raises(InputError, match="sampled"):
        sampled.with_gain(["theta"])


@pytest.mark.slow
def test_flights_of_the_package_are_covered_and_stay_inside(at_3):
    heli, x, u, *_ = at_3
    sampled = tube(heli, 3.0, gust=0.05, gain=flown_law(heli, x, u), period=PERIOD)
    assert sampled.verified, sampled.why
    calm = symheli.AirspeedSchedule((3.0,), (1.0,), (3.0,), lead=0.1, start=3.0)
    schedule = {"dt": PERIOD, "controller": flown_law(heli, x, u)}
    flight = symheli.fly(heli, calm, **schedule)
    found = coverage(sampled, flight)
    assert found.covered, found.fails
    windy = coverage(sampled, symheli.fly(heli, calm, wind=(0.3, 0.0, 0.0), **schedule))
    assert windy.fails == "gusts, m/s: 0.3 flown, 0.05 in the tube"
    for name, state, most in zip(heli.states, x, sampled.half_widths, strict=False):
        assert np.abs(flight[str(name)] - state).max() <= most
