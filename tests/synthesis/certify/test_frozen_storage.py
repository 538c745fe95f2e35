"""P between storage functions of frozen models: for parameters that rest or move slowly."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from symheli import LPVStateSpace, Scheduling
from symheli.lpv.bases.polynomials import interpolation_points, polynomials
from symheli.lpv.tools import Matrices
from synthesis.certify.lower_bounds.box import measure, worst_frozen
from synthesis.certify.questions.frozen_storage import analytic_centre
from synthesis.certify.questions.one_parameter_search import OneParameter
from synthesis.certify.questions.problem import pose
from synthesis.forms import Spline

DEGREE = 6
"""Of the polynomials in place of sine and cosine over two radians: within 1e-6 of them."""


def turning(rate, modes=(1.0,), dt=None):
    """Oscillators of these frequencies, rad/s, in axes that turn by p rad: every storage function
    turns with them, and a constant one proves little. Sampled with `dt` where one is given.
    """
    ends = [(-1.0, 1.0)]
    nodes, basis = interpolation_points([DEGREE], ends), polynomials([DEGREE], ends)
    c, s = np.cos(nodes.ravel()), np.sin(nodes.ravel())
    T = np.moveaxis(np.array([[c, -s], [s, c]]), 2, 0)
    A = np.zeros((len(nodes), 2 * len(modes), 2 * len(modes)))
    for i, w in enumerate(modes):
        own = np.array([[-0.1 * w, 2.0 * w], [-0.5 * w, -0.1 * w]])
        own = own if dt is None else expm(own * dt)
        A[:, 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = T @ own @ np.swapaxes(T, 1, 2)
    rng = np.random.default_rng(0)
    B, C = rng.normal(size=(len(A[0]), 1)), rng.normal(size=(1, len(A[0])))
    every = (np.broadcast_to(M, (len(nodes), *M.shape)) for M in (B, C, np.zeros((1, 1))))
    return LPVStateSpace(
        basis,
        *(basis.fit(nodes, M) for M in (A, *every)),
        (Scheduling("p", "rad", -1.0, 1.0, rate=rate),),
        tuple(f"x{i}" for i in range(len(B))),
        ("w",),
        ("z",),
        dt=dt,
    )


def search(rate, form=None, dt=None):
    """The search for a proof in the units of the worst frozen gain, and that gain."""
    problem = pose(turning(rate, dt=dt), None, "l2 gain", form, None, None, None)
    frozen = worst_frozen(problem.model, measure(problem.demand, dt)).value
    own = OneParameter(problem)
    own.unit = own.expect(frozen)
    return own, frozen


def test_the_centre_of_one_state_is_where_the_slope_of_its_barrier_is_zero():
    """x' = -a x + b w, z = c x: S has the determinant (2 a P - c^2) g - b^2 P^2."""
    a, b, c, level, bound = 2.0, 1.0, 3.0, 2.0, 5.0
    model = Matrices(*(np.array([[v]]) for v in (-a, b, c, 0.0)))
    (found,) = analytic_centre(model, level, bound, np.array([[4.0]])).ravel()
    S = (2 * a * found - c**2) * level**2 - (b * found) ** 2
    slope = (2 * a * level**2 - 2 * b**2 * found) / S + 1 / found - 1 / (bound - found)
    curvature = 1 / (bound - found) ** 2 + 1 / found**2
    # Newton's method ends at a squared decrement of 1e-4
    assert abs(slope) <= 1e-2 * math.sqrt(curvature) * 2
    assert S > 0


def test_no_centre_where_the_start_is_no_storage_function():
    one = Matrices(*(np.array([[v]]) for v in (-2.0, 1.0, 3.0, 0.0)))
    assert analytic_centre(one, 2.0, 5.0, np.array([[0.1]])) is None


def test_the_centre_of_one_sampled_state_is_where_the_slope_of_its_barrier_is_zero():
    """x+ = a x + b w, z = c x: det S = ((1 - a^2) P - c^2) (g - b^2 P) - (a b P)^2."""
    a, b, c, level, bound = 0.5, 1.0, 1.0, 4.0, 6.0
    model = Matrices(*(np.array([[v]]) for v in (a, b, c, 0.0)))
    (found,) = analytic_centre(model, level, bound, np.array([[3.0]]), True).ravel()

    def barrier(P):
        S = ((1 - a * a) * P - c * c) * (level**2 - b * b * P) - (a * b * P) ** 2
        return -math.log(S) - math.log(P) - math.log(bound - P)

    # Newton's method ends at a squared decrement of 1e-4, that is within 1e-4 of the least value
    least = min(barrier(P) for P in np.linspace(1.5, 5.5, 4001))
    assert barrier(found) == pytest.approx(least, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, 0.2])
@pytest.mark.parametrize("rate", [0.0, 1e-3])
def test_a_resting_or_slow_parameter_costs_a_fiftieth(rate, dt):
    own, frozen = search(rate, dt=dt)
    found = own.of_frozen_models(frozen)
    assert frozen < found.bound <= 1.02 * (1 + 1e-6) * frozen
    assert found.proof is not None
    assert found.proof.evidence.exact(found.proof.lyapunov, found.bound)


@pytest.mark.parametrize("dt", [None, 0.2])
def test_nothing_is_proven_of_a_parameter_that_moves_too_fast(dt):
    own, frozen = search(1.0, dt=dt)
    assert own.of_frozen_models(frozen).proof is None


@pytest.mark.slow(but="form1")
@pytest.mark.parametrize("form", [Spline(degree=0), Spline(segments=4)])
def test_a_form_of_p_that_was_given_is_kept(form):
    own, frozen = search(0.0, form)
    assert own.of_frozen_models(frozen).proof is None
