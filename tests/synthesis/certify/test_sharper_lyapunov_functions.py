"""Memory of p and forms of higher degree: their algebra, what they prove beyond x' P(p) x, and that
they never prove too much.
"""

import math
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from models import fastest_growth, forged, lag, lateral, random_stable, searched, spring
from scipy.optimize import brentq

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import decay_rate, l2_gain, lower_bound, stability
from synthesis.analysis import LowerBoundSearch, Status, energy_to_peak
from synthesis.certify.proof.inequalities import Statement, lmi_polynomials
from synthesis.certify.statement.lag import LagRegion
from synthesis.certify.statement.spline import MemoryLyapunov
from synthesis.forms import HigherOrder, LaggedParameter, Spline
from synthesis.numerics.polynomial.pieces import pieces
from synthesis.numerics.polynomial.symmetric_power import (
    generator,
    monomials,
    null_matrix,
    null_size,
    null_weights,
    power,
)

MEMORY = LaggedParameter(1.5, segments=8, degree=2, grading=1.0, across_segments=2)
QUARTIC = HigherOrder(2, segments=4)
SHARPER = (MEMORY, QUARTIC)


def z(x, m):
    return np.array([np.prod(x[list(a)]) for a in monomials(len(x), m)])


@pytest.mark.parametrize(("n", "m"), [(2, 3), (3, 2), (5, 2)])
def test_monomials_follow_their_generator_and_their_power(n, m):
    rng = np.random.default_rng(n)
    A, T, x = rng.standard_normal((n, n)), rng.standard_normal((n, n)), rng.standard_normal(n)
    assert np.allclose(z(T @ x, m), power(T, m) @ z(x, m), atol=1e-12)
    # the central difference of a polynomial of degree 3 in h
    derivative = (z(x + 1e-5 * A @ x, m) - z(x - 1e-5 * A @ x, m)) / 2e-5
    assert np.allclose(generator(A, m) @ z(x, m), derivative, atol=1e-7)


@pytest.mark.parametrize(("n", "m"), [(2, 3), (3, 2), (5, 2)])
def test_the_null_space_vanishes_exactly_and_is_all_there_is(n, m):
    rng = np.random.default_rng(n)
    weights = np.array(
        [Fraction(int(w)) for w in rng.integers(-9, 9, null_size(n, m))], dtype=object
    )
    x = np.array([Fraction(int(v), 7) for v in rng.integers(-9, 9, n)], dtype=object)
    L = null_matrix(weights, n, m)
    assert z(x, m) @ L @ z(x, m) == 0
    assert np.all(null_weights(L.astype(float), n, m) == weights.astype(float))
    N = len(monomials(n, m))
    # matrices less their null space are the forms of degree 2m
    assert N * (N + 1) // 2 - null_size(n, m) == math.comb(n + 2 * m - 1, 2 * m)


def wandering(low, high, rate, seconds, step, rng):
    """p(t) at full rate, turning at random."""
    p, out, direction = rng.uniform(low, high), [], 1.0
    for _ in range(int(seconds / step)):
        if rng.uniform() < 0.3 * step:
            direction = -direction
        p = min(max(p + direction * rate * step, low), high)
        out.append(p)
    return np.array(out)


@pytest.mark.slow(but="6.0")
@pytest.mark.parametrize("rate", [0.05, 0.7, 6.0])
def test_no_trajectory_leaves_the_region_of_the_lag(rate):
    rng = np.random.default_rng(5)
    knots, time, step = np.array([-1.0, -0.9, -0.5, 0.2, 1.0]), 0.8, 2e-3
    region = LagRegion.reached(knots, rate, time)
    assert region.invariant(rate, Fraction)
    assert not region.invariant(1.01 * rate, Fraction)
    p = wandering(-1.0, 1.0, rate, 20.0, step, rng)
    q, decay = p[0], math.exp(-step / time)
    for now, after in pairwise(p):
        # the lag of a straight line, exactly
        slope = (after - now) / step
        q = after - slope * time + (q - now + slope * time) * decay
        lower, height, _, _ = region.locate(np.array(after))
        assert lower - 1e-12 <= after - q <= lower + height + 1e-12


