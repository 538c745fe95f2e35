"""Single flights: three methods, their order, their agreement, what they refuse."""

from itertools import pairwise

import numpy as np
import pytest
from flights import held, manoeuvre, transition, without_compiler

import symheli
from symheli import simulate
from symheli.codegen.numeric import Numeric
from symheli.errors import InputError, SymheliError
from symheli.integrate import CashKarp, DormandPrince, Feedback, Radau, RungeKutta4, runge_kutta
from symheli.physics.attitude import euler_state, flight_state


@pytest.mark.parametrize(
    ("methods", "order"),
    [
        ([RungeKutta4(0.02 / k) for k in (1, 2, 4)], 4),
        (
            [DormandPrince(relative=1e3, largest=0.02 / k) for k in (1, 2, 4)],
            5,
        ),  # any error is tolerated: equal steps
        ([CashKarp(relative=1e3, largest=0.02 / k) for k in (1, 2, 4)], 5),
        ([Radau(0.04 / k, stages=2) for k in (1, 2, 4)], 3),
        ([Radau(0.04 / k, stages=3) for k in (1, 2, 4)], 5),
    ],
)
def test_the_error_falls_with_the_order_of_the_method(ideal, methods, order):
    x0, u = manoeuvre(ideal, n=2)  # 6 m/s: no wake edge nearby, the equations are smooth there
    x0[:6] += 0.1
    exact = simulate(ideal, x0, u, dt=0.32, method=DormandPrince(1e-13, 1e-13)).final
    errors = [
        np.abs(simulate(ideal, x0, u, dt=0.32, method=m).final - exact).max() for m in methods
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders[-1] - order) < 0.5), (
        orders
    )  # the next term of the error is still a tenth of the first


@pytest.mark.slow
def test_three_methods_fly_the_same_flight(heli):
    x0, u = manoeuvre(heli, n=25)
    wind = 0.5 * np.sin(np.arange(25)[:, None] * [0.3, 0.5, 0.7])
    methods = (
        RungeKutta4(0.0025),
        DormandPrince(1e-10, 1e-10),
        CashKarp(1e-10, 1e-10),
        Radau(0.01),
    )
    flights = [simulate(heli, x0, u, wind, dt=0.02, method=m) for m in methods]
    for other in flights[1:]:
        # twice the errors against steps of 0.2 ms: 4e-8, 2e-10 twice, 3e-8
        np.testing.assert_allclose(other.states, flights[0].states, atol=2e-7)
    for flown in flights:
        np.testing.assert_allclose(np.linalg.norm(flown.states[:, 6:10], axis=1), 1.0, atol=4e-16)


def test_the_fixed_step_is_that_of_the_closed_loop_flights(heli):
    x0, u = manoeuvre(heli, n=20)
    step, x = Numeric(runge_kutta(heli, 0.02, 4)), x0
    for row in u:
        x = step(x, row, np.array([1.0, -1.0, 0.2]))[0]
    np.testing.assert_allclose(
        simulate(heli, x0, u, (1.0, -1.0, 0.2), dt=0.02).final, x, atol=1e-11
    )  # two programs, rounded apart


@pytest.mark.parametrize("pair", [CashKarp, DormandPrince])
def test_a_tighter_tolerance_means_a_smaller_error(ideal, pair):
    x0, u = manoeuvre(ideal, n=10)
    exact = simulate(ideal, x0, u, dt=0.1, method=DormandPrince(1e-13, 1e-13)).final
    errors = [
        np.abs(simulate(ideal, x0, u, dt=0.1, method=pair(t, t)).final - exact).max()
        for t in (1e-5, 1e-7, 1e-9)
    ]
    assert errors[0] < 1e-3
    assert all(after < before / 10 for before, after in pairwise(errors))


