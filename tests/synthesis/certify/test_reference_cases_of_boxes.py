"""Closed forms of energy-to-peak gains and of two parameters, each from both sides; rows of
docs/checks.md.

The references are derived here, by quadrature or by sums that share nothing with `synthesis`.
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from test_reference_cases import GOLDEN, INFLATED, between, oscillator, scalar

from symheli import LPVStateSpace, Scheduling
from synthesis import l2_gain, stability
from synthesis.analysis import LowerBoundSearch, Status, energy_to_peak
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares

QUICK = LowerBoundSearch(
    levels=4, dwells=5, starts=1, nodes=40, evaluations=12, steps=120, samples=20_000
)


def square(A, B, C, rate, dt=None):
    """A model of p and q in [0, 1] at the same rate, from monomials."""
    parameters = [Scheduling(name, "1", 0.0, 1.0, rate) for name in ("p", "q")]
    return LPVStateSpace.polynomial(A, B, C, {(0, 0): [[0.0]]}, parameters, dt)


# energy to peak: max |y| over inputs of unit energy


def peak_of_scalar(rate):
    """`scalar`, x' = -x + (2 - p) u, y = (1 + p) x: y(T)^2 <= (1 + p(T))^2 X(T), X(T) the integral
    of exp(-2 s) (2 - p(T - s))^2.

    For each p(T) the integral is largest where p was as small as the rate allows, p(T - s) = max(0,
    p(T) - rate s), at every s at once.
    """

    def peak(end):
        corner = [end / rate] if 0 < end / rate < 40 else None
        return (1 + end) * math.sqrt(
            quad(
                lambda s: math.exp(-2 * s) * (2 - max(0.0, end - rate * s)) ** 2,
                0,
                40,
                points=corner,
                limit=400,
            )[0]
        )

    inside = minimize_scalar(
        lambda end: -peak(end), bounds=(0, 1), method="bounded", options={"xatol": 1e-9}
    )
    return max(-float(inside.fun), peak(1.0))


@pytest.mark.slow(but="inf-3e-06-0.01")
@pytest.mark.parametrize(
    ("rate", "above", "below"),
    [(0.1, 2e-3, 1e-2), (1.0, 2e-3, 6e-3), (10.0, 1e-3, 1.2e-2), (math.inf, INFLATED, 1e-2)],
)
def test_the_peak_of_a_first_order_model_lies_between_its_bounds(rate, above, below):
    """From 2.25/sqrt 2 frozen to the best input times the best output, 2 * 2/sqrt 2, where p may
    jump.
    """
    exact = {0.0: 2.25 / math.sqrt(2), math.inf: 2 * math.sqrt(2)}.get(rate) or peak_of_scalar(rate)
    cert = energy_to_peak(scalar(rate), form=Spline(segments=16))
    assert cert.frozen == pytest.approx(2.25 / math.sqrt(2), rel=1e-8)
    # `above`: the degree of P; `below`: how near the waves looked at come. Both are what was
    # reached, rounded up
    assert exact * (1 - below) <= cert.lower <= exact * (1 + 1e-9)
    assert exact * (1 - 1e-9) <= cert.gamma <= exact * (1 + above)


@pytest.mark.slow(but="0.0")
@pytest.mark.parametrize("rate", [0.0, 1.0, math.inf])
def test_a_gyroscopic_term_does_not_change_the_peak(rate):
    """x' = (-I + w J) x + u, |w| <= 5: the Gramian is I/2 whatever w(t), so that the peak of |x| is
    1/sqrt 2.
    """
    cert = energy_to_peak(
        between([[-1, -5], [5, -1]], [[-1, 5], [-5, -1]]),
        rate,
        form=Spline(degree=1, segments=2),
        search=QUICK,
    )
    assert cert.lower == pytest.approx(math.sqrt(0.5), rel=1e-8)
    assert math.sqrt(0.5) <= cert.gamma <= math.sqrt(0.5) * (1 + INFLATED)


def test_the_peak_of_a_frozen_oscillator_is_that_of_its_gramian():
    """x'' + d x' + q x = u: X = diag(1/(2 d q), 1/(2 d)), so that y = x has the peak 1/sqrt(2 d q),
    largest at the smallest q.
    """
    exact = 1 / math.sqrt(2 * 0.4 * 0.5)
    cert = energy_to_peak(oscillator(0.4, 0.5, 2.0), 0.0, form=Spline(segments=8))
    assert cert.frozen == cert.lower == pytest.approx(exact, rel=1e-8)
    # a cubic P on eight segments: what was reached, rounded up
    assert exact <= cert.gamma <= exact * (1 + 1e-3)


def discrete(rate):
    """x(k+1) = x/2 + (2 - p) u, y = (1 + p) x, p in [0, 1]."""
    return LPVStateSpace.polynomial(
        [[[0.5]]],
        [[[2.0]], [[-1.0]]],
        [[[1.0]], [[1.0]]],
        [[[0.0]]],
        Scheduling("p", "1", 0, 1, rate),
        dt=1.0,
    )


@pytest.mark.slow(but="inf-3e-06-1e-09")
@pytest.mark.parametrize(
    ("rate", "above", "below"), [(0.3, 1e-2, 4e-2), (math.inf, INFLATED, 1e-9)]
)
def test_the_peak_of_a_sampled_first_order_model_lies_between_its_bounds(rate, above, below):
    """As above with sums for integrals: the sum over j >= 1 of 4^(1 - j) (2 - p(k - j))^2; where p
    may jump, 4/sqrt(3/4).
    """
    if math.isinf(rate):
        exact = 4 / math.sqrt(0.75)
    else:
        ends = np.linspace(0, 1, 20001)
        sums = sum(
            0.25 ** (j - 1) * (2 - np.maximum(0, ends - rate * j)) ** 2 for j in range(1, 60)
        )
        exact = float(((1 + ends) * np.sqrt(sums)).max())
    cert = energy_to_peak(discrete(rate), search=QUICK)
    assert cert.frozen == pytest.approx(2.25 / math.sqrt(0.75), rel=1e-8)
    # what was reached, rounded up
    assert exact * (1 - below) <= cert.lower <= exact * (1 + 1e-9)
    assert exact * (1 - 1e-9) <= cert.gamma <= exact * (1 + above)


# two parameters


def product_peak(rate):
    """`peak_of_scalar` with the input (2 - p)(2 - q) and the output (1 + p)(1 + q): both were as
    small as they could be.
    """

    def peak(p, q):
        def integrand(s):
            return (
                math.exp(-2 * s)
                * ((2 - max(0.0, p - rate * s)) * (2 - max(0.0, q - rate * s))) ** 2
            )

        return (
            (1 + p)
            * (1 + q)
            * math.sqrt(quad(integrand, 0, 40, points=[p / rate, q / rate], limit=400)[0])
        )

    ends = np.linspace(0.05, 1, 20)
    return max(peak(p, q) for p in ends for q in ends if q <= p)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [1.0, math.inf])
def test_the_peak_of_two_parameters_lies_between_its_bounds(rate):
    """p and q at the same rate: 3.58 frozen, 6.75 at a rate of 1 (with p = q = 1 at the end),
    16/sqrt 2 where they jump.
    """
    B = {(0, 0): [[4.0]], (1, 0): [[-2.0]], (0, 1): [[-2.0]], (1, 1): [[1.0]]}
    C = {(0, 0): [[1.0]], (1, 0): [[1.0]], (0, 1): [[1.0]], (1, 1): [[1.0]]}
    exact = 16 / math.sqrt(2) if math.isinf(rate) else product_peak(rate)
    cert = energy_to_peak(
        square({(0, 0): [[-1.0]]}, B, C, rate), impose=SumOfSquares(), search=QUICK
    )
    assert cert.frozen == pytest.approx(2.25**2 / math.sqrt(2), rel=1e-7)
    # from below the waves along the diagonal, from above a P of degree two: what was reached,
    # rounded up
    assert exact * (1 - 1e-2) <= cert.lower <= exact * (1 + 1e-9)
    assert (
        exact * (1 - 1e-9) <= cert.gamma <= exact * (1 + (INFLATED if math.isinf(rate) else 2e-3))
    )


def product():
    """x' = -x + (2 - p q) u, y = (1 + p q) x: p q takes all values in [0, 1], so that it is
    `scalar` at both ends of the rate.
    """
    return square(
        {(0, 0): [[-1.0]]},
        {(0, 0): [[2.0]], (1, 1): [[-1.0]]},
        {(0, 0): [[1.0]], (1, 1): [[1.0]]},
        math.inf,
    )


@pytest.mark.slow
def test_a_first_order_gain_in_the_product_of_two_parameters_is_known():
    """2.25 frozen and 2.5 where they jump, as in test_reference_cases."""
    frozen = l2_gain(product(), 0.0, impose=SumOfSquares())
    assert 2.25 * (1 - 1e-7) <= frozen.lower <= frozen.gamma <= 2.25 * (1 + INFLATED)
    cert = l2_gain(product(), search=None)
    assert cert.frozen == pytest.approx(2.25, rel=1e-7)
    assert 2.5 <= cert.gamma <= 2.5 * (1 + INFLATED)


@pytest.mark.slow
def test_the_lower_bound_in_the_product_of_two_parameters_comes_close():
    # what was reached, rounded down
    assert 2.5 * (1 - 1.5e-2) <= l2_gain(product(), search=QUICK).lower <= 2.5


def golden(s):
    """x(k+1) = s [1 a; b 1] x + u, a and b in [0, 1] each for itself, y = x."""
    A = {
        (0, 0): np.array([[s, 0], [0, s]]),
        (1, 0): np.array([[0, s], [0, 0]]),
        (0, 1): np.array([[0, 0], [s, 0]]),
    }
    parameters = [Scheduling(name, "1", 0.0, 1.0, math.inf) for name in ("a", "b")]
    eye = {(0, 0): np.eye(2)}
    return LPVStateSpace.polynomial(A, eye, eye, {(0, 0): np.zeros((2, 2))}, parameters, dt=1.0)


@pytest.mark.slow
def test_two_entries_that_jump_are_proven_up_to_their_joint_spectral_radius():
    """All entries grow with a and b, so that a = b = 1 is the worst: [1 1; 1 1] has the norm and
    the spectral radius 2.

    The gain of s times it is 1/(1 - 2 s), at rest along (1, 1). The golden pair, in which a + b =
    1, stops at phi instead.
    """
    assert stability(golden(0.4999)).verify(rigorous=True)
    assert stability(golden(0.5001)).status is Status.UNSTABLE
    # s = 0.5 is well within 1/phi: what one parameter proves, two free ones must not
    assert 0.5 < 1 / GOLDEN
    cert = l2_gain(golden(0.25), search=QUICK)
    assert 2.0 * (1 - 1e-7) <= cert.lower <= cert.gamma <= 2.0 * (1 + INFLATED)
