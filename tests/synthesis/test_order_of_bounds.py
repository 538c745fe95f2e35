"""frozen <= lower <= gain <= gamma, for any model and rate; more freedom for p never lowers the gain."""

import math
from itertools import pairwise

import numpy as np
import pytest
from models import lag, lateral, random_stable, spring

from symheli.errors import CertificateError
from symheli.lpv import simulate
from synthesis import Relaxation, Search, Status, l2_gain, lower_bound, stability

COARSE = Relaxation(segments=(4,))
QUICK = Search(levels=6, dwells=7, evaluations=12, steps=80)


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", range(5))
def test_upper_bounds_are_never_below_lower_bounds(seed, dt):
    cert = l2_gain(random_stable(seed, dt=dt, rate=1.0), relaxation=COARSE, search=QUICK)
    # 1e-6: the frozen norm is computed to 1e-8, gamma is inflated by 5e-7
    assert cert.frozen <= cert.lower * (1 + 1e-9)
    assert cert.lower <= cert.gamma * (1 + 1e-6)


@pytest.mark.parametrize("dt", [None, 0.25])
def test_the_gain_does_not_fall_when_p_may_move_faster(dt):
    lpv = spring() if dt is None else spring().discretize(dt)
    gains = [l2_gain(lpv, rate, relaxation=COARSE, search=None).gamma for rate in (0.0, 0.01, 0.03)]
    # 1e-4: each optimum is found to the solver's gap and lies above it by the margin
    assert all(slow <= fast * (1 + 1e-4) for slow, fast in pairwise(gains))
    assert gains[-1] > 1.02 * gains[0]


def test_a_finer_spline_does_not_prove_less():
    gains = [l2_gain(spring(), 0.03, relaxation=Relaxation(segments=(k,), grading=1.0), search=None).gamma for k in (2, 4, 8)]
    assert gains[2] <= gains[1] * (1 + 1e-4) <= gains[0] * (1 + 2e-4)


def test_parametric_resonance_is_proven_when_slow_and_found_when_fast():
    assert stability(spring(), 0.02, relaxation=COARSE).verified
    fast = stability(spring(), math.inf, search=QUICK)
    assert not fast.verified
    assert fast.status is Status.GROWING
    assert not fast.verify()


def test_a_growing_trajectory_does_grow_when_it_is_flown():
    found = lower_bound(spring(), 4.0, search=QUICK)
    assert math.isinf(found.gamma)
    assert found.trajectory is not None
    time, p = found.trajectory
    assert np.abs(np.diff(p)).max() <= 4.0 * np.diff(time)[np.abs(np.diff(p)).argmax()] * (1 + 1e-9)
    # eight cycles in small steps, p held at its midpoint value: second order in the step
    dt, period = 2e-3, time[-1]
    clock = np.arange(0, 8 * period, dt) + dt / 2
    along = np.interp(clock % period, time, p)
    growth = []
    for x0 in np.eye(2):
        x, _ = simulate(spring(), along, np.zeros((len(clock), 1)), x0, dt=dt)
        growth.append(np.linalg.norm(x[-1]))
    assert max(growth) > 0.5 * found.growth**8 > 0.5


@pytest.mark.parametrize("dt", [None, 0.2])
def test_the_lower_bound_is_the_ratio_of_an_input_that_can_be_flown(dt):
    lpv = spring() if dt is None else spring().discretize(dt)
    found = lower_bound(lpv, 0.25, search=QUICK)
    assert found.trajectory is not None
    assert found.input is not None
    time, p = found.trajectory
    assert np.all(np.abs(np.diff(p)) <= 0.25 * np.diff(time) * (1 + 1e-6))
    assert p.min() >= -1
    assert p.max() <= 1
    if dt is not None:
        x, y = simulate(lpv, p, found.input)
        ratio = np.linalg.norm(y) / np.linalg.norm(found.input)
    else:
        # resample eight times finer; energies by the rectangle rule, first order in the step
        fine = np.concatenate([np.linspace(a, b, 8, endpoint=False) for a, b in pairwise(time)])
        h = np.repeat(np.diff(time) / 8, 8)
        assert np.ptp(h) < 0.5 * h.mean()
        x, energy, at = np.zeros(2), 0.0, np.interp(fine + h / 2, time, p)
        A, B, C, _ = lpv.matrices(at)
        from scipy.linalg import expm

        for k in range(len(fine)):
            M = np.block([[A[k], B[k]], [np.zeros((1, 3))]]) * h[k]
            x = (expm(M) @ np.append(x, found.input[k // 8]))[:2]
            energy += h[k] * float((C[k] @ x)[0] ** 2)
        ratio = math.sqrt(energy / float(np.sum(found.input[:-1] ** 2 * np.diff(time)[:, None])))
    # 1 %: the rectangle rule, and the last input sample left out
    assert ratio == pytest.approx(found.gamma, rel=1e-2 if dt is None else 1e-6)
    assert found.gamma > l2_gain(lpv, 0.0, relaxation=COARSE, search=None).frozen


def test_the_search_for_bad_trajectories_is_deterministic():
    a, b = (lower_bound(spring(), 0.2, search=QUICK) for _ in range(2))
    assert a.gamma == b.gamma


def test_a_rate_of_zero_leaves_the_frozen_gain():
    found = lower_bound(spring(), 0.0)
    assert found.trajectory is None
    assert found.gamma == pytest.approx(l2_gain(spring(), 0.0, relaxation=Relaxation(segments=(8,)), search=None).gamma, rel=1e-3)


def test_a_certificate_that_contradicts_its_lower_bound_cannot_be_made():
    from dataclasses import replace

    cert = l2_gain(lag(), relaxation=COARSE, search=None)
    with pytest.raises(CertificateError, match="frozen gain"):
        replace(cert, frozen=1.1)
    with pytest.raises(CertificateError, match="lower bound"):
        replace(cert, lower=1.1)


@pytest.mark.slow
def test_on_the_lateral_loop_slow_is_proven_and_fast_grows():
    lpv = lateral()
    assert l2_gain(lpv, 0.01).gamma < 1.01 * l2_gain(lpv, 0.0, search=None).frozen
    assert l2_gain(lpv, math.inf).status is Status.GROWING