@pytest.mark.parametrize("pair", [CashKarp, DormandPrince])
def test_steps_end_where_the_equations_change_their_form(ideal, pair):
    """One step a sample, and two more where a part switches, leave less than a fifth of the error
    of four classical steps, with less than half of their evaluations: those cross the kinks.
    """
    x0, u = transition(ideal)
    exact = simulate(ideal, x0, u, dt=0.02, method=RungeKutta4(0.02 / 128)).states
    adaptive = simulate(ideal, x0, u, dt=0.02, method=pair(1e-6, 1e-6))
    equal = simulate(ideal, x0, u, dt=0.02)
    error, classical = (np.abs(flown.states - exact).max() for flown in (adaptive, equal))
    assert error < classical / 5
    assert adaptive.evaluations < equal.evaluations / 2
    assert equal.evaluations == 4 * len(equal.steps)
    assert 0 < (adaptive.per_sample > 1).sum() < 20
    for k in np.flatnonzero(adaptive.per_sample == 1):
        before, after = (
            ideal.switches(euler_state(x), u[k], np.zeros(3)) for x in adaptive.states[k : k + 2]
        )
        for name in before:
            if before[name] * after[name] < 0:
                share = before[name] / (before[name] - after[name])
                assert not 0.02 < share < 0.98, (k, name)  # 0.01, and what normalising moves


@pytest.mark.slow(but="method0")
@pytest.mark.parametrize("method", [CashKarp(1e-6, 1e-6), DormandPrince(1e-6, 1e-6)])
def test_without_a_compiler_the_same_switches_are_stepped_to(ideal, monkeypatch, method):
    x0, u = transition(ideal)
    compiled = simulate(ideal, x0, u[:200], dt=0.02, method=method)
    plain = simulate(without_compiler(monkeypatch, ideal), x0, u[:200], dt=0.02, method=method)
    assert (compiled.per_sample > 1).any()
    np.testing.assert_array_equal(plain.per_sample, compiled.per_sample)
    assert plain.evaluations == compiled.evaluations
    # 1e-15 of the switching functions, over what they change in a step
    np.testing.assert_allclose(plain.steps, compiled.steps, rtol=1e-9)
    np.testing.assert_allclose(plain.states, compiled.states, rtol=1e-10, atol=1e-10)


@pytest.mark.filterwarnings("ignore:.*numbers that no helicopter has")
def test_flapping_too_fast_for_explicit_steps_is_flown_by_the_implicit_method(ideal):
    """A light bar follows the swash plate in a tenth of a millisecond: nothing else changes, 5 ms
    steps of order 4 explode.
    """
    x0, u = manoeuvre(ideal, n=10)
    stiff = ideal.with_parameters({"main_rotor.bar_lock_number": 800.0})
    with pytest.raises(SymheliError, match="became NaN or infinite"):
        simulate(stiff, x0, np.repeat(u, 10, axis=0), dt=0.02)
    implicit = simulate(stiff, x0, u, dt=0.02, method="radau")
    fine = simulate(stiff, x0, u, dt=0.02, method=RungeKutta4(1e-4))
    np.testing.assert_allclose(
        implicit.final, fine.final, atol=1e-5
    )  # the implicit error, 2e-6, falls by 32 and more as its step is halved


@pytest.mark.slow(but="ideal")
def test_without_a_compiler_a_flight_differs_by_rounding(heli, monkeypatch):
    x0, u = manoeuvre(heli, n=5)
    changed = heli.with_parameters({"body.mass": 8.0, "density": 1.1})
    for method in ("rk4", "cash_karp", "dopri"):
        compiled = simulate(changed, x0, u, (1.0, 0.0, 0.5), dt=0.02, method=method)
        with monkeypatch.context() as patch:
            plain = simulate(
                without_compiler(patch, changed), x0, u, (1.0, 0.0, 0.5), dt=0.02, method=method
            )
        # 20 steps of a few hundred operations, each rounded to 1e-16 of numbers up to 100
        np.testing.assert_allclose(plain.states, compiled.states, rtol=1e-12, atol=1e-12)
        # steps follow the fifth root of an estimate that is a small difference of large numbers
        np.testing.assert_allclose(plain.steps, compiled.steps, rtol=1e-6)


@pytest.mark.slow(but="ideal")
def test_without_a_compiler_40_s_of_a_stable_flight_agree_to_a_billionth(heli, monkeypatch):
    """Feedback forgets a rounding, so that it does not grow; only the place remembers it all."""
    x0, u, feedback = held(heli, 40.0)
    compiled = simulate(heli, x0, u, dt=0.02, feedback=feedback)
    plain = simulate(without_compiler(monkeypatch, heli), x0, u, dt=0.02, feedback=feedback)
    size = np.abs(compiled.states).max(axis=0)
    assert (np.abs(plain.states - compiled.states).max(axis=0) < 1e-9 * size).all()
    assert np.abs(compiled["u"] - 6.0).max() < 3.0


