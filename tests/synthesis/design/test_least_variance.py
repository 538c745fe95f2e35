"""Output feedback of the least variance: against the H2 optimum of frozen models, along
trajectories, and a published design.
"""

import math

import numpy as np
import pytest
from published_plants import noisy_spinning_disks
from scipy import linalg

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError
from synthesis import Plant, h2, h2_gain, multiobjective
from synthesis.design.lti.h2 import h2_norm
from synthesis.impose import SumOfSquares
from synthesis.objectives import H2


def unstable_lag(rate, high=1.0):
    """x' = (2 p - 1) x + w + u, measured with noise, control and state both cost."""
    p = Scheduling("p", "1", 0.0, high, rate=rate)
    model = LPVStateSpace.polynomial(
        A=[[[-1.0, 1.0], [0.0, -3.0]], [[2.0, 0.0], [0.0, 1.0]]],
        B=[[[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]],
        C=[[[1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]],
        D=[[[0, 0, 0], [0, 0, 0.7], [0, 0.2, 0.1]]],
        scheduling=p,
        inputs=["w", "noise", "u"],
        outputs=["z_x", "z_u", "y"],
    )
    return Plant(
        model,
        disturbances=["w", "noise"],
        performance=["z_x", "z_u"],
        controls=["u"],
        measurements=["y"],
    )


def frozen_optimum(plant, p):
    named = plant.channels
    return h2(
        plant.nominal.at(p),
        named.controls,
        named.measurements,
        disturbances=named.disturbances,
        performance=named.performance,
    ).optimum


@pytest.fixture(scope="module")
def slow():
    return multiobjective(unstable_lag(0.2), H2())


@pytest.mark.slow
def test_of_one_model_it_is_the_h2_optimum():
    plant = unstable_lag(0.0, high=1e-6)
    made = multiobjective(plant, H2(), X=0, Y=0)
    best = frozen_optimum(plant, 0.0)
    assert made.optimum == pytest.approx(best, rel=1e-4)  # of the solver: 1e-5 of the square
    assert made.promised <= 1.02 * made.optimum


@pytest.mark.slow
def test_at_rest_it_comes_near_the_worst_frozen_optimum():
    plant = unstable_lag(0.0)
    worst = max(frozen_optimum(plant, p) for p in np.linspace(0.0, 1.0, 11))
    made = multiobjective(plant, H2())
    # a higher degree of X and Y is not tried within 1 %, the first back-off is 2 %
    assert worst * (1 - 1e-6) <= made.optimum <= 1.01 * worst
    loop = made.closed()
    for p in np.linspace(0.0, 1.0, 11):
        assert h2_norm(loop.at(p)) <= made.promised * (1 + 1e-5)


@pytest.mark.slow
def test_it_costs_more_the_faster_p_moves(slow):
    optima = [multiobjective(unstable_lag(rate), H2()).optimum for rate in (0.0, math.inf)]
    assert optima[0] <= slow.optimum <= optima[1]


@pytest.mark.slow
def test_the_mean_power_along_a_trajectory_stays_below_the_promise(slow):
    """dQ/dt = A Q + Q A' + B B' by small steps, p up and down at full rate."""
    loop, step = slow.closed(), 0.01
    (rate,) = (s.rate for s in loop.parameters)
    n = len(loop.states)
    Q, total, count = np.zeros((n, n)), 0.0, 10000  # five times up and down
    for k in range(count):
        phase = (k * step * rate) % 2.0
        A, B, C, _ = loop.matrices(min(phase, 2.0 - phase))
        whole = linalg.expm(step * np.block([[-A, B @ B.T], [np.zeros((n, n)), A.T]]))
        Phi = whole[n:, n:].T
        Q = Phi @ Q @ Phi.T + Phi @ whole[:n, n:]
        total += float(np.trace(C @ Q @ C.T))
    assert math.sqrt(total / count) <= slow.promised


@pytest.mark.slow
def test_it_is_certified_between_the_points(slow):
    cert = h2_gain(slow.closed(), search=None)
    assert cert.verified
    # the variance at the worst time, which is more than the mean power that was minimised
    assert slow.optimum * 0.98 <= cert.gamma <= 1.1 * slow.promised


@pytest.mark.slow
def test_functions_of_ones_own_are_taken_and_bad_ones_refused():
    made = multiobjective(unstable_lag(0.2), H2(), X=0, Y=1)
    assert "X constant, Y of degree 1" in made.method
    with pytest.raises(InputError, match="Y cannot depend on p, which may jump"):
        multiobjective(unstable_lag(math.inf), H2(), Y=1)


@pytest.mark.slow
def test_the_disks_whose_speeds_jump():
    """LPVTools prints 1.5998, and 1.5506 for the worst frozen loop."""
    made = multiobjective(noisy_spinning_disks(math.inf), H2())
    assert 1.55 < made.optimum <= made.promised <= 1.5998
    loop = made.closed()
    points = [(a, b) for a in (0.0, 4.5, 9.0) for b in (0.0, 12.5, 25.0)]
    assert max(h2_norm(loop.at(*p)) for p in points) == pytest.approx(1.5506, rel=1e-3)
    # 14 states: by Bernstein coefficients the solver runs out of digits
    proven = h2_gain(loop, impose=SumOfSquares(), search=None)
    assert proven.verified
    assert made.optimum < proven.gamma < 1.8
