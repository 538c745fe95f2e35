"""Published and closed-form gains and limits of stability, each from both sides;
docs/checks.md has the table.

Where a number was printed its source stands with the test; where none was, the reference is derived
here and computed by a route that shares nothing with `synthesis`: quadrature, a scalar differential
equation, Floquet theory, mpmath.
"""

import math

import mpmath
import numpy as np
import pytest
from models import constant
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from symheli import LFT, LPVStateSpace, Scheduling
from synthesis import Solver, frozen_gain, l2_gain, lft_gain, stability
from synthesis.analysis import LowerBoundSearch, Status, lft_stability
from synthesis.forms import HigherOrder, Spline
from synthesis.impose import SumOfSquares

COARSE = Spline(segments=4)
GOLDEN = (1 + math.sqrt(5)) / 2
INFLATED = 3e-6
"""gamma is raised by 5e-7 and the solver's gap is about 1e-6."""


def between(A0, A1, B=None, C=None, rate=math.inf, dt=None):
    """x' (or x(k+1)) = ((1 - p) A0 + p A1) x + B u, y = C x, p in [0, 1]; B and C default to the
    unit matrix.
    """
    A0, A1 = np.array(A0, float), np.array(A1, float)
    B = np.eye(len(A0)) if B is None else np.array(B, float)
    C = np.eye(len(A0)) if C is None else np.array(C, float)
    return LPVStateSpace.polynomial(
        [A0, A1 - A0],
        [B],
        [C],
        [np.zeros((len(C), B.shape[1]))],
        Scheduling("p", "1", 0, 1, rate),
        dt=dt,
    )


def oscillator(damping, low, high, rate=math.inf):
    """x'' + damping x' + q x = u, y = x, q in [low, high]; here p = q."""
    A = [[[0, 1], [0, -damping]], [[0, 0], [-1, 0]]]
    return LPVStateSpace.polynomial(
        A, [[[0.0], [1]]], [[[1.0, 0]]], [[[0.0]]], Scheduling("q", "1/s^2", low, high, rate)
    )


def worst_growth(damping, low, high):
    """log |x| gained in half a turn of x'' + damping x' + q x = 0 when q switches between `low` and
    `high` for the worst.

    With x = r cos(theta), x' = r sin(theta) the angle always falls, so the worst q at each angle is
    the one with the larger d log r / d theta, and the state decays for every q(t) exactly where the
    integral over half a turn is negative.
    """

    def slope(theta, q):
        s, c = math.sin(theta), math.cos(theta)
        return ((1 - q) * s * c - damping * s * s) / (s * s + damping * s * c + q * c * c)

    return quad(lambda theta: max(slope(theta, low), slope(theta, high)), 0, math.pi, limit=400)[0]


# x'' + x' + (2 + k p) x = 0, the second-order problem of absolute stability


@pytest.mark.slow
def test_a_constant_p_reaches_the_circle_criterion():
    """Constant P exists up to k = -1/min Re 1/(2 - w^2 + j w) = 1 + 2 sqrt 2 (at 2 - w^2 = -sqrt
    2).

    Printed 3.82: Xie, Shishkin and Fu, "Piecewise Lyapunov functions for robust stability of linear
    time-varying systems", Systems & Control Letters 31 (1997).
    """
    limit = 1 + 2 * math.sqrt(2)
    # 1e-4 of k: the margin by which the solver holds the LMI off
    assert stability(oscillator(1, 2, 2 + limit * (1 - 1e-4))).verify(rigorous=True)
    # just beyond it and far beyond it, by either route, the answer is that there is none, not that
    # the solver failed
    for excess in (1e-4, 0.1):
        beyond = oscillator(1, 2, 2 + limit * (1 + excess))
        for options in ({}, {"form": Spline(degree=0), "impose": SumOfSquares()}):
            assert stability(beyond, **options, search=None).status is Status.INFEASIBLE
        assert l2_gain(beyond, search=None).status is Status.INFEASIBLE


@pytest.mark.slow
def test_a_solver_stopped_early_is_not_taken_for_an_answer():
    """A P exists, 1 % below the limit, but one iteration does not find it: nothing is known."""
    inside, hasty = oscillator(1, 2, 2 + 0.99 * (1 + 2 * math.sqrt(2))), Solver(iterations=1)
    for analysis in (stability, l2_gain):
        for options in ({}, {"form": Spline(degree=0), "impose": SumOfSquares()}):
            assert analysis(inside, **options, solver=hasty, search=None).status is Status.FAILED