def test_a_trimmed_flight_goes_straight_on(heli):
    point = symheli.trim(heli, 5.0)
    flown = simulate(heli, point, np.tile(point.u.array, (50, 1)), dt=0.02)
    # the residual of the trim, 1e-9, grows with the unstable modes for one second
    np.testing.assert_allclose(
        euler_state(flown.states), np.tile(point.x.array, (51, 1)), atol=1e-7
    )
    np.testing.assert_allclose(flown["x_n"], 5.0 * flown.times, atol=1e-6)
    record = flown.to_record()
    assert record["d_col"][0] == point.u["d_col"]
    np.testing.assert_array_equal(record["theta"], euler_state(flown.states)[:, 7])


def test_another_airframe_of_the_same_parts_needs_no_new_code(ideal, monkeypatch):
    x0, u = manoeuvre(ideal, n=10)
    simulate(ideal, x0, u, dt=0.02)
    monkeypatch.setattr(
        "symheli.integrate.equations.library", lambda source, name: pytest.fail("compiled anew")
    )
    thin = simulate(ideal.with_parameters({"density": 1.0}), x0, u, dt=0.02)
    monkeypatch.undo()
    loaded = symheli.Helicopter.load("xcell60", governor="ideal", density=1.0)
    np.testing.assert_array_equal(simulate(loaded, x0, u, dt=0.02).states, thin.states)


def test_attitude_forms_are_inverse():
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(0)
    x = rng.uniform(-1.2, 1.2, (20, 10))
    flight = flight_state(x, heading=2.0, position=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(euler_state(flight), x, atol=1e-14)
    angles = np.column_stack([np.full(20, 2.0), x[:, 7], x[:, 6]])
    np.testing.assert_allclose(
        flight[:, 6:10],
        Rotation.from_euler("ZYX", angles).as_quat(canonical=True, scalar_first=True)
        * np.sign(flight[:, 6:7]),
        atol=1e-14,
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"u": np.zeros((3, 5))}, r"u: expected shape \(any, 4\), got \(3, 5\)"),
        ({"u": np.full((3, 4), np.nan)}, r"u: entry \(0, 0\) is nan"),
        ({"u": np.zeros((0, 4))}, "u has no samples"),
        ({"wind": np.zeros((2, 3))}, "wind: expected 3 numbers or 3 samples"),
        ({"wind": (0.0, np.inf, 0.0)}, "wind: entry"),
        ({"x0": np.zeros(15)}, "the quaternion q0 q1 q2 q3 of flight 0 has length 0, expected 1"),
        ({"x0": np.zeros(9)}, "expected 15 states in quaternion form or 10 in Euler form"),
        ({"dt": 0.0}, "dt must be a positive"),
        ({"method": "euler"}, "unknown method 'euler'"),
        (
            {"feedback": Feedback(np.zeros((3, 4, 9)), np.zeros((3, 9)), np.ones(4))},
            r"expected gains \(3, 4, 10\)",
        ),
        (
            {
                "feedback": Feedback(np.zeros((3, 4, 10)), np.zeros((3, 10)), np.ones(4)),
                "method": "dopri",
            },
            'flown by "rk4" only',
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_a_reason(ideal, change, message):
    arguments = {"x0": flight_state(np.zeros(10)), "u": np.zeros((3, 4)), "dt": 0.02} | change
    with pytest.raises(InputError, match=message):
        simulate(
            ideal,
            arguments.pop("x0"),
            arguments.pop("u"),
            arguments.pop("wind", (0, 0, 0)),
            **arguments,
        )


def test_a_flight_that_cannot_be_continued_says_where(ideal):
    x0, u = manoeuvre(ideal, n=3)
    with pytest.raises(SymheliError, match="steps became too small or too many"):
        simulate(ideal, x0, u, dt=1.0, method=DormandPrince(1e-12, 1e-12, most=20))
    for bad in (
        lambda: RungeKutta4(0.0),
        lambda: DormandPrince(relative=-1.0),
        lambda: Radau(stages=0),
    ):
        with pytest.raises(InputError, match="must be"):
            bad()