def test_memory_polynomials_are_the_lmi_at_every_point():
    lpv, rate, rng = random_stable(5), 0.7, np.random.default_rng(4)
    region = LagRegion.reached(np.array([0.0, 0.25, 1.0]), rate, 0.4)
    M = rng.standard_normal((5, 5, 3, 3))
    P = MemoryLyapunov(region, 2, np.array([0.0, 0.3, 1.0]), 2, M + np.swapaxes(M, -1, -2))
    forms = list(lmi_polynomials(Statement(pieces(lpv), P, rate), float))
    assert len(forms) == 2 * 2 * 2
    p, share = 0.6, 0.8
    lower, height, _, _ = (float(v) for v in region.locate(np.array(p)))

    def at(p, e):
        low, tall, _, _ = (float(v) for v in region.locate(np.array(p)))
        return P.at(p, (e - low) / tall)[0]

    e, h = lower + share * height, 1e-5
    value, in_p, in_e = P.at(p, share)
    # central differences of h^2
    assert np.allclose(in_p, (at(p + h, e) - at(p - h, e)) / (2 * h), atol=1e-6)
    assert np.allclose(in_e, (at(p, e + h) - at(p, e - h)) / (2 * h), atol=1e-6)
    A, B, C, D = lpv.matrices(p)
    Y = np.hstack([C, D])

    for form, nu in zip(forms[6:], (-rate, rate), strict=True):
        top = A.T @ value + value @ A + nu * in_p + (nu - e / 0.4) * in_e
        expected = np.block([[top, value @ B], [B.T @ value, np.zeros((2, 2))]]) + Y.T @ Y
        assert np.allclose(form.block([p, share]), height * expected, atol=1e-10)
        assert form.weight([p, share]).item() == pytest.approx(height)


@pytest.mark.slow
def test_higher_degrees_close_in_on_the_damping_that_a_jumping_spring_needs():
    """The truth is known: each degree proves more than the one before, none what is false."""
    change = 0.6
    truth = brentq(lambda d: fastest_growth(d, change), 0.05, 0.5)
    needed = []
    for form in (Spline(), HigherOrder(2), HigherOrder(3)):
        low, high = truth, 3 * truth
        for _ in range(9):
            middle = 0.5 * (low + high)
            proof = stability(
                spring(damping=middle, change=change),
                math.inf,
                form=form,
                search=None,
            )
            low, high = (low, middle) if proof.verified else (middle, high)
        needed.append(high)
        too_little = spring(damping=truth * (1 - 1e-3), change=change)
        assert not stability(too_little, math.inf, form=form, search=None).verified
    # one in 250 of the truth is the resolution of the bisection
    assert needed[0] > 1.2 * needed[1] > 1.2 * 1.05 * needed[2]
    assert needed[2] < 1.12 * truth


@pytest.mark.slow(but="form1")
@pytest.mark.parametrize("form", SHARPER)
def test_they_prove_a_spring_at_a_rate_at_which_a_quadratic_does_not(form):
    plain = Spline(segments=(8, 16), grading=1.0)
    assert stability(spring(), 0.25, form=plain, search=None).status is Status.INFEASIBLE
    proof = stability(spring(), 0.25, form=form, search=None)
    assert proof.verified, proof
    assert proof.verify(rigorous=True)


@pytest.mark.slow
def test_memory_brings_the_gain_nearer_to_its_lower_bound():
    search = LowerBoundSearch(
        levels=4, dwells=5, starts=1, nodes=40, evaluations=12, steps=80, samples=5000
    )
    below = lower_bound(spring(), 0.2, search=search).gain
    plain, memory = (
        l2_gain(spring(), 0.2, form=form, search=None)
        for form in (Spline(segments=8, grading=1.0), MEMORY)
    )
    assert memory.verify(rigorous=True)
    assert below <= memory.gamma < 0.9 * plain.gamma


@pytest.mark.slow(but="form1")
@pytest.mark.parametrize("form", SHARPER)
def test_a_growing_spring_is_never_called_stable(form):
    # the search finds growth here, whatever form is asked
    for rate in (1.0, 4.0, math.inf):
        proof = stability(
            spring(),
            rate,
            form=form,
            search=LowerBoundSearch(levels=4, dwells=7, starts=1, nodes=40, evaluations=12),
        )
        assert proof.status is Status.GROWING
        assert not proof.verified