@pytest.mark.parametrize("scaling", ["D", "DG"])
def test_one_parameter_that_jumps_costs_no_more_as_a_complex_number(scaling):
    """With h = k/2: |h / (s^2 + s + 2 + h)| peaks at h / sqrt(h + 7/4), which is 1 at h = 1/2 +
    sqrt 2: the same k again.
    """
    limit = 1 + 2 * math.sqrt(2)
    assert lft_stability(
        oscillator(1, 2, 2 + limit * (1 - 1e-4)).to_lft().reduce(), scaling
    ).verified
    assert not lft_stability(
        oscillator(1, 2, 2 + limit * (1 + 1e-4)).to_lft().reduce(), scaling, search=None
    ).verified


@pytest.mark.slow
def test_no_stability_is_proven_beyond_the_worst_switching():
    """k* = 6.985: Margaliot and Langholz, "Necessary and sufficient conditions for absolute
    stability: the case of second-order systems", IEEE Trans. Circuits and Systems I 50 (2003), the
    value quoted with three digits.
    """
    critical = brentq(lambda k: worst_growth(1, 2, 2 + k), 4, 10)
    assert critical == pytest.approx(6.985, abs=5e-4)
    assert not stability(oscillator(1, 2, 2 + critical * 1.001), search=None).verified
    # the growth is 1.0016 a half turn there
    assert stability(oscillator(1, 2, 2 + critical * 1.003)).status is Status.GROWING
    # below k* growth would be a false alarm
    assert stability(oscillator(1, 2, 2 + critical * 0.999)).status is not Status.GROWING


@pytest.mark.slow
def test_a_form_of_degree_six_proves_what_piecewise_quadratic_functions_did():
    """Printed 6.2 for a piecewise quadratic V in Xie, Shishkin and Fu (1997); a V of degree four
    reaches 5.7, short of it.
    """
    six, four = HigherOrder(3), HigherOrder(2)
    assert stability(oscillator(1, 2, 2 + 6.2), form=six).verify(rigorous=True)
    assert stability(oscillator(1, 2, 2 + 5.7), form=four).verify(rigorous=True)
    assert not stability(oscillator(1, 2, 2 + 6.2), form=four, search=None).verified
    # the worst switching, above: no V of any degree
    assert not stability(oscillator(1, 2, 2 + 6.99), form=six, search=None).verified


# Mathieu's and Meissner's equations, x'' + 2 z x' + (1 + e p(t)) x = 0 with |p| <= 1, z = 0.05


def mathieu_multiplier(z, e):
    """Largest Floquet multiplier (modulus) with p = cos 2t, by an independent integrator."""
    M = [
        solve_ivp(
            lambda t, y: [y[1], -2 * z * y[1] - (1 + e * math.cos(2 * t)) * y[0]],
            (0, math.pi),
            start,
            method="DOP853",
            rtol=1e-11,
            atol=1e-13,
        ).y[:, -1]
        for start in ([1, 0], [0, 1])
    ]
    return np.abs(np.linalg.eigvals(np.array(M).T)).max()


@pytest.mark.slow
def test_the_mathieu_equation_is_proven_below_its_first_tongue_and_refused_above():
    """p = cos 2t keeps |dp/dt| <= 2, and its tongue opens at e = 4 z + O(z^2), here 0.2001
    (Floquet).

    Nothing may be proven from there on. A square-shouldered p at the same rate does better than the
    cosine, so that growth is found earlier; slower or smaller p does worse, which is what the proof
    below says.
    """
    z = 0.05
    tongue = brentq(lambda e: mathieu_multiplier(z, e) - 1, 0.1, 0.4)
    assert tongue == pytest.approx(4 * z, rel=z)
    below, above = (
        oscillator(2 * z, 1 - e, 1 + e, rate=2 * e) for e in (0.85 * tongue, 1.001 * tongue)
    )
    assert stability(below).verify(rigorous=True)
    assert stability(above, form=Spline(segments=8)).status is Status.GROWING


