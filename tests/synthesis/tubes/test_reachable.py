"""Finite-time reachable tubes: closed forms, simulations, and the verdicts of ARCH-COMP."""

import casadi
import numpy as np
import pytest
from casadi import cos, sin, tan
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from symheli.errors import InputError
from synthesis.tubes import reachable
from synthesis.tubes.reachable import Ball, flow, point


def of_one(rate):
    x = casadi.SX.sym("x")
    return casadi.Function("f", [x], [rate(x)])


def test_a_cubic_decay_holds_its_closed_form_and_hardly_more():
    found = reachable(of_one(lambda x: -(x**3)), ([0.9], [1.1]), 0.5, step=0.04)
    for k in range(len(found.times)):
        low, high = (x / np.sqrt(1 + 2 * found.times[k] * x**2) for x in (0.9, 1.1))
        assert found.at_lower[k, 0] <= low <= high <= found.at_upper[k, 0]
        assert found.at_upper[k, 0] - found.at_lower[k, 0] < (high - low) + 0.03
    assert found.bounds("x1")[1] < 1.13


def test_a_motion_from_a_point_is_enclosed_to_many_digits():
    """x' = 1 + x^2 from 0 is tan t; the sets are points but for the remainder of a step."""
    found = reachable(of_one(lambda x: 1 + x**2), ([0.0], [0.0]), 0.25, step=4e-3)
    assert found.at_lower[-1, 0] <= np.tan(0.25) <= found.at_upper[-1, 0]
    assert found.width("x1", 0.25) < 1e-4


def test_a_tube_that_escapes_ends_and_says_where():
    found = reachable(of_one(lambda x: 1 + x**2), ([0.0], [0.0]), 2.0, step=0.07)
    assert 1.1 < found.times[-1] < np.pi / 2
    assert f"beyond {found.times[-1]:.4g} s" in found.why
    assert found.bounds("x1", 0.0, 3.0) == (-np.inf, np.inf)
    with pytest.raises(InputError, match="the tube ends"):
        found.width("x1", 1.9)


def predator():
    x = casadi.SX.sym("x", 2)
    return casadi.Function("f", [x], [casadi.vertcat(x[0] * (1 - x[1]), x[1] * (x[0] - 1))])


@pytest.mark.parametrize("parts", [(), (1, 2)])
def test_simulations_stay_inside_at_all_times(parts):
    f, low, high = predator(), np.array([1.2, 0.9]), np.array([1.3, 1.0])
    found = reachable(f, (low, high), 0.5, step=0.04, parts=parts)
    rng = np.random.default_rng(0)
    for start in rng.uniform(low, high, (6, 2)):
        run = solve_ivp(lambda _, s: np.array(f(s)).ravel(), (0, 0.5), start, rtol=1e-10,
                        atol=1e-12, t_eval=found.times)  # fmt: skip
        assert np.all(found.at_lower <= run.y.T + 1e-8)  # the tolerance of the simulation
        assert np.all(run.y.T <= found.at_upper + 1e-8)
        ends = np.stack([run.y.T[:-1], run.y.T[1:]])
        assert np.all(found.lower <= ends.min(axis=0) + 1e-8)
        assert np.all(ends.max(axis=0) <= found.upper + 1e-8)


def test_more_parts_are_sharper():
    f, box = predator(), ([1.0, 0.7], [1.4, 1.1])
    one = reachable(f, box, 0.25, step=0.07)
    more = reachable(f, box, 0.25, step=0.07, parts=(2, 2))
    assert more.width("x1", 0.25) < one.width("x1", 0.25)


def test_the_flow_of_a_matrix_lies_within_its_bounds():
    mpmath = pytest.importorskip("mpmath")
    rng, h = np.random.default_rng(1), 0.0625
    A = 3 * rng.standard_normal((4, 4))
    E, integral = flow(A, h)
    with mpmath.workdps(40):
        exact = mpmath.expm(mpmath.matrix(A.tolist()) * mpmath.mpf(h), method="taylor")
        inner = (exact - mpmath.eye(4)) * mpmath.inverse(mpmath.matrix(A.tolist()))
        for own, true in ((E, exact), (integral, inner)):
            for i in range(4):
                for j in range(4):
                    miss = abs(true[i, j] - mpmath.mpf(own.middle[i, j]))
                    assert miss <= own.radius[i, j] < 1e-13
    assert E.middle == pytest.approx(expm(A * h), rel=1e-12)


