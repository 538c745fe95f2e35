"""In discrete time a worst trajectory is one p a sample: flown on the model as it is returned, it
shows what was claimed.
"""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from models import random_stable, spring

from symheli import LPVStateSpace, Scheduling
from symheli.lpv.tools import simulate
from synthesis import decay_rate, l2_gain, lower_bound
from synthesis.analysis import LowerBoundSearch, energy_to_peak
from synthesis.forms import Spline
from synthesis.impose import SumOfSquares

QUICK = LowerBoundSearch(
    levels=4, dwells=4, starts=1, nodes=20, evaluations=4, steps=40, samples=1000
)
SOS = {"form": Spline(segments=1, degree=1), "impose": SumOfSquares()}
OPTIONS = [SOS, {"form": Spline(segments=1, degree=1)}]
common = settings(
    max_examples=6, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
# spring: p pumps; two_ends: input at one end of p, output at the other
springs = st.builds(
    lambda damping, dt: spring(damping=damping).discretize(dt),
    st.floats(0.3, 0.6),
    st.sampled_from([0.2, 0.5, 1.1]),
)


@st.composite
def two_ends(draw):
    a = draw(st.floats(0.2, 0.9))
    B, C = [[[2.0]], [[-1.0]]], [[[1.0]], [[1.0]]]
    return LPVStateSpace.polynomial(
        [[[a]]],
        B,
        C,
        [[[0.0]]],
        Scheduling("p", "1", -1.0, 2.0, math.inf),
        dt=draw(st.sampled_from([0.1, 0.3, 1.0])),
    )


models = st.one_of(
    springs,
    two_ends(),
    st.builds(lambda seed: random_stable(seed, dt=0.2), st.sampled_from([1, 7, 8])),
)
rates = st.sampled_from([0.3, 2.0, math.inf])


def within(lpv, rate, trajectory):
    time, p = trajectory
    assert time == pytest.approx(time[0] + lpv.dt * np.arange(len(time)))
    assert p.min() >= lpv.scheduling.low
    assert p.max() <= lpv.scheduling.high
    assert np.abs(np.diff(p)).max(initial=0.0) <= rate * lpv.dt * (1 + 1e-9)


@pytest.mark.slow
@common
@given(lpv=models, rate=rates)
def test_the_input_along_the_worst_trajectory_shows_the_gain(lpv, rate):
    found = lower_bound(lpv, rate, search=QUICK)
    if found.trajectory is None:
        return
    within(lpv, rate, found.trajectory)
    if math.isinf(found.gain):
        A = lpv.matrices(found.trajectory.p).A
        assert np.abs(
            np.linalg.eigvals(np.linalg.multi_dot([*A[::-1], np.eye(len(A[0]))]))
        ).max() == pytest.approx(found.growth, rel=1e-6)
        assert found.growth > 1
        return
    y = simulate(lpv, found.trajectory.p, found.input)[1]
    assert np.linalg.norm(y) / np.linalg.norm(found.input) == pytest.approx(found.gain, rel=1e-6)


@common
@given(lpv=models, rate=rates, options=st.sampled_from(OPTIONS))
@pytest.mark.slow
def test_no_input_has_less_than_the_claim_along_the_trajectory_of_a_certificate(lpv, rate, options):
    cert = l2_gain(lpv, rate, **options, search=QUICK)
    if cert.worst is None or math.isinf(cert.lower):
        return
    within(lpv, rate, cert.worst)
    # the largest gain from rest over these samples, by forward and adjoint passes from a random
    # input: it only rises
    A, B, C, D = lpv.matrices(cert.worst.p)
    u = np.random.default_rng(0).standard_normal((len(A), B.shape[2]))
    ratio = 0.0
    for _ in range(25):
        u /= np.linalg.norm(u)
        x, costate, y = np.zeros(A.shape[1]), np.zeros(A.shape[1]), np.zeros((len(A), C.shape[1]))
        for k in range(len(A)):
            y[k], x = C[k] @ x + D[k] @ u[k], A[k] @ x + B[k] @ u[k]
        ratio = np.linalg.norm(y)
        for k in range(len(A) - 1, -1, -1):
            u[k], costate = D[k].T @ y[k] + B[k].T @ costate, A[k].T @ costate + C[k].T @ y[k]
    # 5e-2: that many passes leave a few percent
    assert ratio > cert.lower * (1 - 5e-2)


@common
@given(lpv=models, rate=rates)
@pytest.mark.slow
def test_the_repeated_cycle_shows_the_peak_and_the_decay(lpv, rate):
    peak = energy_to_peak(lpv, rate, **SOS, search=QUICK)
    if peak.worst is not None and math.isfinite(peak.lower):
        within(lpv, rate, peak.worst)
        A, B, C, D = lpv.matrices(np.tile(peak.worst.p, 60))
        X, size = np.zeros(A.shape[1:]), 0.0
        for a, b, c, d in zip(A, B, C, D, strict=True):
            size = max(size, np.linalg.eigvalsh(c @ X @ c.T + d @ d.T)[-1])
            X = a @ X @ a.T + b @ b.T
        # more cycles than the search flew only raise the peak
        assert math.sqrt(size) >= peak.lower * (1 - 1e-6)
    slow = decay_rate(lpv, rate, **SOS, search=QUICK)
    if slow.worst is not None and len(slow.worst.p) > 1:
        within(lpv, rate, slow.worst)
        A = lpv.matrices(slow.worst.p).A
        product = np.linalg.multi_dot([*A[::-1], np.eye(len(A[0]))])
        decay = -math.log(np.abs(np.linalg.eigvals(product)).max()) / (lpv.dt * len(A))
        assert decay == pytest.approx(slow.upper, rel=1e-6)