@pytest.mark.slow
def test_meissners_equation_limits_what_is_proven_when_p_jumps():
    """Constant P exists for e < 2 z sqrt(1 - z^2), the inverse peak of 1/(s^2 + 2 z s + 1); the
    truth is e = pi z + O(z^2).

    Between the two lies what a quadratic V cannot prove: 36 % at z = 0.05.
    """
    z = 0.05
    quadratic = 2 * z * math.sqrt(1 - z * z)
    truth = brentq(lambda e: worst_growth(2 * z, 1 - e, 1 + e), 0.02, 0.8)
    assert truth == pytest.approx(math.pi * z, rel=z)
    assert stability(oscillator(2 * z, 1 - 0.999 * quadratic, 1 + 0.999 * quadratic)).verified
    for e in (1.001 * quadratic, 1.001 * truth):
        assert not stability(oscillator(2 * z, 1 - e, 1 + e), search=None).verified
    assert (
        stability(oscillator(2 * z, 1 - 1.003 * truth, 1 + 1.003 * truth)).status is Status.GROWING
    )
    # below it growth would be a false alarm
    assert (
        stability(oscillator(2 * z, 1 - 0.999 * truth, 1 + 0.999 * truth)).status
        is not Status.GROWING
    )


# pairs of matrices in discrete time


@pytest.mark.slow
def test_the_pair_of_the_golden_ratio_is_proven_up_to_its_joint_spectral_radius():
    """[1 1; 0 1] and its transpose: both have the norm phi = (1 + sqrt 5)/2, and their product the
    eigenvalue phi^2.

    So the joint spectral radius is phi, P = I proves it, and alternation attains it. Textbook:
    Jungers, "The joint spectral radius", Springer (2009).
    """
    A0, A1 = np.array([[1.0, 1], [0, 1]]), np.array([[1.0, 0], [1, 1]])
    assert stability(between(0.9999 / GOLDEN * A0, 0.9999 / GOLDEN * A1, dt=1.0)).verify(
        rigorous=True
    )
    assert (
        stability(between(1.0001 / GOLDEN * A0, 1.0001 / GOLDEN * A1, dt=1.0)).status
        is Status.GROWING
    )


@pytest.mark.slow
def test_the_gain_of_the_golden_pair_is_that_of_its_alternation():
    """|x(k+1)| <= s phi |x| + |u| gives 1/(1 - s phi); A0 maps its first singular vector onto that
    of A1 and back, so that a slow input along them attains it. s = 0.5: 5.236; no frozen model
    exceeds 4.
    """
    A0, A1 = np.array([[1.0, 1], [0, 1]]), np.array([[1.0, 0], [1, 1]])
    cert = l2_gain(between(0.5 * A0, 0.5 * A1, dt=1.0))
    exact = 1 / (1 - 0.5 * GOLDEN)
    assert exact <= cert.gamma * (1 + 1e-12) <= exact * (1 + INFLATED)
    # a finite input under a window of N samples loses (s phi / (1 - s phi) / N)^2
    assert cert.lower == pytest.approx(exact, rel=5e-3)
    assert cert.frozen == pytest.approx(4.0, rel=1e-6)


def test_a_quadratic_v_loses_a_root_of_two_on_the_pair_of_ando_and_shih():
    """[1 0; 1 0] and [0 1; 0 -1] contract in the largest entry (joint spectral radius 1), yet
    constant P stops at 1/sqrt 2.

    Ando and Shih, "Simultaneous contractibility", SIAM J. Matrix Analysis and Applications 19
    (1998); an example too of Parrilo and Jadbabaie, Linear Algebra and its Applications 428 (2008).
    c e1 e1' <= g^2 P and d e2 e2' <= g^2 P with c, d = p11 +- 2 p12 + p22 add up to g^2 >= 2, with
    equality at P = I.
    """
    A0, A1 = np.array([[1.0, 0], [1, 0]]), np.array([[0.0, 1], [0, -1]])
    assert stability(
        between(0.9999 / math.sqrt(2) * A0, 0.9999 / math.sqrt(2) * A1, dt=1.0)
    ).verify(rigorous=True)
    assert not stability(
        between(1.0001 / math.sqrt(2) * A0, 1.0001 / math.sqrt(2) * A1, dt=1.0),
        search=None,
        form=Spline(degree=0),
    ).verified


# gains in closed form


def scalar(rate):
    """x' = -x + (2 - p) u, y = (1 + p) x, p in [0, 1]: strong input first, strong output later."""
    return LPVStateSpace.polynomial(
        [[[-1.0]]],
        [[[2.0]], [[-1.0]]],
        [[[1.0]], [[1.0]]],
        [[[0.0]]],
        Scheduling("p", "1", 0, 1, rate),
    )


