"""The search for the worst p(t): exact sensitivities, limits kept to the last digit, and the worst
case known in closed form.
"""

import math

import numpy as np
import pytest
from models import fastest_growth, lateral, random_stable, spring

from synthesis.certify.lower_bounds.ascent import (
    GAIN,
    GROWTH,
    Corners,
    _gradient,
    ascend,
    climb,
    gradient,
    on_nodes,
)
from synthesis.certify.lower_bounds.paths import Wave, steps
from synthesis.certify.lower_bounds.periodic import (
    Lifted,
    gain,
    growth,
    ratio_from_rest,
    worst_input,
)
from synthesis.certify.statement.trajectory import SchedulingTrajectory


def bumpy(lpv, period=4.0, nodes=24):
    s = lpv.scheduling
    phase = 2 * np.pi * np.arange(nodes + 1) / nodes
    spacing = period / nodes if lpv.dt is None else lpv.dt * math.ceil(period / (nodes * lpv.dt))
    return SchedulingTrajectory(
        spacing * np.arange(nodes + 1),
        s.middle + s.radius * (0.5 * np.sin(phase) + 0.2 * np.cos(3 * phase)),
    )


@pytest.mark.parametrize("dt", [None, 0.08])
def test_the_gradient_of_growth_is_its_difference_quotient(dt):
    lpv = random_stable(3, dt=dt)
    cycle = bumpy(lpv)
    direction = np.random.default_rng(1).standard_normal(len(cycle.p))
    direction[-1] = direction[0]
    period = cycle.time[-1]

    def score(eps, stretch=0.0):
        time = cycle.time * (1 + stretch)
        return growth(steps(lpv, time, cycle.p + eps * direction, period)).value / time[-1]

    found, slope = _gradient(lpv, cycle, GROWTH)
    assert found.value == pytest.approx(score(0.0) * period)
    # one-sided differences of 1e-6 inside, central ones of 1e-4 here: 1e-5 of the slope is left
    assert slope[:-1] @ direction[:-1] == pytest.approx(
        (score(1e-4) - score(-1e-4)) / 2e-4, rel=1e-4
    )
    if dt is None:
        assert slope[-1] == pytest.approx((score(0, 1e-4) - score(0, -1e-4)) / 2e-4, rel=1e-4)


@pytest.mark.parametrize("dt", [None, 0.08])
def test_the_gradient_of_the_gain_is_that_of_the_response_to_its_worst_input(dt):
    lpv = random_stable(3, dt=dt)
    cycle = bumpy(lpv)
    system = steps(lpv, cycle.time, cycle.p, cycle.time[-1])
    _, angle, v = worst_input(system)

    def value(p):
        F, G, H, J = Lifted.of(steps(lpv, cycle.time, p, cycle.time[-1]))
        x = np.linalg.solve(np.exp(1j * angle) * np.eye(len(F)) - F, G @ v.ravel())
        return math.log(np.linalg.norm(H @ x + J @ v.ravel()) / np.linalg.norm(v))

    direction = np.random.default_rng(1).standard_normal(len(cycle.p))
    direction[-1] = direction[0]
    found, slope = _gradient(lpv, cycle, GAIN)
    assert found.value == pytest.approx(value(cycle.p), rel=1e-9)
    quotient = (value(cycle.p + 1e-4 * direction) - value(cycle.p - 1e-4 * direction)) / 2e-4
    assert slope[:-1] @ direction[:-1] == pytest.approx(quotient, rel=1e-4)


def test_the_lifted_response_from_rest_is_the_step_by_step_one():
    lpv = random_stable(4)
    cycle = bumpy(lpv)
    system = steps(lpv, cycle.time, cycle.p, cycle.time[-1])
    v = np.random.default_rng(0).standard_normal((3, len(system.step) * 2))
    x, energy = np.zeros(3), 0.0
    for k, vk in enumerate(v.reshape(-1, 2)):
        z = system.step[k % len(system.step)] @ np.concatenate([x, vk])
        x, energy = z[:3], energy + z[3:] @ z[3:]
    assert ratio_from_rest(Lifted.of(system), v, 1)[0] == pytest.approx(
        math.sqrt(energy) / np.linalg.norm(v), rel=1e-12
    )
    assert gain(system).value == pytest.approx(math.log(worst_input(system)[0]), rel=1e-3)


@pytest.mark.slow
def test_the_ascent_reaches_the_fastest_pumping_of_a_spring():
    best = fastest_growth(0.05, 0.6)
    # the pumping wave, a quarter and a tenth off
    wave = Wave(-1.0, 1.0, 3.1, 1.1, 0.0)
    lpv = spring(damping=0.05, change=0.6)
    cycle, value = ascend(
        lpv, math.inf, on_nodes(SchedulingTrajectory(*wave.vertices()), 60, None), GROWTH, 20.0, 40
    )
    # a jump of p takes one of sixty nodes
    assert 0.97 * best < value / cycle.time[-1] < best * (1 + 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [None, 0.05])
def test_the_ascent_keeps_range_and_rate_and_never_loses(dt):
    lpv = spring() if dt is None else spring().discretize(dt)
    for rate in (0.1, 1.0):
        wave = Wave(-0.6, 0.7, 1.0, 0.55, 1.3 / rate)
        start = on_nodes(SchedulingTrajectory(*wave.vertices()), 40, dt)
        for objective in (GROWTH, GAIN):
            before = _gradient(lpv, start, objective)[0].value
            cycle, after = ascend(lpv, rate, start, objective, 60.0, 10)
            scores = [objective.score(v, c.time[-1]) for v, c in ((before, start), (after, cycle))]
            assert scores[1] >= scores[0]
            # one rounding of a difference of nodes
            assert np.all(np.abs(np.diff(cycle.p)) <= rate * np.diff(cycle.time) + 1e-14)
            assert cycle.p.min() >= -1
            assert cycle.p.max() <= 1
            assert cycle.p[0] == cycle.p[-1]
            if dt is not None:
                assert cycle.time / dt == pytest.approx(np.round(cycle.time / dt), abs=1e-9)


