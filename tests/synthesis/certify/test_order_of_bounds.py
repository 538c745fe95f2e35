"""frozen <= lower <= gain <= gamma, for any model and rate; more freedom for p never lowers the
gain.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from models import lag, lateral, random_stable, spring

from symheli.errors import CertificateError
from symheli.lpv.tools import simulate
from synthesis import l2_gain, lower_bound, stability
from synthesis.analysis import LowerBoundSearch, Status
from synthesis.forms import Spline

COARSE = Spline(segments=4)
QUICK = LowerBoundSearch(
    levels=6, dwells=7, starts=1, nodes=40, evaluations=12, steps=80, samples=2000
)


def response(lpv, time, p, u, x, step):
    """State at the end and output energy along straight lines in p, by Runge and Kutta's
    fourth-order rule and Simpson's.
    """
    energy = 0.0
    for k in range(len(time) - 1):
        width = time[k + 1] - time[k]
        if width < 1e-9:
            continue
        n = math.ceil(width / step)
        h = width / n
        at = np.clip(
            p[k] + (p[k + 1] - p[k]) * np.arange(2 * n + 1) / (2 * n),
            lpv.scheduling.low,
            lpv.scheduling.high,
        )
        A, B, C, _ = lpv.matrices(at)
        drive = B @ (u[k][:, None] if u is not None else np.zeros((B.shape[2], 1)))
        for i in range(0, 2 * n, 2):
            k1 = A[i] @ x + drive[i]
            k2 = A[i + 1] @ (x + h / 2 * k1) + drive[i + 1]
            k3 = A[i + 1] @ (x + h / 2 * k2) + drive[i + 1]
            k4 = A[i + 2] @ (x + h * k3) + drive[i + 2]
            middle, end = x + h / 8 * (2 * k1 + k2 + k3), x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            energy += (
                h
                / 6
                * sum(
                    w * np.sum((C[j] @ z) ** 2)
                    for w, j, z in ((1, i, x), (4, i + 1, middle), (1, i + 2, end))
                )
            )
            x = end
    return x, float(energy)


@pytest.mark.slow(but="2-0.1")
@pytest.mark.parametrize(
    ("seed", "dt"),
    [
        pytest.param(k, dt, marks=() if k % 2 == (dt is None) else pytest.mark.slow)
        for k in range(3)
        for dt in (None, 0.1)
    ],
)
def test_upper_bounds_are_never_below_lower_bounds(seed, dt):
    cert = l2_gain(random_stable(seed, dt=dt, rate=1.0), form=COARSE, search=QUICK)
    # 1e-6: the frozen norm is computed to 1e-8, gamma is inflated by 5e-7
    assert cert.frozen <= cert.lower * (1 + 1e-9)
    assert cert.lower <= cert.gamma * (1 + 1e-6)


@pytest.mark.slow(but="None")
@pytest.mark.parametrize("dt", [None, 0.25])
def test_the_gain_does_not_fall_when_p_may_move_faster(dt):
    lpv = spring() if dt is None else spring().discretize(dt)
    gains = [l2_gain(lpv, rate, form=COARSE, search=None).gamma for rate in (0.0, 0.01, 0.03)]
    # 1e-4: each optimum is found to the solver's gap and lies above it by the margin
    assert all(slow <= fast * (1 + 1e-4) for slow, fast in pairwise(gains))
    assert gains[-1] > 1.02 * gains[0]


@pytest.mark.slow
def test_a_finer_spline_does_not_prove_less():
    gains = [
        l2_gain(spring(), 0.03, form=Spline(segments=(k,), grading=1.0), search=None).gamma
        for k in (2, 4, 8)
    ]
    assert gains[2] <= gains[1] * (1 + 1e-4) <= gains[0] * (1 + 2e-4)


def test_parametric_resonance_is_proven_when_slow_and_found_when_fast():
    assert stability(spring(), 0.02, form=COARSE).verified
    fast = stability(spring(), math.inf, search=QUICK)
    assert not fast.verified
    assert fast.status is Status.GROWING
    assert not fast.verify()


def test_a_growing_trajectory_does_grow_when_it_is_flown():
    found = lower_bound(spring(), 4.0, search=QUICK)
    assert math.isinf(found.gain)
    assert found.trajectory is not None
    time, p = found.trajectory
    assert np.abs(np.diff(p)).max() <= 4.0 * np.diff(time)[np.abs(np.diff(p)).argmax()] * (1 + 1e-9)
    ends = response(
        spring(),
        np.tile(time, 8) + np.repeat(np.arange(8) * time[-1], len(time)),
        np.tile(p, 8),
        None,
        np.eye(2),
        0.01,
    )[0]
    growth = np.linalg.norm(ends, axis=0)
    assert growth.max() > 0.5 * found.growth**8 > 0.5


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
        y = simulate(lpv, p, found.input)[1]
        ratio = np.linalg.norm(y) / np.linalg.norm(found.input)
    else:
        ratio = math.sqrt(
            response(lpv, time, p, found.input, np.zeros((2, 1)), 0.02)[1]
            / float(np.sum(found.input[:-1, 0] ** 2 * np.diff(time)))
        )
    # continuous: the last input sample is left out
    assert ratio == pytest.approx(found.gain, rel=1e-3 if dt is None else 1e-6)
    assert found.gain > l2_gain(lpv, 0.0, form=COARSE, search=None).frozen


@pytest.mark.slow
def test_the_search_for_bad_trajectories_is_deterministic():
    a, b = (lower_bound(spring(), 0.2, search=QUICK) for _ in range(2))
    assert a.gain == b.gain


@pytest.mark.slow
def test_a_rate_of_zero_leaves_the_frozen_gain():
    found = lower_bound(spring(), 0.0)
    assert found.trajectory is None
    assert found.gain == pytest.approx(
        l2_gain(spring(), 0.0, form=Spline(segments=8), search=None).gamma, rel=1e-3
    )


def test_a_certificate_that_contradicts_its_lower_bound_cannot_be_made():
    from dataclasses import replace

    cert = l2_gain(lag(), form=COARSE, search=None)
    with pytest.raises(CertificateError, match="frozen gain"):
        replace(cert, frozen=1.1)
    with pytest.raises(CertificateError, match="lower bound"):
        replace(cert, lower=1.1)


@pytest.mark.slow
def test_on_the_lateral_loop_slow_is_proven_and_fast_grows():
    lpv = lateral()
    assert l2_gain(lpv, 0.01).gamma < 1.01 * l2_gain(lpv, 0.0, search=None).frozen
    assert l2_gain(lpv, math.inf).status is Status.GROWING
