"""A delay and a servo that are not known as blocks: covered at every frequency, never exceeded."""

import math
from fractions import Fraction

import control
import numpy as np
import pytest
import sympy
from scipy.optimize import brentq

import symheli
from symheli.errors import InputError
from synthesis.robust import DynamicBlock, covers, robust_margin, worst_case_gain

OMEGA = np.geomspace(1e-2, 1e4, 4001)
SAME = 1 + 1e-9
"""Rounding of a response."""


def size(block, omega=OMEGA):
    return np.abs(block.weight.frequency_response(omega).ravel())


def lag_behind_a_gain(dt=None):
    """x' = -x - d, v = x: the integrator 1/s behind a gain of -1, broken where d is added."""
    model = symheli.LinearModel(
        [[-1.0]], [[-1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)), ["x"], ["d", "r"], ["v", "y"]
    )
    still = symheli.Scheduling("still", "1", 0.0, 1.0, rate=0.0)
    return symheli.LPVStateSpace.constant(model if dt is None else model.discretize(dt), still)


def test_the_weight_of_a_delay_is_above_its_error_in_exact_arithmetic():
    """With t = (omega T)^2: 2 - 2 cos sqrt(t) is below the Taylor sum that ends on a positive term,
    and below 4. Sturm sequences show that N - D times either has no root where it is used.
    """
    t = sympy.Symbol("t")
    c, zeros, poles = (
        sympy.Rational(v.numerator, v.denominator)
        for v in (covers.CORNER, covers.ZEROS, covers.POLES)
    )
    N = sympy.Poly(4 * t * ((1 - t / c**2) ** 2 + 4 * zeros**2 * t / c**2), t)
    D = sympy.Poly((4 + t) * ((1 - t / c**2) ** 2 + 4 * poles**2 * t / c**2), t)
    taylor = sum((-1) ** k * 2 * t ** (k + 1) / sympy.factorial(2 * k + 2) for k in range(7))
    low, rest = sympy.Poly(N - D * sympy.Poly(taylor, t)).terms_gcd()
    assert low == (2,)
    assert rest.eval(0) > 0
    assert rest.count_roots(0, sympy.Rational(987, 100)) == 0  # 9.87 > pi^2
    beyond = N - 4 * D
    assert beyond.eval(sympy.Rational(986, 100)) > 0  # 9.86 < pi^2
    assert beyond.count_roots(sympy.Rational(986, 100), None) == 0
    # what is returned is N/D
    W = DynamicBlock.of_delay("d", "v", 0.02)
    exact = [float(N.eval(Fraction(x)) / D.eval(Fraction(x))) for x in (0.01, 1.0, 30.0)]
    assert size(W, np.sqrt([0.01, 1.0, 30.0]) / 0.02) ** 2 == pytest.approx(exact, rel=1e-11)


def test_no_delay_exceeds_its_weight_which_is_close():
    W = size(DynamicBlock.of_delay("d", "v", 0.02))
    worst = np.zeros(len(OMEGA))
    for T in np.linspace(0.0, 0.02, 201)[1:]:
        worst = np.maximum(worst, np.abs(np.exp(-1j * OMEGA * T) - 1))
    assert np.all(worst <= W * SAME)
    assert (W / worst).max() < 1.03  # 2.1 % above the largest error, and 201 delays


def servo(b, z):
    s = 1j * OMEGA
    return b / (s + b) if z is None else b * b / (s * s + 2 * z * b * s + b * b)


@pytest.mark.parametrize(
    ("bandwidth", "damping", "nominal", "close"),
    [
        ((30.0, 42.0), None, None, 1 + 1e-6),  # the slowest lag itself
        ((30.0, 42.0), None, 33.0, 1.5),
        ((30.0, 42.0), (0.4, 0.8), None, 1.25),
        ((30.0, 42.0), (0.4, 0.8), (34.0, 0.5), 1.4),
        ((35.0, 37.0), (0.05, 0.07), None, 1.6),
    ],
)
def test_no_servo_exceeds_its_weight_which_is_close(bandwidth, damping, nominal, close):
    block = DynamicBlock.of_servo("d", "v", bandwidth, damping, nominal=nominal)
    b0, z0 = nominal if isinstance(nominal, tuple) else (nominal or np.mean(bandwidth), None)
    if damping is not None and z0 is None:
        z0 = np.mean(damping)
    worst = np.zeros(len(OMEGA))
    for b in np.linspace(*bandwidth, 21):
        for z in [None] if damping is None else np.linspace(*damping, 21):
            worst = np.maximum(worst, np.abs(servo(b, z) / servo(b0, z0) - 1))
    assert np.all(worst <= size(block) * SAME)
    assert (size(block) / worst).max() < close


