"""The worst-case example of LPVTools' documentation: an uncertain gain behind a delay, under PI
control that follows the parameter.
"""

import math

import pytest
import sympy

from symheli import LPVStateSpace, Scheduling, UncertainStateSpace
from symheli.lpv import Polynomial
from synthesis import l2_gain
from synthesis.analysis import LowerBoundSearch
from synthesis.robust import DynamicBlock
from synthesis.robust.uncertain import uncertain

DEGREE = 10
"""Of the polynomials in place of roots and quotients."""


def loop():
    """The error e = r - y of the loop, with the uncertain gain of the plant's input u left open.

    States: the lag 1/(tau s + 1), behind it K; the integral of the controller; the delay of .5 s by
    Pade's approximation of order two.
    """
    p = Scheduling("p", "1", low=2.0, high=7.0, rate=0.1)
    tau, K, wait = sympy.sqrt(133.6 - 16.8 * p.symbol), sympy.sqrt(4.8 * p.symbol - 8.6), 0.5
    Kp, Ki = (2 * 0.7 * 0.25 * tau - 1) / K, 0.25**2 * tau / K
    whole = LPVStateSpace.from_expressions(
        [
            [-(1 + Kp * K) / tau, 1 / tau, 0, -12 / wait / tau],
            [-Ki * K, 0, 0, 0],
            [0, 0, 0, 1],
            [-Kp * K, 1, -12 / wait**2, -6 / wait],
        ],
        [[Kp / tau, 1 / tau], [Ki, 0], [0, 0], [Kp, 1]],
        [[-K, 0, 0, 0], [-Kp * K, 1, 0, 0]],
        [[1, 0], [Kp, 0]],
        p,
        inputs=["r", "d"],
        outputs=["e", "u"],
    ).fitted(Polynomial(DEGREE, 2.0, 7.0))
    return UncertainStateSpace(whole, ["d"], ["u"], 0.1, 1.0, "the page on lpvwcgain")


@pytest.mark.slow
def test_one_model_of_the_set_has_the_gain_that_the_page_prints():
    """20.1476, for speeds without a bound, at the worst constant perturbation."""
    cert = l2_gain(loop().perturbed([[0.1]]), math.inf, search=None)
    assert cert.gamma == pytest.approx(20.1476, rel=1e-2)  # of polynomials of degree 10


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "printed", "known"), [(math.inf, 63.8659, 38), (0.1, 1.8925, 1.5)]
)
def test_the_bound_is_below_what_the_page_prints(rate, printed, known):
    cert = l2_gain(loop(), rate, search=LowerBoundSearch(seconds=2))
    assert cert.verified
    assert cert.lower <= cert.gamma <= known < printed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate", "printed", "known"), [(math.inf, 63.8659, 63.7), (0.1, 1.8925, 2.08)]
)
def test_the_bound_for_dynamics_beside_what_the_page_prints(rate, printed, known):
    """The page has multipliers that depend on frequency, on a grid: less than one number at .1."""
    given = loop()
    dynamics = uncertain(given.model, [DynamicBlock("d", "u", 0.1)])
    cert = l2_gain(dynamics, rate, search=None)
    assert cert.verified
    assert cert.gamma == pytest.approx(known, rel=5e-3)
    assert 0.99 * printed < cert.gamma < 1.1 * printed
    moving = l2_gain(given, rate, search=None)
    assert moving.gamma < cert.gamma