@pytest.mark.slow
def test_the_search_finds_more_than_the_waves_it_starts_from():
    from synthesis import lower_bound
    from synthesis.analysis import LowerBoundSearch
    from synthesis.certify.lower_bounds.lower_bound import _TrajectorySearch

    search = LowerBoundSearch(
        levels=6, dwells=5, starts=1, nodes=40, evaluations=15, steps=80, samples=20_000
    )
    lpv = lateral().with_rate(3.0)
    hunt = _TrajectorySearch(lpv, 3.0, search)
    waves = max(
        gain
        for wave in hunt.family.coarse()
        if math.isfinite(gain := hunt.gain(SchedulingTrajectory(*wave.vertices())))
    )
    assert lower_bound(lpv, search=search).gain > 1.02 * waves


@pytest.mark.parametrize("rate", [2.9, math.inf])
@pytest.mark.parametrize("objective", [GROWTH, GAIN])
def test_the_gradient_by_corners_is_its_difference_quotient(rate, objective):
    lpv, rng = random_stable(3), np.random.default_rng(0)
    # lengths away from whole multiples of the longest step, where the number of steps changes
    corners = Corners(np.array([0.1, 0.8, 0.3, 0.9]), np.array([0.53, 0.77, 1.13, 0.34]))
    levels, rests = rng.standard_normal((2, 4))

    def score(h):
        return gradient(
            lpv,
            Corners(corners.levels + h * levels, corners.rests + h * rests),
            rate,
            objective,
            0.1,
        )[0]

    _, of_rests, of_levels = gradient(lpv, corners, rate, objective, 0.1)
    # one-sided differences of 1e-6 inside; the frequency of the gain is held, which is exact to
    # first order only at its peak
    assert of_rests @ rests + of_levels @ levels == pytest.approx(
        (score(1e-6) - score(-1e-6)) / 2e-6, rel=1e-4
    )


def test_corners_reach_the_fastest_pumping_of_a_spring_exactly():
    best = fastest_growth(0.05, 0.6)
    # a fifth off in every way; much further, the multipliers are a complex pair, whose modulus no
    # corner changes
    start = Corners(np.array([-0.7, 0.8]), np.array([2.5, 1.2]))
    lpv = spring(damping=0.05, change=0.6)
    found = climb(lpv, math.inf, start, GROWTH, 0.2, 20.0, 30)
    assert found.levels == pytest.approx([-1.0, 1.0])
    # the steps are exact, since p is constant between its corners; 1e-6: the quadrature behind
    # `best` has 4000 points
    assert gradient(lpv, found, math.inf, GROWTH, 0.2)[0] == pytest.approx(best, rel=1e-6)


@pytest.mark.slow
def test_a_bound_by_jumps_is_flown_as_it_is_reported():
    from test_order_of_bounds import response

    from synthesis import lower_bound
    from synthesis.analysis import LowerBoundSearch

    lpv = spring(damping=0.4)
    found = lower_bound(
        lpv,
        math.inf,
        search=LowerBoundSearch(
            levels=4, dwells=7, starts=1, nodes=20, evaluations=8, steps=60, samples=3000
        ),
    )
    time, p = found.trajectory
    assert np.any(np.diff(p)[np.diff(time) == 0] != 0)
    energy = response(lpv, time, p, found.input, np.zeros((2, 1)), 0.02)[1]
    # as in test_order_of_bounds: the last input sample is left out
    assert math.sqrt(energy / np.sum(found.input[:-1, 0] ** 2 * np.diff(time))) == pytest.approx(
        found.gain, rel=1e-3
    )
    assert found.gain > 1.1 * lower_bound(lpv, 0.0).gain


@pytest.mark.slow
def test_a_slow_p_is_given_the_time_to_cross_its_range():
    """x' = -x + (2 - p) u, y = (1 + p) x, rate 0.01: 2.25 frozen, 2.25441 in truth, by a cycle much
    longer than the model's own time.
    """
    from test_reference_cases import scalar

    from synthesis import lower_bound
    from synthesis.analysis import LowerBoundSearch

    quick = LowerBoundSearch(
        levels=4, dwells=4, starts=1, nodes=40, evaluations=6, steps=120, samples=20_000
    )
    found = lower_bound(scalar(0.01), search=quick)
    # three times the slowest mode, 19 s, leave 2.2507; what was reached here, rounded down
    assert 2.2525 < found.gain < 2.25441
    assert np.ptp(found.trajectory.p) > 0.01 * 19


@pytest.mark.slow
def test_a_p_that_may_jump_is_never_better_than_one_with_a_limit():
    from synthesis import lower_bound
    from synthesis.analysis import LowerBoundSearch

    quick = LowerBoundSearch(
        levels=4, dwells=7, starts=1, nodes=40, evaluations=12, steps=80, samples=4000
    )
    gains = [
        lower_bound(spring(damping=0.4), rate, search=quick).gain for rate in (1.0, 3.0, math.inf)
    ]
    assert gains == sorted(gains)
