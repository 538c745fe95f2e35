"""The rate of one parameter is another: dV/dt = a, |da/dt| <= jerk."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from symheli import LPVStateSpace, Scheduling
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.tools import simulate
from synthesis import l2_gain, stability
from synthesis.analysis import LowerBoundSearch, Status, energy_to_peak
from synthesis.certify.lower_bounds.paths import Wave
from synthesis.certify.lower_bounds.tied import Smooth
from synthesis.certify.questions.certificate import Certificate
from synthesis.forms import Spline
from synthesis.impose import Bernstein
from synthesis.numerics.polynomial.motion import Motion

TOP = 0.3
JERKS = (math.inf, 10.0, 1.0, 0.3, 0.1)
ALONE, BOTH = Spline(degree=3, segments=6), Spline(degree=(3, 2), segments=((6, 1),))
QUICK = LowerBoundSearch(seconds=math.inf)


def stiffening(dt=None):
    """A spring that stiffens with V: one parameter, |dV/dt| <= TOP."""
    V = Scheduling("V", "m/s", 0.0, 1.0, rate=TOP)
    A = [[[0.0, 1.0], [-1.0, -0.2]], [[0.0, 0.0], [-1.0, 0.0]]]
    lpv = LPVStateSpace.polynomial(A, [[[0.0], [1.0]]], [[[1.0, 0.0]]], [[[0.0]]], V)
    return lpv if dt is None else lpv.discretize(dt, degree=2)


def tied(jerk, dt=None, slope=0.0):
    """The same in (V, a); `slope`: how far a acts on the spring."""
    V = Scheduling("V", "m/s", 0.0, 1.0, rate="a")
    a = Scheduling("a", "m/s^2", -TOP, TOP, rate=jerk)
    A = {(0, 0): [[0.0, 1.0], [-1.0, -0.2]], (1, 0): [[0.0, 0.0], [-1.0, 0.0]]}
    A[0, 1] = [[0.0, 0.0], [-slope, 0.0]]
    B, C, D = {(0, 0): [[0.0], [1.0]]}, {(0, 0): [[1.0, 0.0]]}, {(0, 0): [[0.0]]}
    lpv = LPVStateSpace.polynomial(A, B, C, D, [V, a])
    return lpv if dt is None else lpv.discretize(dt, degree=(2, 2 if slope else 0))


@pytest.fixture(scope="module")
def gains():
    return [l2_gain(tied(jerk), form=BOTH, search=None) for jerk in JERKS]


@pytest.mark.slow
def test_the_gain_does_not_increase_as_the_jerk_falls(gains):
    found = [cert.gamma for cert in gains]
    assert all(cert.verified for cert in gains)
    # the bounds are loosened by 1e-6 of gamma^2 until they are verified
    assert all(less <= more * (1 + 2e-6) for more, less in pairwise(found))
    assert found[-1] < 0.7 * found[0]


@pytest.mark.slow
def test_it_never_exceeds_the_gain_where_the_rate_is_bounded_alone_and_equals_it_at_infinite_jerk(
    gains,
):
    alone = l2_gain(stiffening(), form=ALONE, search=None).gamma
    assert gains[0].gamma == pytest.approx(alone, rel=1e-3)
    assert all(cert.gamma <= alone * (1 + 2e-6) for cert in gains)


@pytest.mark.slow
@pytest.mark.parametrize("jerk", [math.inf, pytest.param(1.0, marks=pytest.mark.slow), 0.3])
def test_what_is_found_from_below_keeps_to_rate_and_jerk_and_does_not_beat_the_proof(jerk):
    cert = l2_gain(tied(jerk, slope=0.3), form=BOTH, search=QUICK)
    assert cert.frozen <= cert.lower <= cert.gamma
    if cert.worst is None:
        return
    time, p = cert.worst
    rate, jolt = np.diff(p[:, 0]) / np.diff(time), np.diff(p[:, 1]) / np.diff(time)
    assert np.abs(p[:, 1]).max() <= TOP * (1 + 1e-9)
    # differences of a smooth V are means of its rate
    slack = np.abs(jolt).max() * np.diff(time).max() if math.isfinite(jerk) else TOP
    assert np.abs(rate - 0.5 * (p[1:, 1] + p[:-1, 1])).max() <= slack
    if math.isfinite(jerk):
        assert np.abs(jolt).max() <= jerk * (1 + 1e-6)
        assert cert.lower > 1.01 * cert.frozen


@pytest.mark.slow
def test_a_cycle_along_which_the_state_grows_is_shown_as_it_moves():
    """Unstable while V moves, stable at rest."""
    V = Scheduling("V", "1", 0.0, 1.0, rate="a")
    a = Scheduling("a", "1/s", -0.3, 0.3, rate=3.0)
    A = {(0, 0): [[-0.01]], (0, 2): [[10.0]]}
    B, C, D = {(0, 0): [[1.0]]}, {(0, 0): [[1.0]]}, {(0, 0): [[0.0]]}
    cert = l2_gain(LPVStateSpace.polynomial(A, B, C, D, [V, a]), form=BOTH, search=QUICK)
    assert cert.status is Status.GROWING
    time, p = cert.worst
    assert np.ptp(p[:, 0]) > 0.05
    moved = np.concatenate([[0.0], np.cumsum(np.diff(time) * 0.5 * (p[1:, 1] + p[:-1, 1]))])
    # the trapezoid rule over steps in which a bends
    np.testing.assert_allclose(p[:, 0] - p[0, 0], moved, atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("flip", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_helicopter_that_brakes_less_than_it_accelerates_is_searched_as_hard_as_it_brakes(flip):
    V = Scheduling("V", "m/s", 0.0, 1.0, rate="a")
    a = Scheduling("a", "m/s^2", -0.05, 0.6, rate=2.0)
    given = {
        "A": {(0, 0): [[0, 1], [-1, -0.2]], (1, 0): [[0, 0], [-1, 0]], (0, 1): [[0, 0], [-0.3, 0]]},
        "B": {(0, 0): [[0], [1]]},
        "C": {(0, 0): [[1, 0]]},
        "D": {(0, 0): [[0]]},
    }
    order, form = [V, a], Spline(degree=(3, 2), segments=((6, 1),))
    if flip:
        given = {name: {e[::-1]: M for e, M in terms.items()} for name, terms in given.items()}
        order, form = [a, V], Spline(degree=(2, 3), segments=((1, 6),))
    cert = l2_gain(LPVStateSpace.polynomial(**given, scheduling=order), form=form, search=QUICK)
    assert cert.frozen < cert.lower <= cert.gamma
    p = cert.worst.p[:, order.index(V)]
    assert np.abs(np.diff(p) / np.diff(cert.worst.time)).max() <= 0.05 * (1 + 1e-6)


@pytest.mark.slow
def test_sampled_the_bound_is_below_that_of_the_rate_alone_and_above_what_a_flight_can_reach():
    form = Spline(degree=(2, 1), segments=((1, 1),))
    alone = l2_gain(stiffening(0.1), form=Spline(degree=2, segments=1), search=None)
    cert = l2_gain(tied(0.5, 0.1), form=form, search=QUICK)
    assert cert.verified
    assert cert.frozen < cert.lower <= cert.gamma < 0.99 * alone.gamma
    V, a = cert.worst.p.T
    # every step, also from one cycle to the next
    assert np.abs(np.diff(V) - 0.1 * a[:-1]).max() <= 0.5 * 0.1**2 / 2 * (1 + 1e-6)
    assert np.abs(np.diff(a)).max() <= 0.5 * 0.1 * (1 + 1e-6)


@pytest.mark.slow
def test_no_random_input_along_the_worst_trajectory_beats_the_proof():
    cert = l2_gain(tied(1.0, slope=0.3), form=BOTH, search=QUICK)
    time, p = cert.worst
    h = np.diff(time)
    assert np.ptp(h) < 1e-9
    lpv = tied(1.0, slope=0.3)
    rng = np.random.default_rng(0)
    n = min(len(p), 20_000)
    u = np.repeat(rng.standard_normal((n // 40 + 1, 1)), 40, axis=0)[:n]
    _, y = simulate(lpv, p[:n], u, dt=float(h[0]))
    assert np.linalg.norm(y) / np.linalg.norm(u) < cert.gamma


def test_a_smoothed_trapezoid_keeps_range_rate_and_jerk():
    wave = Wave(bottom=0.2, top=0.9, dwell_bottom=0.4, dwell_top=0.7, ramp=0.7 / TOP)
    path = Smooth(wave, window=2 * TOP / 0.5)
    t = np.linspace(0.0, 3 * wave.period, 6001)
    p, rate = path.at(t)
    assert p.min() >= 0.2 - 1e-12
    assert p.max() <= 0.9 + 1e-12
    assert np.abs(rate).max() <= TOP * (1 + 1e-12)
    np.testing.assert_allclose(np.gradient(p, t)[1:-1], rate[1:-1], atol=1e-3)
    assert np.abs(np.diff(rate) / np.diff(t)).max() <= 0.5 * (1 + 1e-9)
    np.testing.assert_allclose(path.at(t[:10] + wave.period)[0], p[:10], atol=1e-12)


def test_sampled_steps_hold_every_next_airspeed_a_flight_can_reach():
    motion, dt = Motion.of(tied(2.0, 0.1).parameters), 0.1
    rng = np.random.default_rng(1)
    for a in rng.uniform(-TOP, TOP, 200):
        back, on = motion.span(0, [(0.0, 1.0), (a, a)], dt)
        # the largest and the least change while |da/dt| <= jerk and |a| <= TOP
        for sign in (-1, 1):
            t = np.linspace(0, dt, 200)
            path = np.clip(a + sign * 2.0 * t, -TOP, TOP)
            moved = np.trapezoid(path, t)
            assert back - 1e-9 <= moved <= on + 1e-9


def test_what_cannot_be_reached_is_left_out_and_nothing_else():
    motion = Motion.of(tied(0.5).parameters)
    rng = np.random.default_rng(2)
    for V, a in zip(rng.uniform(0, 1, 300), rng.uniform(-TOP, TOP, 300), strict=True):
        room = V if a < 0 else 1 - V  # stopping at full jerk takes a^2/(2 jerk)
        assert motion.reaches([(V, V), (a, a)]) == (a * a <= 2 * 0.5 * room * (1 + 1e-9))


@pytest.mark.slow
def test_the_exact_proof_holds_and_the_file_proves_itself(tmp_path):
    cert = l2_gain(tied(1.0), form=BOTH, search=None)
    assert cert.verify(rigorous=True)
    again = Certificate.load(cert.save(tmp_path / "tied.json"))
    assert again.verify(rigorous=True)
    said = " ".join(again.hypotheses)
    assert "dV/dt is a, which keeps to what lets V stay in that range" in said
    assert "|da/dt| <= 1" in said


@pytest.mark.slow
def test_a_proof_for_less_jerk_is_none_for_more():
    cert = l2_gain(tied(0.1), form=BOTH, search=None)
    evidence = cert.proof.evidence
    jerkier = evidence._replace(
        demand=evidence.demand._replace(motion=evidence.demand.motion._replace(rates=(TOP, 10.0)))
    )
    assert not jerkier.floating(cert.proof.lyapunov, cert.gamma)
    free = evidence._replace(
        demand=evidence.demand._replace(motion=evidence.demand.motion._replace(ties=(None, None)))
    )
    assert "do not move as those of the proof" in replace_fault(cert, free)


def replace_fault(cert, evidence):
    return str(evidence.fault(cert.proof.lyapunov, cert.kind, cert.rates))


@pytest.mark.slow
def test_stability_and_what_is_refused():
    assert stability(tied(0.1), form=BOTH).verified
    with pytest.raises(InputError, match="a range with 0 inside"):
        l2_gain(
            replace(
                tied(1.0),
                parameters=(
                    Scheduling("V", "m/s", 0.0, 1.0, rate="a"),
                    Scheduling("a", "m/s^2", 0.1, TOP, rate=1.0),
                ),
            )
        )
    with pytest.raises(UnknownNameError, match="jolt"):
        l2_gain(tied(1.0), {"V": "jolt"})


@pytest.mark.slow
def test_a_number_for_the_rate_takes_the_tie_away():
    free = l2_gain(tied(1.0), {"V": TOP}, form=BOTH, search=None)
    bound = l2_gain(tied(1.0), form=BOTH, search=None)
    assert free.gamma > 1.02 * bound.gamma
    assert "|dV/dt| <= 0.3" in " ".join(free.hypotheses)


@pytest.mark.slow
def test_peaks_are_proven_too():
    found = [energy_to_peak(tied(j), form=BOTH, search=None).gamma for j in (math.inf, 0.3)]
    assert found[1] < found[0]


@pytest.mark.slow
def test_the_form_may_differ_by_parameter():
    with pytest.raises(InputError, match="expected one for each of 2"):
        l2_gain(tied(1.0), form=Spline(degree=(3, 2, 1)), search=None)
    cert = l2_gain(tied(1.0), form=Spline(degree=(2, 1)), impose=Bernstein(), search=None)
    assert cert.status is Status.PROVEN
    assert cert.lyapunov.degrees == (2, 1)
