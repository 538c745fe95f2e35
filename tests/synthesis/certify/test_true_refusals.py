"""What is refused is refused for the reason that is given, and what one relaxation proves no other
calls impossible.
"""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag

from symheli import LPVStateSpace, Scheduling
from synthesis import decay_rate, l2_gain, stability
from synthesis.analysis import Status
from synthesis.forms import Spline
from synthesis.impose import Bernstein, SumOfSquares, Vertices

POLYTOPE = {
    (0, 0): [[0.9783, 0.0829, 0], [-0.4344, 0.6594, 0], [-6.71, -5.1386, -0.0002]],
    (1, 0): [[0.0002, -0.0012, 0], [0.0058, -0.022, 0], [0, 0, 0]],
    (0, 1): [[-0.0151, -0.0115, 0], [-0.3007, -0.2303, 0], [0, 0, 0]],
    (1, 1): [[0.0001, 0.0001, 0], [0.004, 0.0031, 0], [0, 0, 0]],
}
"""A(a, b) of the pitch axis of a helicopter, sampled: a constant P exists."""
CHANNELS = (
    ([[0.0], [0.0], [0.0]], np.eye(1, 3)),
    (
        [[0.012], [0.239], [0.0]],
        [[6.3246, 0, 0], [0, 2.2361, 0], [-15.0039, -11.4904, -2.2366]],
    ),
)


@pytest.mark.parametrize(("B", "C"), CHANNELS, ids=["no channels", "scaled channels"])
@pytest.mark.parametrize("impose", [Vertices(), Bernstein()], ids=lambda i: type(i).__name__)
def test_stability_does_not_depend_on_channels_or_relaxation(B, C, impose):
    a, b = (Scheduling(name, "1", 0.0, 1.0) for name in "ab")
    D = np.zeros((len(C), 1))
    model = LPVStateSpace.polynomial(
        POLYTOPE, {(0, 0): B}, {(0, 0): C}, {(0, 0): D}, [a, b], dt=0.1
    )
    cert = stability(model, math.inf, impose=impose, search=None, form=Spline(degree=0))
    assert cert.verify(rigorous=True)


def between(first, second, dt):
    n, states = Scheduling("n", "1", 0.0, 1.0), len(first)
    return LPVStateSpace.polynomial(
        [first, second - first], [np.eye(states, 1)], [np.eye(1, states)], [[[0.0]]], n, dt=dt
    )


def test_stability_over_jumps_has_the_functions_of_the_decay_rate():
    """A set of Blondel and Nesterov, 1 % inside its joint spectral radius, 3.917384715148."""
    first, second = np.array([[-1.0, -1], [-4, 0]]), np.array([[3.0, 3], [-2, 1]])
    size = 1.01 * 3.917384715148
    model = between(first / size, second / size, 1.0)
    assert decay_rate(model, math.inf, search=None).alpha > 0
    assert stability(model, math.inf, search=None).verify(rigorous=True)
    assert stability(model, math.inf, search=None, impose=SumOfSquares()).verified
    # a constant P does not exist, and is not said to
    refused = stability(model, math.inf, search=None, form=Spline(degree=0))
    assert refused.status is Status.INFEASIBLE
    assert "meets the inequalities imposed" in refused.why


def test_a_gain_of_many_states_over_jumps_says_what_was_left_out():
    """The set above beside 11 states of its own: no constant P exists."""
    pair = [np.array([[-1.0, -1], [-4, 0]]), np.array([[3.0, 3], [-2, 1]])]
    few, many = (
        between(*(block_diag(A / (1.01 * 3.917384715148), *[0.5] * more) for A in pair), 1.0)
        for more in (0, 11)
    )
    assert l2_gain(few, math.inf, search=None).verified
    refused = l2_gain(many, math.inf, search=None)
    assert refused.status is Status.UNTRIED
    assert refused.attempts[-1].answer == "left out"


def test_a_refusal_over_jumps_names_two_frozen_models():
    """x'' + 2 p x' + p^2 x = 0 is stable at every p in [1, 10], and jumps have no common P."""
    rho = Scheduling("rho", "1", 1.0, 10.0)
    p = rho.symbol
    A = [[0, 1], [-(p**2), -2 * p]]
    model = LPVStateSpace.from_expressions(A, [[0], [1]], [[1, 0]], [[0]], rho)
    refused = stability(model, math.inf, search=None)
    assert refused.status is Status.INFEASIBLE
    assert "no constant P exists: of the frozen models at rho = 1 and rho = " in refused.why
    first, second = (np.array([[0, 1], [-(q**2), -2 * q]]) for q in (1.0, 10.0))
    product = np.linalg.eigvals(first @ second)
    assert np.any((np.abs(product.imag) < 1e-9) & (product.real < 0))
    proven = stability(model, 1.0, search=None)
    assert "no constant P" not in proven.why


def test_a_decay_rate_below_zero_is_named():
    rho = Scheduling("rho", "1", 1.0, 10.0, rate=100.0)
    p = rho.symbol
    A = [[0, 1], [-(p**2), -2 * p]]
    model = LPVStateSpace.from_expressions(A, [[0], [1]], [[1, 0]], [[0]], rho)
    cert = decay_rate(model, search=None)
    assert -0.3 < cert.alpha < 0
    assert cert.status is Status.GROWTH
    assert "too large" not in str(cert)
    assert not cert.verified
    assert not cert.verify()
