"""Published designs and bounds imposed X, Y and P on a grid, in functions of their own: they are
found again as they were made, and what they are worth between the points is said.
"""

import math

import numpy as np
import pytest
import sympy
from scheduled_plants import spring, turning
from scipy.optimize import minimize

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from symheli.lpv import UserFunctions
from synthesis import estimator, l2_gain, output_feedback, state_feedback
from synthesis.analysis import Status
from synthesis.forms import Spline
from synthesis.impose import Grid

EXACT = 0.354682
"""Least gain of `turning` at 1 rad/s for every controller."""
PLANT = turning(1.0)
T = PLANT.parameters[0]
SINES = UserFunctions.from_expressions([1, sympy.cos(T.symbol), sympy.sin(T.symbol)], T)


def least_on(points):
    """The least gain with Z = Y/gamma = a + b cos t + c sin t, by sequential quadratic
    programming: Z' - 2AZ + B^2 - Z^2 >= 1/gamma^2 at every point, for both rates.
    """
    t = np.linspace(0.0, np.pi / 2, points)
    F = np.column_stack([np.ones(points), np.cos(t), np.sin(t)])
    slopes = np.column_stack([np.zeros(points), -np.sin(t), np.cos(t)])

    def slack(v):
        Z, moving = F @ v[:3], slopes @ v[:3]
        still = 6 * np.cos(t) * Z + 9 * np.sin(t) ** 2 - Z**2 - v[3]
        return np.concatenate([still + moving, still - moving, Z])

    found = minimize(
        lambda v: -v[3],
        np.ones(4),
        constraints={"type": "ineq", "fun": slack},
        method="SLSQP",
        options={"ftol": 1e-13, "maxiter": 500},
    )
    return 1 / math.sqrt(found.x[3])


@pytest.mark.parametrize("points", [3, 11])
def test_state_feedback_with_sines_in_y_is_the_least_on_the_grid(points):
    made = state_feedback(PLANT, Y=SINES, impose=Grid(points))
    # the last program stops within 1e-5 of its optimum
    assert made.optimum == pytest.approx(least_on(points), rel=1e-5)


@pytest.mark.slow
def test_what_a_coarse_grid_promises_is_proven_or_not_between_its_points():
    made = state_feedback(PLANT, Y=SINES, impose=Grid(3))
    refined = state_feedback(PLANT, Y=SINES)
    assert EXACT < made.optimum < 0.99 * refined.optimum  # three points promise too much
    proof = made.certify(search=None)
    assert proof.verified
    assert proof.gamma > EXACT


def in_functions_of_its_own():
    plant = spring(rate=0.1)
    p = plant.parameters[0]
    return plant, UserFunctions.from_expressions([1, 1 / (1 + p.symbol), p.symbol], p)


@pytest.mark.slow
def test_output_feedback_takes_the_grid_and_the_functions():
    plant, basis = in_functions_of_its_own()
    rich = output_feedback(plant, X=0, Y=basis, impose=Grid(9))
    poor = output_feedback(plant, X=0, Y=0, impose=Grid(9))
    assert rich.optimum <= poor.optimum * (1 + 1e-4)
    assert rich.certify(search=None).verified


@pytest.mark.slow
def test_an_estimator_of_a_part_of_the_points_promises_no_more():
    plant, basis = in_functions_of_its_own()
    # of 5 points the 3 of the coarser grid are a part: it asks for less
    fine, coarse = (estimator(plant, X=basis, impose=Grid(n)).promised for n in (5, 3))
    assert coarse <= fine * (1 + 1e-4)


def delayed_loop():
    """The example of LPVTools after Tan, Hang and Chai (1997): PI control of a lag behind a delay
    of 0.5 s, e = d - 1.1 y, from d to e.
    """
    s = Scheduling("p", "1", low=2.0, high=7.0, rate=0.1)
    p = s.symbol
    tau, K = sympy.sqrt(133.6 - 16.8 * p), sympy.sqrt(4.8 * p - 8.6)
    g, kp, ki = 1.1 * K, (0.35 * tau - 1) / K, 0.0625 * tau / K
    # states x_G, x_c and two of the Pade delay 1 - 24 s / (s^2 + 12 s + 48)
    A = [
        [-(1 + g * kp) / tau, 1 / tau, 0, -24 / tau],
        [-g * ki, 0, 0, 0],
        [0, 0, 0, 1],
        [-g * kp, 1, -48, -12],
    ]
    return LPVStateSpace.from_expressions(
        A, [[kp / tau], [ki], [0], [kp]], [[-g, 0, 0, 0]], [[1]], s
    )