def test_the_delay_that_an_integrator_bears():
    """Lost at pi/2 s; whatever the phase, where 2 sin(omega T/2) is the inverse of |1/(j omega +
    1)| somewhere. The weight is 2.1 % above it and the margin proven to .2 %.
    """

    def most(T):
        omega = np.linspace(0.0, math.pi / T, 2001)
        return (2 * np.sin(omega * T / 2) / np.hypot(1, omega)).max() - 1

    limit = float(brentq(most, 0.5, 3.0))
    assert limit < math.pi / 2
    borne = robust_margin(lag_behind_a_gain(), [DynamicBlock.of_delay("d", "v", 0.96 * limit)])
    assert borne.lower > 1
    lost = robust_margin(lag_behind_a_gain(), [DynamicBlock.of_delay("d", "v", 1.01 * limit)])
    assert lost.upper < 1
    # closed by what is returned: of the size of the weight, times the margin
    M = -1 / (1j * lost.omega + 1)
    assert abs(1 - M * lost.perturbation.item()) < 1e-4
    block = DynamicBlock.of_delay("d", "v", 1.01 * limit)
    size_there = size(block, np.array([lost.omega])).item()
    assert abs(lost.perturbation.item()) == pytest.approx(lost.upper * size_there, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, 0.1])
def test_no_late_loop_exceeds_the_worst_gain(dt):
    model = lag_behind_a_gain(dt)
    found = worst_case_gain(model, [DynamicBlock.of_delay("d", "v", 0.8)])
    z = 1j * OMEGA if dt is None else np.exp(1j * OMEGA[OMEGA < math.pi / dt] * dt)
    omega = OMEGA[: len(z)]
    one = model.at(0.0)
    F = one.C @ np.linalg.solve(z[:, None, None] * np.eye(1) - one.A, one.B[None]) + one.D
    gains = []
    for T in np.linspace(0.0, 0.8, 9):
        late = np.exp(-1j * omega * T) - 1
        gains.append(np.abs(F[:, 1, 1] + F[:, 1, 0] * late / (1 - F[:, 0, 0] * late) * F[:, 0, 1]))
    assert 1.0 < np.max(gains) <= found.upper
    assert found.lower <= found.upper < 1.5 * np.max(gains)


def test_a_weight_of_ones_own_is_a_bound_over_frequency():
    """A gain of 2 at low frequencies, .02 at high ones, as a transfer function or a model."""
    W = control.tf([0.01, 1.0], [0.5, 0.5])
    given = robust_margin(lag_behind_a_gain(), [DynamicBlock("d", "v", 1.0, W)])
    # |W/(j omega + 1)| is largest at rest: 2
    assert given.upper == pytest.approx(0.5, rel=1e-4)
    assert given.lower == pytest.approx(0.5, rel=2e-3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: DynamicBlock.of_delay("d", "v", 0.0), "delay > 0"),
        (lambda: DynamicBlock.of_delay("d", "v", True), "delay > 0"),
        (lambda: DynamicBlock.of_delay(["d", "e"], "v", 0.1), "an output for each input"),
        (lambda: DynamicBlock.of_servo("d", "v", (3.0, 2.0)), "bandwidth: expected"),
        (lambda: DynamicBlock.of_servo("d", "v", 3.0), "bandwidth: expected"),
        (lambda: DynamicBlock.of_servo("d", "v", (2.0, 3.0), (0.0, 1.0)), "damping: expected"),
        (lambda: DynamicBlock.of_servo("d", "v", (2.0, 3.0), nominal=(1, 2, 3)), "nominal"),
        (lambda: DynamicBlock("d", "v", 1.0, control.tf([1.0], [1.0, -1.0])), "stable one"),
        (lambda: DynamicBlock("d", "v", 1.0, "fast"), "the weight of v"),
        (
            lambda: DynamicBlock("d", "v", 1.0, control.tf([1.0], [1.0, 0.5], 0.1)),
            "sampled as the model is",
        ),
    ],
)
def test_bad_input_is_refused_in_words(make, words):
    with pytest.raises(InputError, match=words):
        robust_margin(lag_behind_a_gain(), [make()])
