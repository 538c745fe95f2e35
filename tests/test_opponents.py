"""The helicopter written again by hand for the benchmarks: an independent check of the equations,
and a fair race.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import symheli
from symheli.codegen.numeric import Numeric
from symheli.integrate import runge_kutta

sys.path.append(str(Path(__file__).resolve().parents[1]))  # benchmarks/ is not installed

from benchmarks.opponents import python_control_sweep, scipy_flight
from benchmarks.opponents.c_flight import CFlight
from benchmarks.opponents.equations import build

# both sides sum a few hundred roundings of forces of the size of the weight
ROUNDING = {"rtol": 1e-12, "atol": 1e-12}


def motions(n):
    """Quaternion-form states in flight and out of control, inputs to beyond blade stall, wind; away
    from the vortex ring.
    """
    rng = np.random.default_rng(1)
    for _ in range(n):
        x = rng.standard_normal(15) * [8, 2, 1.5, 1, 1, 1, 1, 1, 1, 1, 50, 50, 50, 0.05, 0.05]
        x[6:10] /= np.linalg.norm(x[6:10])
        yield (
            x,
            rng.standard_normal(4) * [0.05, 0.05, 0.08, 0.1] + [0, 0, 0.1, 0.2],
            rng.standard_normal(3),
        )


@pytest.fixture(scope="module")
def flight(ideal):
    """Start in trim at 4 m/s, one second of doublets."""
    point = symheli.trim(ideal, 4.0)
    cp, sp, ct, st = (f(a / 2) for a in point.x.array[6:8] for f in (np.cos, np.sin))
    x0 = np.concatenate(
        [point.x.array[:6], [cp * ct, sp * ct, cp * st, -sp * st], np.zeros(3), point.x.array[8:]]
    )
    doublet = np.concatenate([np.ones(10), -np.ones(10), np.zeros(30)])[:, None] * [
        0.02,
        -0.01,
        0.01,
        0.03,
    ]
    return x0, point.u.array + doublet, np.array([1.0, -2.0, 0.3])


@pytest.fixture(scope="module")
def ours(ideal, flight):
    x, inputs, wind = flight
    step, states = Numeric(runge_kutta(ideal, 0.02, 4)), [x]
    for u in inputs:
        states.append(step(states[-1], u, wind)[0])
    return np.array(states)


def test_equations_written_by_hand_from_the_source_agree(ideal):
    by_hand, rhs, stalled = build(), ideal.numeric("flight_rhs"), 0
    for x, u, wind in motions(400):
        np.testing.assert_allclose(
            by_hand.quaternion(*x.tolist(), *u.tolist(), *wind.tolist()),
            rhs(x, u, wind)[0],
            **ROUNDING,
        )
    euler, rhs = by_hand.euler, ideal.numeric("rhs")
    for x, u, _ in motions(100):
        z = np.concatenate([x[:6], 0.5 * x[6:8], x[13:]])
        np.testing.assert_allclose(
            euler(*z.tolist(), *u.tolist()), rhs(z, u, np.zeros(3))[0], **ROUNDING
        )
        stalled += ideal.switches(z, u)["main rotor stall"] < 0
    assert 5 < stalled < 60  # the thrust limit was among what was compared


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_c_by_hand_flies_the_same_flight(ideal, flight, ours):
    code, rhs = CFlight("cc"), ideal.numeric("flight_rhs")
    for x, u, wind in motions(400):
        np.testing.assert_allclose(code.rates(x, u, wind), rhs(x, u, wind)[0], **ROUNDING)
    x0, inputs, wind = flight
    # rounding grows with the slow modes over a second
    np.testing.assert_allclose(code.fly(x0, inputs, wind, 0.02, 4), ours, rtol=1e-10, atol=1e-11)


@pytest.mark.slow  # compiles for half a minute
def test_numba_flies_the_same_flight(flight, ours):
    pytest.importorskip("numba", reason="needs numba: pip install 'symheli[benchmark]'")
    from benchmarks.opponents import numba_flight

    x0, inputs, wind = flight
    states = numba_flight.fly(x0, inputs, wind, 0.02, 4)
    np.testing.assert_allclose(states, ours, rtol=1e-10, atol=1e-11)
    many = numba_flight.fly_many(np.stack([x0, x0]), inputs, np.stack([wind, wind]), 0.02, 4)
    np.testing.assert_allclose(many, [ours[-1]] * 2, rtol=1e-10, atol=1e-11)


def test_scipy_flies_the_same_flight(flight, ours):
    x0, inputs, wind = flight
    # Runge-Kutta steps of 5 ms are off by 2e-6 in the rates of such doublets
    np.testing.assert_allclose(scipy_flight.fly(x0, inputs, wind, 0.02, 1e-9), ours, atol=5e-6)


def test_python_control_finds_the_same_trims_and_models(ideal):
    speeds = [0.0, 5.0, 7.0]
    family = symheli.sweep(ideal, speeds)
    for k, (x, u, model) in enumerate(python_control_sweep.sweep(np.array(speeds))):
        np.testing.assert_allclose(
            x, family.trims[k].x.array, atol=1e-7
        )  # the solver stops at 1.5e-8
        np.testing.assert_allclose(u, family.trims[k].u.array, atol=1e-7)
        np.testing.assert_allclose(model.A, family.A[k], atol=5e-5)  # forward differences of 1e-6


def test_a_gridded_lmi_over_two_parameters_finds_what_is_proven():
    """Less than the proof by what its P between the points is worth, a few tenths of a percent."""
    gridded_box = pytest.importorskip("benchmarks.opponents.gridded_box", reason="needs cvxpy")
    from synthesis import l2_gain
    from synthesis.forms import Spline

    rng = np.random.default_rng(0)
    A = [np.array([[-1.0, 2.0], [-2.0, -0.5]]), 0.3 * np.eye(2), np.diag([0.0, -0.3])]
    B, C, none = rng.normal(size=(2, 1)), rng.normal(size=(1, 2)), (0, 0)
    p = [symheli.Scheduling(name, "1", 0.0, 1.0, rate=1.0) for name in ("p", "q")]
    powers = dict(zip([none, (1, 0), (0, 1)], A, strict=True))
    model = symheli.LPVStateSpace.polynomial(
        powers, {none: B}, {none: C}, {none: np.zeros((1, 1))}, p
    )
    proven = l2_gain(model, form=Spline(degree=1, segments=1), search=None)
    assert proven.verified
    found = gridded_box.gain(A, B, C, 1.0, 5, "CLARABEL")
    assert 0.99 * proven.gamma <= found <= proven.gamma * 1.0001