def scalar_gain(rate):
    """The exact gain of `scalar`: the smallest g for which a storage function P(p) x^2 exists.

    It does iff rate |P'| <= h(p, P) = 2 P - (1 + p)^2 - (2 - p)^2 P^2/g^2 on [0, 1], and, P having
    to climb, iff the steepest curve from the upper root of h(0, .) stays where h >= 0.
    """

    def exists(g):
        def h(p, P):
            return 2 * P[0] - (1 + p) ** 2 - ((2 - p) * P[0] / g) ** 2

        def leaves(p, P):
            return h(p, P) + 1e-9

        leaves.terminal = True
        start = g * g / 4 * (1 + math.sqrt(1 - 4 / g**2))
        path = solve_ivp(
            lambda p, P: [h(p, P) / rate],
            (1e-9, 1),
            [start],
            method="LSODA",
            rtol=1e-9,
            atol=1e-12,
            events=leaves,
        )
        return path.t[-1] >= 1

    low, high = 2.25, 2.5
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if exists(middle) else (middle, high)
    return high


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.01, 0.1, 1.0, 10.0])
def test_a_first_order_gain_between_frozen_and_jumping_follows_its_differential_equation(rate):
    exact = scalar_gain(rate)
    cert = l2_gain(scalar(rate), form=Spline(segments=16), search=None)
    # 5e-5: a cubic spline on 16 segments against the exact P(p), which has a corner in its slope
    assert exact <= cert.gamma * (1 + 1e-6) <= exact * (1 + 5e-5)


@pytest.mark.slow
def test_a_first_order_gain_at_its_two_ends_is_known():
    """p frozen: max of (2 - p)(1 + p) = 2.25. p jumps: min over q of max over p of ((2 - p)^2 q^2 +
    (1 + p)^2)/(2 q) = 2.5 at q = 1, attained by one switch: Margaliot and Hespanha,
    "Root-mean-square gains of switched linear systems: a variational approach", IEEE CDC (2007), of
    first-order systems.
    """
    # 5e-5: as above
    assert 2.25 <= l2_gain(scalar(0.0), form=Spline(segments=16)).gamma <= 2.25 * (1 + 5e-5)
    cert = l2_gain(scalar(math.inf), search=None)
    assert 2.5 <= cert.gamma <= 2.5 * (1 + INFLATED)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "share"),
    [(1.0, 0.999), (math.inf, 0.996)],
)
def test_the_lower_bound_of_a_first_order_gain_comes_close_to_its_exact_value(rate, share):
    """All waves grow alike here, so that only their gains can rank them. The shares are what was
    reached, rounded down, however busy the processor is.
    """
    exact = 2.5 if math.isinf(rate) else scalar_gain(rate)
    cert = l2_gain(scalar(rate), form=COARSE, search=LowerBoundSearch(seconds=math.inf))
    assert share < cert.lower / exact <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 1.0, math.inf])
def test_a_gyroscopic_term_does_not_change_the_gain(rate):
    """x' = (-I + w J) x + u, |w| <= 5: |x| does not feel the rotation, so that the gain is 1
    whatever w(t).
    """
    cert = l2_gain(
        between([[-1, -5], [5, -1]], [[-1, 5], [-5, -1]]), rate, form=COARSE, search=None
    )
    assert cert.frozen == pytest.approx(1.0, rel=1e-8)
    assert 1.0 <= cert.gamma <= 1.0 + INFLATED


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 1.0, math.inf])
def test_a_positive_model_has_the_static_gain_of_its_largest_member(rate):
    """x' = [-2 p; 1 -2] x + [1; 1] u, y = x1 + x2: off-diagonal entries grow with p, a diagonal P
    proves p = 1 and with it all others; the gain is 1'[2 -1; -1 2]^-1 1 = 2, at rest (Tanaka and
    Langbort, IEEE Trans. Automatic Control 56 (2011)).
    """
    cert = l2_gain(
        between([[-2, 0], [1, -2]], [[-2, 1], [1, -2]], [[1], [1]], [[1, 1]]),
        rate,
        form=COARSE,
        search=None,
    )
    assert cert.lower == pytest.approx(2.0, rel=1e-7)
    assert 2.0 <= cert.gamma <= 2.0 * (1 + INFLATED)


