"""Many flights at once are the flights one by one, to the bit."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from flights import manoeuvre, without_compiler

from symheli import simulate
from symheli.codegen.numeric import Numeric
from symheli.errors import InputError
from symheli.integrate import Feedback, runge_kutta, simulate_batch
from symheli.physics.attitude import euler_state


def many(heli, count, n=5, seed=0):
    """Starts (count, nx), inputs (count, n, 4), wind (count, n, 3) and masses (count,) that all
    differ.
    """
    rng = np.random.default_rng(seed)
    x0, u = manoeuvre(heli, n=n)
    starts = np.tile(x0, (count, 1))
    starts[:, :6] += 0.3 * rng.normal(size=(count, 6))
    return (
        starts,
        u + 0.01 * rng.normal(size=(count, n, 4)),
        rng.normal(size=(count, n, 3)),
        rng.uniform(7.0, 9.0, count),
    )


def feedback(heli, n, seed=0):
    rng = np.random.default_rng(seed)
    x0, _ = manoeuvre(heli, n=1)
    return Feedback(
        0.02 * rng.normal(size=(n, 4, len(heli.states))),
        np.tile(euler_state(x0), (n, 1)),
        heli.travel,
    )


@pytest.mark.slow(but="ideal")
def test_each_flight_is_the_single_flight_to_the_bit(heli):
    x0, u, wind, mass = many(heli, 37)  # all lanes once, and a rest
    batch = simulate_batch(heli, x0, u, wind, dt=0.02, parameters={"body.mass": mass}, keep=1)
    assert batch.states.shape == (37, 6, len(heli.flight_states))
    for i in (0, 7, 8, 31, 32, 36):
        alone = simulate(
            heli.with_parameters({"body.mass": mass[i]}), x0[i], u[i], wind[i], dt=0.02
        )
        np.testing.assert_array_equal(batch.states[i], alone.states)


def test_workers_and_neighbours_change_no_bit(ideal):
    x0, u, wind, _ = many(ideal, 200)
    one, two, seven = (
        simulate_batch(ideal, x0, u, wind, dt=0.02, workers=w).final for w in (1, 2, 7)
    )
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(one, seven)
    turned = simulate_batch(ideal, x0[::-1], u[::-1], wind[::-1], dt=0.02).final
    np.testing.assert_array_equal(turned[::-1], one)


@pytest.mark.slow(but="pi")
def test_numpy_differs_from_machine_code_by_rounding(heli, monkeypatch):
    x0, u, wind, mass = many(heli, 20, n=3)
    options = {
        "dt": 0.02,
        "parameters": {"body.mass": mass, "density": 1.1},
        "feedback": feedback(heli, 3),
        "keep": 1,
    }
    compiled = simulate_batch(heli, x0, u, wind, **options)
    plain = simulate_batch(without_compiler(monkeypatch, heli), x0, u, wind, **options)
    # 12 steps of a few hundred operations, each rounded to 1e-16 of numbers up to 100
    np.testing.assert_allclose(plain.states, compiled.states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(plain.inputs, compiled.inputs, rtol=1e-12, atol=1e-12)


def test_shared_histories_are_the_same_as_repeated_ones(ideal):
    x0, u, wind, _ = many(ideal, 6)
    shared = simulate_batch(ideal, x0, u[0], wind[0], dt=0.02).final
    np.testing.assert_array_equal(
        shared,
        simulate_batch(
            ideal, x0, np.tile(u[0], (6, 1, 1)), np.tile(wind[0], (6, 1, 1)), dt=0.02
        ).final,
    )
    steady = simulate_batch(ideal, x0[0], u, np.array([1.0, 2.0, 0.0]), dt=0.02).final
    np.testing.assert_array_equal(
        steady,
        simulate_batch(
            ideal, np.tile(x0[0], (6, 1)), u, np.tile([1.0, 2.0, 0.0], (6, 1, 1)), dt=0.02
        ).final,
    )


def test_what_is_kept_is_what_was_asked_for(ideal):
    x0, u, wind, _ = many(ideal, 3, n=7)
    every = simulate_batch(ideal, x0, u, wind, dt=0.02, keep=1)
    third = simulate_batch(ideal, x0, u, wind, dt=0.02, keep=3)
    np.testing.assert_array_equal(third.states, every.states[:, ::3])
    np.testing.assert_allclose(third.times, [0.0, 0.06, 0.12])
    last = simulate_batch(ideal, x0, u, wind, dt=0.02)
    np.testing.assert_array_equal(last.final, every.final)
    np.testing.assert_allclose(last.times, [0.14])
    np.testing.assert_array_equal(every["q0"], every.states[:, :, 6])


def test_feedback_is_that_of_a_loop_over_samples(heli):
    x0, u, wind, _ = many(heli, 3, n=8)
    loop = feedback(heli, 8)
    batch = simulate_batch(heli, x0, u, wind, dt=0.02, feedback=loop, keep=1)
    step, x = Numeric(runge_kutta(heli, 0.02, 4)), x0[1]
    for k in range(8):
        command = np.clip(
            u[1, k] - loop.gains[k] @ (euler_state(x) - loop.reference[k]),
            -heli.travel,
            heli.travel,
        )
        np.testing.assert_allclose(batch.inputs[1, k], command, atol=1e-12)
        x = step(x, command, wind[1, k])[0]
    np.testing.assert_allclose(batch.final[1], x, atol=1e-11)
    alone = simulate(heli, x0[1], u[1], wind[1], dt=0.02, feedback=loop)
    np.testing.assert_array_equal(alone.states, batch.states[1])
    np.testing.assert_array_equal(alone.inputs, batch.inputs[1, :-1])


def test_a_lost_flight_is_marked_and_harms_no_other(ideal):
    x0, u, _, _ = many(ideal, 20)
    good = simulate_batch(ideal, x0, u, dt=0.02).final
    x0[3, 3] = 1e160  # rad/s: squares overflow
    batch = simulate_batch(ideal, x0, u, dt=0.02)
    np.testing.assert_array_equal(batch.lost, np.arange(20) == 3)
    np.testing.assert_array_equal(np.delete(batch.final, 3, axis=0), np.delete(good, 3, axis=0))


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_a_long_batch_at_once(ideal):
    x0, u, _, _ = many(ideal, 64, n=1)
    simulate_batch(ideal, x0, u, dt=0.02)  # compiled before the clock runs
    long = np.broadcast_to(u[0, 0], (400_000, 4))  # some minutes of computing
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    begin = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        simulate_batch(ideal, x0, long, dt=0.02)
    assert (
        time.perf_counter() - begin < 5.0
    )  # a sample takes microseconds; the rest is what a busy machine may add


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"x0": np.zeros((4, 10)), "u": np.zeros((5, 3, 4))},
            r"must agree on the number of flights N >= 1, got \[4, 5\]",
        ),
        (
            {"x0": np.zeros(10), "u": np.zeros((3, 4))},
            "must agree on the number of flights N >= 1, got none",
        ),
        ({"parameters": {"body.mass": np.ones(3)}}, "must agree on the number of flights"),
        ({"parameters": {"body.mass": [1.0, np.nan, 1.0, 1.0]}}, "body.mass: entry"),
        ({"parameters": {"body.mas": 8.0}}, "did you mean 'body.mass'"),
        ({"parameters": {"body.mass": [8.0, -8.0, 8.0, 8.0]}}, "body.mass"),
        ({"parameters": {"controls.d_lon": 0.1}}, "controls.d_lon is not part of the equations"),
        ({"keep": 0}, 'keep must be "final" or a number of samples from 1 to 3'),
        ({"workers": 0}, "workers must be at least 1"),
        ({"wind": np.zeros((4, 2, 3))}, "wind: expected 3 numbers or 3 samples"),
        ({"u": np.full((4, 3, 4), np.inf)}, "u: entry"),
    ],
)
def test_what_does_not_fit_is_refused_with_a_reason(ideal, change, message):
    arguments = {"x0": np.zeros((4, 10)), "u": np.zeros((4, 3, 4)), "dt": 0.02} | change
    with pytest.raises(InputError, match=message):
        simulate_batch(
            ideal,
            arguments.pop("x0"),
            arguments.pop("u"),
            arguments.pop("wind", (0, 0, 0)),
            **arguments,
        )