@pytest.mark.slow(but=("0.1-form1", "1e-08-form1"))
@pytest.mark.parametrize("form", SHARPER)
@pytest.mark.parametrize("excess", [1e-1, 1e-8])
def test_an_unstable_plant_is_never_called_stable(form, excess):
    A = [[[excess - 0.25, 1.0], [0.0, -1.0]], [[1.0, 0], [0, 0]], [[-1.0, 0], [0, 0]]]
    for scale in (1e-4, 1.0, 1e4):
        T = np.diag([scale, 1.0])
        lpv = LPVStateSpace.polynomial(
            [T @ np.array(M) @ np.linalg.inv(T) for M in A],
            [T @ np.array([[0.0], [1.0]])],
            [np.array([[1.0, 0.0]]) @ np.linalg.inv(T)],
            [np.zeros((1, 1))],
            Scheduling("p", "1", 0.0, 1.0, 0.1),
        )
        # without the look at the frozen poles: the solver and the verification alone
        for kind in ("stability",) if form is QUARTIC else ("stability", "l2 gain"):
            assert searched(lpv, 0.1, kind, form).proof is None


def test_a_lag_keeps_its_static_gain_with_a_memory():
    cert = l2_gain(lag(), 1.0, form=MEMORY, search=None)
    assert 1.0 <= cert.gamma <= 1.0 + 3e-6
    assert cert.verify(rigorous=True)


@pytest.mark.slow
def test_tampered_proofs_fail_in_either_arithmetic():
    remembered, quartic = (stability(spring(), 0.05, form=form, search=None) for form in SHARPER)
    P, V = remembered.lyapunov, quartic.lyapunov
    assert isinstance(P, MemoryLyapunov)
    assert V is not None
    assert V.slack is not None
    wider = replace(P.region, time=1.05 * P.region.time)
    worse = P.coefficients.copy()
    worse[2, 1] *= 2.0
    bad = [
        forged(remembered, lyapunov=replace(P, region=wider)),
        forged(remembered, lyapunov=replace(P, coefficients=worse)),
        forged(quartic, lyapunov=replace(V, slack=V.slack + np.abs(V.slack).max())),
        forged(quartic, lyapunov=replace(V, coefficients=-V.coefficients)),
    ]
    for cert in (remembered, quartic):
        assert cert.verify()
        assert cert.verify(rigorous=True)
        evidence = cert.proof.evidence
        # faster than was proven: the region, or the LMIs, no longer hold
        bad += [forged(cert, evidence=evidence._replace(rate=rate)) for rate in (2.0, math.inf)]
    for cert in bad:
        assert not cert.verify()
        assert not cert.verify(rigorous=True)


@pytest.mark.parametrize("rate", [0.0, 0.1, math.inf])
@pytest.mark.parametrize(("form", "said"), [(MEMORY, "LaggedParameter"), (QUARTIC, "HigherOrder")])
def test_in_discrete_time_a_memory_or_an_order_is_refused_before_any_work(
    form, said, rate, monkeypatch
):
    monkeypatch.setattr("synthesis.certify.questions.certify.worst_by", None)
    sampled = spring().discretize(0.1)
    for analysis in (l2_gain, stability):
        with pytest.raises(
            InputError, match=rf"{said} is for continuous time; this model is sampled every 0\.1 s"
        ):
            analysis(sampled, rate, form=form)
    for analysis in (energy_to_peak, decay_rate):
        with pytest.raises(InputError, match=f"{said} is a form for l2_gain and stability"):
            analysis(sampled, rate, form=form)


def test_one_state_has_a_form_of_higher_degree_too():
    """Its one monomial leaves nothing to add to a block, which once was an array that could not be
    reshaped.
    """
    assert stability(lag(), form=QUARTIC).verify(rigorous=True)
    assert not stability(
        replace(lag(), A=lag().A + np.array([[[1.0]], [[0.0]]])), form=QUARTIC
    ).verified


def test_forms_that_do_not_suit_the_question_are_refused():
    with pytest.raises(InputError, match="stability only"):
        l2_gain(spring(), 0.1, form=QUARTIC, search=None)
    with pytest.raises(InputError, match="order 2 or 3"):
        HigherOrder(1)
    with pytest.raises(InputError, match="seconds > 0"):
        LaggedParameter(-1.0)


@pytest.mark.slow
def test_the_lateral_loop_is_bracketed_within_a_quarter():
    lpv = lateral()
    cert = l2_gain(lpv, 3.0, form=LaggedParameter(0.6, grading=1.5))
    assert cert.verify(rigorous=True)
    assert cert.gap < 1.25
    assert cert.gamma < 0.8 * l2_gain(lpv, 3.0, search=None).gamma