def test_a_positive_model_of_two_parameters_has_the_static_gain_of_its_largest_member():
    """As above with both off-diagonal entries free in [0, 1], as an LFT."""
    one = {
        (0, 0): np.array([[-2.0, 0], [0, -2]]),
        (1, 0): np.array([[0.0, 1], [0, 0]]),
        (0, 1): np.array([[0.0, 0], [1, 0]]),
    }
    lft = LFT.polynomial(
        one,
        {(0, 0): np.ones((2, 1))},
        {(0, 0): np.ones((1, 2))},
        {(0, 0): np.zeros((1, 1))},
        [Scheduling("p", "1", 0, 1, math.inf), Scheduling("q", "1", 0, 1, math.inf)],
    ).reduce()
    cert = lft_gain(lft, "full block", search=None)
    assert cert.lower == pytest.approx(2.0, rel=1e-7)
    # 1e-5: the multiplier's own margin
    assert 2.0 <= cert.gamma <= 2.0 * (1 + 1e-5)


def commutator(rate):
    """p G - G p with G = 1/(s + 1), |p| <= 1: zero for every frozen p."""
    return LPVStateSpace.polynomial(
        [-np.eye(2)],
        [[[1.0], [0]], [[0.0], [1]]],
        [[[0.0, -1]], [[1.0, 0]]],
        [[[0.0]]],
        Scheduling("p", "1", -1, 1, rate),
    )


@pytest.mark.slow
def test_swapping_a_lag_and_its_gain_costs_no_more_than_the_rate():
    """p G u - G (p u) = G (p' G u), at most the rate; printed "on the order of 20 %" at 0.2.

    The manual of LPVTools (example "LPV Analysis"), from Peni and Seiler, "Computation of lower
    bounds for the induced L2 norm of LPV systems", American Control Conference (2015).
    """
    rate = 0.2
    cert = l2_gain(commutator(rate))
    assert cert.frozen == pytest.approx(0.0, abs=1e-12)
    assert 0.92 * rate < cert.lower < cert.gamma < rate
    assert round(cert.lower, 1) == round(cert.gamma, 1) == 0.2


@pytest.mark.slow
def test_the_discrete_norm_of_the_manual_comes_back():
    """Documentation of `norm` in MATLAB's Control System and System Identification Toolboxes:
    2.5721 at 3.0178 rad/s.

    The gain agrees to its last digit. The frequency does not: the peak is at 3.0157, where the
    response is so flat that at 3.0178 it rounds to the same gain.
    """
    numerator, denominator = [1, -2.841, 2.875, -1.004], [1, -2.417, 2.003, -0.5488]
    remainder = np.array(numerator[1:]) - np.array(denominator[1:])
    A = np.vstack([-np.array(denominator[1:]), np.eye(3)[:2]])
    lpv = constant(A, [[1.0], [0], [0]], [remainder], [[1.0]], dt=0.1)
    found = frozen_gain(lpv)
    # half a unit of the last digit printed
    assert found.gain == pytest.approx(2.5721, abs=5e-5)
    at_printed = abs(
        np.polyval(numerator, np.exp(0.30178j)) / np.polyval(denominator, np.exp(0.30178j))
    )
    assert 2.57205 <= at_printed <= found.gain
    assert l2_gain(lpv, form=COARSE, search=None).gamma == pytest.approx(found.gain, rel=1e-4)


@pytest.mark.slow
def test_a_time_invariant_gain_agrees_with_thirty_digits():
    """1/((s + 1)(s^2 + 0.02 s + 1)(s^2 + 0.06 s + 4)): the peak from d|G|^2/dw = 0 in mpmath."""
    denominator = np.polymul([1, 1], np.polymul([1, 0.02, 1], [1, 0.06, 4]))
    with mpmath.workdps(30):
        size = lambda w: 1 / abs(mpmath.polyval([mpmath.mpf(c) for c in denominator], 1j * w))  # noqa: E731
        exact = float(
            size(mpmath.findroot(lambda w: mpmath.diff(size, w), (0.99, 1.01), solver="anderson"))
        )
    A = np.vstack([-denominator[1:], np.eye(5)[:4]])
    lpv = constant(A, np.eye(5)[:, :1], np.eye(5)[4:], [[0.0]])
    assert frozen_gain(lpv).gain == pytest.approx(exact, rel=1e-8)
    cert = l2_gain(lpv, 0.0, form=COARSE, search=None)
    # the frozen norm is computed from below, gamma from above; 2e-4: on a resonance of quality 50
    # the solver stops before its tolerance, and gamma is what the P it left admits
    assert exact * (1 - 1e-8) <= cert.gamma <= exact * (1 + 2e-4)