def test_products_of_balls_hold_products_of_what_is_in_them():
    rng = np.random.default_rng(2)
    A, B = (Ball(rng.standard_normal((3, 3)), rng.uniform(size=(3, 3))) for _ in range(2))
    product = A @ B
    for _ in range(50):
        a, b = (own.middle + rng.uniform(-1, 1, (3, 3)) * own.radius for own in (A, B))
        assert np.all(np.abs(a @ b - product.middle) <= product.radius)
    assert np.all(point(A.middle).radius == 0)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((([0.0], [-1.0]), 1.0), {"step": 0.1}, "lower <= upper"),
        ((([0.0], [1.0]), 1.0), {"step": 0.0}, "step"),
        ((([0.0], [1.0]), -1.0), {"step": 0.1}, "horizon"),
        ((([0.0], [1.0]), 1.0), {"step": 0.1, "order": 0}, "order"),
        ((([0.0], [1.0]), 1.0), {"step": 0.1, "parts": (1, 2)}, "parts: expected 1"),
        ((([0.0], [1.0]), 1.0), {"step": 0.1, "states": ("a", "b")}, "1 different names"),
        ((([0.0, 1.0], [1.0, 1.0]), 1.0), {"step": 0.1}, "expected shape"),
    ],
)
def test_other_input_is_refused(arguments, options, message):
    with pytest.raises(InputError, match=message):
        reachable(of_one(lambda x: -x), *arguments, **options)


def test_a_function_of_another_shape_is_refused():
    x = casadi.SX.sym("x", 2)
    f = casadi.Function("f", [x], [x[0]])
    with pytest.raises(InputError, match="of one column each"):
        reachable(f, ([0, 0], [1, 1]), 1.0, step=0.1)


LAUB_LOOMIS = np.array([1.2, 1.05, 1.5, 2.4, 1.0, 0.1, 0.45])


def laub_loomis():
    """Enzymatic activities, ARCH-COMP 2020, benchmark 3.4."""
    x = casadi.SX.sym("x", 7)
    x1, x2, x3, x4, x5, x6, x7 = (x[i] for i in range(7))
    rates = (
        1.4 * x3 - 0.9 * x1,
        2.5 * x5 - 1.5 * x2,
        0.6 * x7 - 0.8 * x2 * x3,
        2 - 1.3 * x3 * x4,
        0.7 * x1 - x4 * x5,
        0.3 * x1 - 3.1 * x6,
        1.8 * x6 - 1.6 * x2 * x7,
    )
    return casadi.Function("laub_loomis", [x], [casadi.vertcat(*rates)])


@pytest.mark.slow
def test_laub_loomis_from_the_smallest_box_stays_below_its_limit():
    box = LAUB_LOOMIS - 0.01, LAUB_LOOMIS + 0.01
    found = reachable(laub_loomis(), box, 20.0, step=0.02)
    assert found.why == ""
    assert found.bounds("x4")[1] < 4.5
    assert found.width("x4", 20.0) < 0.006  # .0042 where it was measured


def quadrotor():
    """A quadrotor that climbs to 1 m, ARCH-COMP 2020, benchmark 3.5."""
    x = casadi.SX.sym("x", 12)
    _, _, x3, x4, x5, x6, x7, x8, x9, x10, x11, x12 = (x[i] for i in range(12))
    g, m, Jx, Jy, Jz = 9.81, 1.4, 0.054, 0.054, 0.104
    F, roll, pitch = m * g - 10 * (x3 - 1) + 3 * x6, -x7 - x10, -x8 - x11
    s7, c7, s8, c8, s9, c9 = sin(x7), cos(x7), sin(x8), cos(x8), sin(x9), cos(x9)
    rates = (
        c8 * c9 * x4 + (s7 * s8 * c9 - c7 * s9) * x5 + (c7 * s8 * c9 + s7 * s9) * x6,
        c8 * s9 * x4 + (s7 * s8 * s9 + c7 * c9) * x5 + (c7 * s8 * s9 - s7 * c9) * x6,
        s8 * x4 - s7 * c8 * x5 - c7 * c8 * x6,
        x12 * x5 - x11 * x6 - g * s8,
        x10 * x6 - x12 * x4 + g * c8 * s7,
        x11 * x4 - x10 * x5 + g * c8 * c7 - F / m,
        x10 + s7 * tan(x8) * x11 + c7 * tan(x8) * x12,
        c7 * x11 - s7 * x12,
        (s7 * x11 + c7 * x12) / c8,
        (Jy - Jz) / Jx * x11 * x12 + roll / Jx,
        (Jz - Jx) / Jy * x10 * x12 + pitch / Jy,
        0,
    )
    return casadi.Function("quadrotor", [x], [casadi.vertcat(*rates)])


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.1, 0.4])
def test_the_quadrotor_keeps_the_limits_of_its_climb(size):
    reach = np.array([size] * 6 + [0.0] * 6)
    found = reachable(quadrotor(), (-reach, reach), 5.0, step=0.016, order=10)
    assert found.why == ""
    assert found.bounds("x3")[1] < 1.4
    assert found.bounds("x3", 1.0)[0] > 0.9
    assert 0.98 < found.at_lower[-1, 2]
    assert found.at_upper[-1, 2] < 1.02
