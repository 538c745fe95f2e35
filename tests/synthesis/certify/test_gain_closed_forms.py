"""Gains known from elsewhere: closed forms, time-invariant models, symmetry under scaling."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from models import constant, lag, lateral, random_stable

from symheli import LPVStateSpace, Scheduling
from synthesis import frozen_gain, l2_gain, stability
from synthesis.forms import Spline

COARSE = Spline(segments=4)


@pytest.mark.slow(but="inf")
@pytest.mark.parametrize("rate", [0.0, 1.0, math.inf])
def test_a_lag_has_its_static_gain_at_any_rate(rate):
    cert = l2_gain(lag(), rate, form=COARSE, search=None)
    # 5e-7 is the inflation of gamma, 1e-6 the solver's gap
    assert 1.0 <= cert.gamma <= 1.0 + 3e-6
    assert cert.frozen == pytest.approx(1.0, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "dt"), [(1, None), (2, 0.1)])
def test_a_constant_model_has_its_h_infinity_norm(seed, dt):
    m = random_stable(seed, states=4, degree=0, dt=dt).at(0.5)
    expected = control.system_norm(control.ss(m.A, m.B, m.C, m.D, dt or 0), p="inf", tol=1e-8)
    lpv = constant(m.A, m.B, m.C, m.D, dt)
    assert frozen_gain(lpv).gain == pytest.approx(expected, rel=1e-6)
    # the bounded real lemma is exact here: what is left is the solver's gap and the margin
    assert l2_gain(lpv, form=COARSE, search=None).gamma == pytest.approx(expected, rel=1e-4)


def test_frozen_gain_finds_a_peak_between_grid_points_and_its_frequency():
    # x'' + 0.02 x' + (1 + (p - 0.5137)^2) x = u: peak 1/(2 z sqrt(1 - z^2)) with z = 0.01 at p =
    # 0.5137
    k = 0.5137
    A = [[[0, 1], [-1 - k * k, -0.02]], [[0, 0], [2 * k, 0]], [[0, 0], [-1.0, 0]]]
    lpv = LPVStateSpace.polynomial(
        A, [[[0.0], [1]]], [[[1.0, 0]]], [[[0.0]]], Scheduling("p", "1", 0.0, 1.0)
    )
    found = frozen_gain(lpv, points=7)
    assert found.gain == pytest.approx(1 / (0.02 * math.sqrt(1 - 1e-4)), rel=1e-6)
    # the norm is flat at its peak: p is found to the square root of the precision of the norm
    assert found.p == pytest.approx(k, abs=1e-3)
    assert found.omega == pytest.approx(1.0, abs=1e-3)


def test_feedthrough_alone_is_its_largest_singular_value():
    lpv = LPVStateSpace.polynomial(
        [-np.eye(2)],
        [np.zeros((2, 2))],
        [np.zeros((2, 2))],
        [np.diag([1.0, 2.0]), np.diag([0.0, 1.0])],
        Scheduling("p", "1", 0.0, 1.0),
    )
    cert = l2_gain(lpv, 1.0, form=COARSE, search=None)
    assert cert.frozen == pytest.approx(3.0, rel=1e-9)
    assert cert.gamma == pytest.approx(3.0, rel=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, 0.05])
def test_the_gain_does_not_depend_on_units_of_the_states(dt):
    lpv = random_stable(3, dt=dt)
    T = np.diag([1e3, 1.0, 1e-3])
    inverse = np.linalg.inv(T)
    other = replace(lpv, A=T @ lpv.A @ inverse, B=T @ lpv.B, C=lpv.C @ inverse)
    a, b = (l2_gain(model, form=COARSE, search=None).gamma for model in (lpv, other))
    assert b == pytest.approx(a, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-5, 1e5])
def test_the_gain_scales_with_the_output(factor):
    lpv = random_stable(4)
    scaled = replace(lpv, C=factor * lpv.C, D=factor * lpv.D)
    a, b = (l2_gain(model, form=COARSE, search=None).gamma for model in (lpv, scaled))
    assert b == pytest.approx(factor * a, rel=1e-5)


@pytest.mark.slow
def test_the_gain_does_not_depend_on_the_unit_of_time():
    lpv = random_stable(5, rate=0.3)
    s = lpv.scheduling
    # milliseconds instead of seconds
    slower = (replace(s, rate=s.rate * 1e-3),)
    other = replace(lpv, A=lpv.A * 1e-3, B=lpv.B * 1e-3, parameters=slower)
    a, b = (l2_gain(model, form=COARSE, search=None).gamma for model in (lpv, other))
    assert b == pytest.approx(a, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.1])
def test_a_fast_sampled_model_has_the_gain_of_the_continuous_one(rate):
    lpv = random_stable(6, degree=1)
    continuous = l2_gain(lpv, rate, form=COARSE, search=None)
    sampled = l2_gain(lpv.discretize(0.01), rate, form=Spline(degree=3, segments=4), search=None)
    # hold and sampling shift the response by half a sample: O(dt |A|) of a gain difference
    assert sampled.verified
    assert sampled.gamma == pytest.approx(continuous.gamma, rel=0.03)


@pytest.mark.slow
def test_a_spline_model_has_the_gain_of_the_polynomial_it_samples():
    from symheli.lpv import CubicSpline as Cubic

    lpv = random_stable(7, degree=2)
    nodes = tuple(np.linspace(0, 1, 6))
    basis = Cubic(nodes)
    sampled = lpv.matrices(np.array(nodes))
    spline = replace(lpv, basis=basis, A=sampled.A, B=sampled.B, C=sampled.C, D=sampled.D)
    a, b = (
        l2_gain(model, form=Spline(segments=5, grading=1.0), search=None) for model in (lpv, spline)
    )
    # a cubic spline reproduces quadratics; the LMIs sit on other intervals
    assert b.gamma == pytest.approx(a.gamma, rel=1e-4)
    assert b.verify(rigorous=True)


@pytest.mark.slow
def test_a_piecewise_linear_model_is_certified_up_to_its_corners():
    from symheli.lpv import PiecewiseLinear

    basis = PiecewiseLinear((0.0, 0.3, 1.0))
    lpv = replace(
        lag(),
        basis=basis,
        A=np.array([[[-2.0]], [[-1.0]], [[-3.0]]]),
        B=np.ones((3, 1, 1)),
        C=np.ones((3, 1, 1)),
        D=np.zeros((3, 1, 1)),
    )
    cert = l2_gain(lpv, 0.5, form=COARSE, search=None)
    assert cert.frozen == pytest.approx(1.0, rel=1e-6)
    assert 1.0 <= cert.gamma <= 1.0 + 1e-5


@pytest.mark.slow
def test_a_narrower_range_than_the_basis_is_certified_on_that_range_only():
    lpv = lag().with_scheduling(Scheduling("p", "1", 0.5, 0.9, 1.0))
    cert = l2_gain(lpv, form=COARSE, search=None)
    assert cert.gamma == pytest.approx(1 / 1.5, rel=1e-5)
    assert cert.lyapunov is not None
    assert cert.lyapunov.knots[0] == 0.5
    assert cert.verify(rigorous=True)


def test_stability_needs_no_channels():
    lpv = random_stable(8)
    bare = replace(
        lpv, B=lpv.B[:, :, :0], C=lpv.C[:, :0], D=lpv.D[:, :0, :0], inputs=(), outputs=()
    )
    cert = stability(bare, 0.1, form=COARSE)
    assert cert.verified
    assert math.isnan(cert.gamma)
    assert cert.verify(rigorous=True)


@pytest.mark.slow
def test_the_lateral_loop_is_proven_with_the_default_options_and_bracketed():
    cert = l2_gain(lateral(), 1.0)
    assert cert.verified
    assert cert.frozen < cert.lower < cert.gamma < 3.0
    assert cert.verify(rigorous=True)