def test_the_example_of_lpvtools_and_what_finer_grids_make_of_it():
    """Printed for |dp/dt| <= 0.1 and P in 1, p, p^2, 1/p, sqrt(p) on six points: 1.2968; computed
    by another program 1.29457, and 1.3071 on eleven. With a constant P 20.1361 where 20.1476 is
    printed.
    """
    loop = delayed_loop()
    s = loop.scheduling
    p = s.symbol
    basis = UserFunctions.from_expressions([1, p, p**2, 1 / p, sympy.sqrt(p)], s)
    for points, known in ((6, 1.29457), (11, 1.3071)):
        found = l2_gain(loop, form=basis, impose=Grid(points))
        assert found.indicative == pytest.approx(known, rel=1e-4)  # that one keeps margins
        assert (found.status, found.verified, found.gamma) == (Status.UNPROVEN, False, math.inf)
        assert found.frozen == pytest.approx(1.2252, abs=5e-5)  # at p = 7
    constant = UserFunctions.from_expressions([1], s)
    found = l2_gain(loop, math.inf, form=constant, impose=Grid(6))
    assert found.indicative == pytest.approx(20.1361, rel=3e-5)


def test_on_a_grid_a_polynomial_p_is_the_least_as_the_general_analysis_finds_it():
    rho = Scheduling("rho", "1", low=0.0, high=0.5, rate=0.1)
    model = LPVStateSpace.polynomial(
        [[[0, 1], [-1, -0.4]], [[0, 0], [-2, 0]]], [[[0], [1]]], [[[1, 0]]], [[[0]]], rho
    )
    affine = UserFunctions.from_expressions([1, rho.symbol], rho)
    found = l2_gain(model, form=affine, impose=Grid(11)).indicative
    form = Spline(degree=1, segments=1)
    other = l2_gain(model, form=form, impose=Grid(11), search=None).indicative
    assert found == pytest.approx(other, rel=1e-3)  # which keeps margins of 1e-6 in its blocks


def test_a_model_of_sines_is_fitted_for_its_certificate():
    model = LPVStateSpace.from_expressions(
        [[-2 - sympy.cos(T.symbol)]], [[1]], [[sympy.sin(T.symbol)]], [[0]], T
    )
    fitted = model.fitted(PLANT.basis)
    assert max(np.abs(M).max() for M in fitted.residuals.matrices) < 1e-9  # of degree 10
    np.testing.assert_allclose(fitted.at(0.4).C, np.sin(0.4), rtol=1e-9)
    assert l2_gain(fitted, search=None).verified


@pytest.mark.parametrize(
    ("later", "message"),
    [
        (lambda: state_feedback(PLANT, impose=Spline()), "impose: expected a Grid"),
        (lambda: l2_gain(delayed_loop(), form=SINES), "impose=Grid"),
        (lambda: l2_gain(delayed_loop(), math.inf, form=SINES, impose=Grid(3)), "which may jump"),
        (
            lambda: l2_gain(spring().nominal.discretize(0.1), form=SINES, impose=Grid(3)),
            "for continuous time",
        ),
        (
            lambda: state_feedback(PLANT, Y=UserFunctions((np.ones_like, np.cos), T.low, T.high)),
            "no known derivative",
        ),
    ],
)
def test_what_has_no_meaning_on_a_grid_is_refused(later, message):
    with pytest.raises(InputError, match=message):
        later()


def test_functions_that_vanish_on_the_grid_still_have_slopes_there():
    """With as many functions as points, or more, none is lost: the least gain does not grow."""
    p = Scheduling("p", "1", low=0.0, high=1.0, rate=0.5)
    lag = LPVStateSpace.polynomial(
        [[[0, 1], [-1, -0.4]], [[0, 0], [-2, 0]]], [[[0], [1]]], [[[1, 0]]], [[[0]]], p
    )
    gains = [
        l2_gain(
            lag,
            form=UserFunctions.from_expressions([p.symbol**k for k in range(count)], p),
            impose=Grid(2),
        ).indicative
        for count in (2, 4)
    ]
    assert gains[1] < 0.999 * gains[0]
