"""With p a function of the state, and about trims, an LPV model moves as the nonlinear equations
that it stands for.
"""

from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv.tools import TrimSchedule, simulate

EXACT = {"rtol": 1e-11, "atol": 1e-12}
CLOSE = {"rtol": 0, "atol": 1e-7}
"""Local errors of 1e-9 in some tens of steps; the states are of order one."""

X1 = Scheduling("x1", "1", low=-3.0, high=3.0)
VAN_DER_POL = LPVStateSpace.from_expressions(
    [[0, 1], [-1, 1 - X1.symbol**2]], [[0], [1]], [[1, 0]], [[0]], X1
)
LEVEL = Scheduling("level", "m", low=0.1, high=2.0)
h = LEVEL.symbol
TANK = LPVStateSpace.from_expressions(
    [[-1 / (2 * sympy.sqrt(h))]], [[1]], [[1 / (2 * sympy.sqrt(h))]], [[0]], LEVEL
)
"""dh/dt = u - sqrt(h), y = sqrt(h), linearized at rest at each level."""


def held(f, u, x0, dt):
    """The exact response to an input held between samples."""
    x = [np.array(x0, float)]
    for k in range(len(u) - 1):
        x.append(solve_ivp(f, (k * dt, k * dt + dt), x[-1], args=(u[k],), **EXACT).y[:, -1])
    return np.array(x)


@pytest.mark.parametrize("convert", [lambda lpv: lpv, LPVStateSpace.to_lft])
def test_van_der_pol_is_its_equation(convert):
    model, u = convert(VAN_DER_POL), 0.3 * np.sin(np.arange(20.0))[:, None]

    def oscillator(t, x, u):
        return [x[1], (1 - x[0] ** 2) * x[1] - x[0] + u[0]]

    x, y = model.simulate(lambda t, x, u: x[0], u, [1.0, 0.0], dt=0.1)
    np.testing.assert_allclose(x, held(oscillator, u, [1.0, 0.0], 0.1), **CLOSE)
    np.testing.assert_array_equal(y, x[:, :1])


def test_the_missile_of_lim_and_how_with_its_mach_number_and_angle_of_attack():
    """Lim and How (2003): p is the Mach number, given over time, and the angle of attack, a
    state.
    """
    mach = Scheduling("M", "1", low=2.0, high=4.0, rate=1.5)
    angle = Scheduling("alpha", "deg", low=-20.0, high=20.0)

    def matrices(M, a, cos, size):
        f1 = (1e-4 * a**2 - 0.0112 * size(a) - 0.2010 * (2 - M / 3)) * M * cos(a * np.pi / 180)
        f2 = (0.0152 * a**2 - 1.3765 * size(a) + 3.6001 * (-7 + 8 * M / 3)) * M**2
        f3 = -0.0403 * M * cos(a * np.pi / 180)
        return [[f1, 1], [f2, 0]], [[f3], [-14.542 * M**2]]

    A, B = matrices(mach.symbol, angle.symbol, sympy.cos, sympy.Abs)
    model = LPVStateSpace.from_expressions(A, B, [[0, 1]], [[0]], [mach, angle])

    def speed(t):
        return 3 + np.sin(t)

    def missile(t, x, u):
        A, B = matrices(speed(t), x[0], np.cos, abs)
        return np.array(A) @ x + np.array(B) @ u

    u = -2.0 * np.cos(0.5 * np.arange(10.0))[:, None]
    found, _ = model.simulate(lambda t, x, u: [speed(t), x[0]], u, [3.0, 0.0], dt=0.05)
    exact = held(missile, u, [3.0, 0.0], 0.05)
    assert np.ptp(exact[:, 0]) > 1.0  # deg
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-6)  # rates of 100 deg/s


def test_about_its_trims_a_model_is_the_equation_it_was_linearized_from():
    """With p the only nonlinear state the deviation x - x0(p) is zero and nothing is lost."""
    root = sympy.sqrt(h)
    for y in (None, [root]):
        trim = TrimSchedule.from_expressions([h], [root], LEVEL, y=y)
        model, u = replace(TANK, trim=trim), 0.8 + 0.4 * np.sin(0.7 * np.arange(12.0))[:, None]
        x, out = model.simulate(lambda t, x, u: x[0], u, [0.5], dt=0.2, offsets=True)
        exact = held(lambda t, x, u: u - np.sqrt(x), u, [0.5], 0.2)
        np.testing.assert_allclose(x, exact, **CLOSE)
        # without y0 the output is C(p) x, half of sqrt(h)
        expected = np.sqrt(exact) if y else 0.5 * np.sqrt(exact)
        np.testing.assert_allclose(out, expected, **CLOSE)


def test_whole_values_along_a_history_are_the_deviations_about_a_moving_trim():
    """x0(p) + dx with the drift -dx0/dp dp/dt is the same response, to the first order of the
    sample period, with which p is held; trims that move by themselves (xdot0) enter both alike.
    """
    trim = TrimSchedule.from_expressions([h], [sympy.sqrt(h)], LEVEL, xdot=[0.1 * h])
    model, rate = replace(TANK, trim=trim), 0.3
    off = []
    for n in (100, 200):
        dt = 4.0 / n
        p = 0.2 + rate * dt * np.arange(n)
        u0 = trim.input(p)
        dx, _ = model.simulate(p, 0 * u0, dt=dt, drift=trim.drift(p, np.full(n, rate)))
        x, _ = model.simulate(p, u0, dt=dt, offsets=True)
        off.append(np.abs(x - trim.state(p) - dx).max())
    assert off[0] < 4e-2
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.1)


def test_a_sampled_model_takes_its_own_state_and_a_trim_kept_by_select():
    rho = Scheduling("rho", "1", low=0.0, high=1.0)
    p = rho.symbol
    map_ = LPVStateSpace.from_expressions([[3.6 * (1 - p)]], [[1]], [[1]], [[0]], rho, dt=1.0)
    x, _ = map_.simulate(lambda t, x, u: x[0], np.zeros((30, 1)), [0.3])
    expected = [0.3]
    for _ in range(29):
        expected.append(3.6 * expected[-1] * (1 - expected[-1]))
    np.testing.assert_allclose(x[:, 0], expected, rtol=1e-9)
    kept = replace(TANK, trim=TrimSchedule.from_expressions([h], [1], LEVEL, y=[h])).select()
    np.testing.assert_allclose(kept.trim.output(0.7), [0.7])


@pytest.mark.parametrize(
    ("schedule", "message"),
    [
        (lambda t, x, u: x[0], r"x1 = 3\.\d+ at t = \d\.\d+ s, but the model holds on"),
        (lambda t, x, u: [x[0], 0], r"expected 1 finite number"),
        (lambda t, x, u: np.nan, r"expected 1 finite number.* at t = 0 s"),
    ],
)
def test_p_outside_its_range_is_refused_with_time_and_value(schedule, message):
    with pytest.raises(InputError, match=message):
        simulate(VAN_DER_POL, schedule, np.full((50, 1), 5.0), dt=0.1)


def test_offsets_need_a_trim():
    with pytest.raises(InputError, match="offsets: the model has no trim"):
        simulate(TANK, np.ones(3), np.ones((3, 1)), dt=0.1, offsets=True)
