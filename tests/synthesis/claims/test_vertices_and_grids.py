"""Claims by V = x'Px about vertices and grids, against closed forms and independent arithmetic."""

import math

import mpmath
import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

from symheli.errors import InputError
from synthesis.claims import GridPlant, LyapunovClaim, VertexPlant, check
from synthesis.claims.lyapunov import holds, judged

PROVEN, BY_ANOTHER = "proven", "this P does not prove it"
FALSE, OPEN = "the claim is false", "not decided"
GOLDEN = np.array([[[1.0, 1.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0]]])
"""Joint spectral radius (1 + sqrt 5)/2, which is the norm of both: P = I proves all below."""
SENAME = VertexPlant([[[0, 1], [-1, -2]], [[0, 1], [-100, -20]]])


def answer(plant, claim, **more):
    return check(plant, claim, **more).answer


@pytest.mark.parametrize("dt", [None, 0.1])
def test_random_pairs_are_judged_as_eigenvalues_say_where_these_are_clear(dt):
    rng, decided = np.random.default_rng(0), set()
    for _ in range(40):
        A = rng.normal(size=(2, 3, 3)) - (0 if dt else 1.2) * np.eye(3)
        A = A / (2.2 if dt else 1.0)
        if max(np.abs(np.linalg.eigvals(A[0])).max() if dt else
               np.linalg.eigvals(A[0]).real.max(), 0) > (0.98 if dt else 0):  # fmt: skip
            continue
        solver = solve_discrete_lyapunov if dt else solve_continuous_lyapunov
        P = solver(A[0].T, np.eye(3) if dt else -np.eye(3))
        P = np.round((P + P.T) / 2, 12)
        forms = [P, *(P - M.T @ P @ M if dt else -(M.T @ P + P @ M) for M in A)]
        least = min(np.linalg.eigvalsh(F)[0] for F in forms)
        found = judged(VertexPlant(A, dt=dt), LyapunovClaim("stability", P))[0]
        assert abs(least) > 1e-9
        assert found == (PROVEN if least > 0 else BY_ANOTHER)
        decided.add(found)
    assert decided == {PROVEN, BY_ANOTHER}


def test_the_direction_of_a_failure_contradicts_the_inequality():
    P = np.array([[2.0, 1.0], [1.0, 1.0]])
    place = judged(SENAME, LyapunovClaim("stability", P))[2]
    A, x = SENAME.A[int(place.p) - 1], place.x
    assert x @ (A.T @ P + P @ A) @ x > 0


def test_the_golden_pair_is_stable_up_to_its_spectral_radius_and_not_beyond():
    claim, radius = LyapunovClaim("stability", np.eye(2)), (1 + 5**0.5) / 2
    below, above = (VertexPlant(GOLDEN * s / radius, dt=1.0) for s in (1 - 1e-9, 1 + 1e-6))
    assert answer(below, claim) == PROVEN
    found = check(above, claim)
    assert (found.answer, found.exact) == (FALSE, True)
    # the motion shown is one of the plant, and does not fall
    for k, p in enumerate(found.motion.p[:-1]):
        np.testing.assert_allclose(found.motion.x[k + 1], above.A[int(p) - 1] @ found.motion.x[k])
    assert np.linalg.norm(found.motion.x[-1]) > np.linalg.norm(found.motion.x[0])


def test_a_product_with_an_eigenvalue_one_contradicts_stability():
    """{[0 1; 0 0], [0 0; 1 0]}: spectral radius 1, and P = I holds with equality."""
    pair = VertexPlant([[[0, 1], [0, 0]], [[0, 0], [1, 0]]], dt=1.0)
    assert answer(pair, LyapunovClaim("stability", np.eye(2)), refute=False) == OPEN
    assert answer(pair, LyapunovClaim("stability", np.eye(2))) == FALSE
    smaller = VertexPlant(0.999999 * pair.A, dt=1.0)
    assert answer(smaller, LyapunovClaim("stability", np.eye(2))) == PROVEN


def test_the_pair_of_ando_and_shih_needs_a_p_of_each_vertex_above_one_over_root_two():
    """s {[1 0; 1 0], [0 1; 0 -1]} is stable up to s = 1. A common P needs 2 s^2 (p11 + p22) < p11 +
    p22 (Ando and Shih, SIAM J. Control and Optimization 36, 1998): s < 1/sqrt 2, where P = I proves
    it.
    """
    pair = np.array([[[1.0, 0.0], [1.0, 0.0]], [[0.0, 1.0], [0.0, -1.0]]])
    one = LyapunovClaim("stability", np.eye(2))
    ends = [holds(VertexPlant(s * pair, dt=1.0), one) for s in (0.7071, 0.7072)]
    assert ends == [True, False]
    assert answer(VertexPlant(0.99 * pair, dt=1.0), one) == BY_ANOTHER
    each = LyapunovClaim("stability", [np.diag([1.0, 0.01]), np.diag([0.01, 1.0])])
    assert answer(VertexPlant(0.99 * pair, dt=1.0), each) == PROVEN
    assert answer(VertexPlant(pair, dt=1.0), each) == FALSE


def test_two_modes_of_senames_book_have_no_common_p_and_it_is_said_exactly():
    found = check(SENAME, LyapunovClaim("stability", [[2, 1], [1, 1]]), refute=False)
    assert found.answer == BY_ANOTHER
    assert "No constant P at all" in found.reason
    assert np.linalg.eigvals(SENAME.A[0] @ SENAME.A[1]).real.max() < 0


def test_an_unstable_convex_combination_is_found():
    """Both modes are stable, their mean is not."""
    modes = VertexPlant([[[-1.0, 10.0], [0.0, -1.0]], [[-1.0, 0.0], [10.0, -1.0]]])
    found = check(modes, LyapunovClaim("stability", np.eye(2)))
    assert (found.answer, found.exact) == (FALSE, True)


def test_a_motion_of_p_that_makes_a_stable_oscillator_grow_is_flown_by_two_integrators():
    plant = GridPlant([0, 1], [[[0, 1], [-1, -0.1]], [[0, 1], [-3, -0.1]]])
    found = check(plant, LyapunovClaim("stability", [[2.0, 0.1], [0.1, 1.0]]))
    assert (found.answer, found.exact) == (FALSE, False)
    assert np.linalg.norm(found.motion.x[-1]) > 2 * np.linalg.norm(found.motion.x[0])


@pytest.mark.parametrize(("gamma", "expected"), [(1.0001, PROVEN), (0.9999, FALSE)])
def test_the_gain_of_a_lag_is_that_at_rest(gamma, expected):
    """1/(s + 1 + p), p in [0, 1]: exactly 1, by P = 1."""
    plant = GridPlant([0, 1], [[[-1.0]], [[-2.0]]], [[1.0]], [[1.0]], rate=1.0)
    found = check(plant, LyapunovClaim("l2 gain", [[1.0]], gamma))
    assert (found.answer, found.exact) == (expected, True)


def test_what_a_p_proves_instead_is_named():
    plant = GridPlant([0, 1], [[[-1.0]], [[-2.0]]], [[1.0]], [[1.0]], rate=1.0)
    found = check(plant, LyapunovClaim("l2 gain", [[2.0]], 1.01), refute=False)
    assert found.answer == BY_ANOTHER
    # -2 P + 1 + P^2/g^2 < 0 at P = 2: g > 2/sqrt 3
    assert found.proves == pytest.approx(2 / 3**0.5, rel=1e-6)


@pytest.mark.parametrize(("rate", "expected"), [(0.99, PROVEN), (1.0, OPEN), (1.01, BY_ANOTHER)])
def test_the_rate_of_p_is_that_which_p_allows(rate, expected):
    """x' = -x, P from 1 to 3 along p: 2 P > dP/dt = 2 rate at P = 1."""
    plant = GridPlant([0, 1], [[[-1.0]], [[-1.0]]], rate=rate)
    claim = LyapunovClaim("stability", [[[1.0]], [[3.0]]])
    assert answer(plant, claim, refute=False) == expected


@pytest.mark.parametrize("ends", [(1.0, 3.0), (3.0, 1.0)])
def test_p_may_move_to_either_side(ends):
    plant = GridPlant([0, 1], [[[-1.0]], [[-1.0]]], rate=1.01)
    claim = LyapunovClaim("stability", np.reshape(ends, (2, 1, 1)))
    assert answer(plant, claim, refute=False) == BY_ANOTHER


@pytest.mark.parametrize(("gamma", "expected"), [(2.0001, True), (1.9999, False)])
def test_a_sampled_gain_counts_what_an_input_adds_to_v(gamma, expected):
    """x+ = x/2 + u, y = x: gain 2, by P = 2 alone: (2 - g^2)(P a^2 - P + 1) > (a P)^2."""
    plant = VertexPlant([[0.5]], [[1.0]], [[1.0]], dt=1.0)
    assert holds(plant, LyapunovClaim("l2 gain", [[2.0]], gamma)) == expected


@pytest.mark.parametrize(("rate", "expected"), [(0.19, True), (0.21, False)])
def test_a_step_of_p_is_its_rate_times_the_period(rate, expected):
    """x+ = x/sqrt(1.1), P = 1 + p, two samples a second: P(p + rate/2) < 1.1 P(p) at p = 0."""
    a = 1.1**-0.5
    plant = GridPlant([0, 1], [[[a]], [[a]]], rate=rate, dt=0.5)
    assert holds(plant, LyapunovClaim("stability", [[[1.0]], [[2.0]]])) == expected


def test_p_that_may_jump_leaves_a_moving_p_undecided():
    plant = GridPlant([0, 1], [[[-1.0]], [[-1.0]]])
    found = check(plant, LyapunovClaim("stability", [[[1.0]], [[1.5]]]))
    assert found.answer == OPEN
    assert "give rate" in found.reason


def test_a_failure_between_the_points_of_a_grid_is_found():
    """a(p) = 1/2 - 2 (2 p - 1)^2: stable at both points, unstable at their middle."""
    plant = GridPlant([0, 1], [[[0.5]]] * 2, [[[-1.0]], [[1.0]]], rate=0.0)
    found = check(plant, LyapunovClaim("stability", [[1.0]], K=[[[2.0]], [[-2.0]]]))
    assert (found.answer, found.exact) == (FALSE, True)
    assert 0.2 < found.place.p < 0.8


def test_the_sampled_grid_looks_at_every_reachable_successor():
    """Against a fine grid of (p, p+), on which the least margin is clear of zero."""
    rng, seen = np.random.default_rng(1), set()
    p = np.array([0.0, 0.7, 2.0])
    for _ in range(20):
        A, P = rng.uniform(0.4, 1.0, 3), rng.uniform(0.8, 1.3, 3)
        step = float(rng.choice([0.1, 0.5, 3.0]))
        plant = GridPlant(p, A.reshape(3, 1, 1), rate=step, dt=1.0)
        here = np.linspace(0, 2, 401)
        q = np.clip(here[:, None] + np.linspace(-step, step, 401), 0, 2)
        a, now = np.interp(here, p, A), np.interp(here, p, P)
        least = (now[:, None] - a[:, None] ** 2 * np.interp(q, p, P)).min()
        if abs(least) > 1e-3:
            found = holds(plant, LyapunovClaim("stability", P.reshape(3, 1, 1)))
            assert found == (least > 0)
            seen.add(found)
    assert seen == {True, False}


def test_a_decay_rate_that_is_met_with_equality_is_proven():
    plant = VertexPlant([[[-1.0]]])
    assert answer(plant, LyapunovClaim("decay rate", [[1.0]], 1.0)) == PROVEN
    assert answer(plant, LyapunovClaim("decay rate", [[1.0]], np.nextafter(1.0, 2.0))) != PROVEN


def test_the_cancellation_of_senames_feedback_is_kept():
    """F = [r^2 - 1, -2 - 2 r] at r = 1 and 10 gives [0 1; -1 -2] for both: a decay rate of 1/2."""
    rho = np.array([1.0, 10.0])
    A = np.array([[[0, 1], [-(r**2), 2 * r]] for r in rho])
    K = np.array([[[r**2 - 1, -2 - 2 * r]] for r in rho])
    plant = VertexPlant(A, [[0.0], [1.0]])
    P = solve_continuous_lyapunov(np.array([[0.5, 1], [-1, -1.5]]).T, -np.eye(2))
    claim = LyapunovClaim("decay rate", np.round((P + P.T) / 2, 6), 0.5, K=K)
    assert answer(plant, claim) == PROVEN


def test_units_of_states_and_of_v_do_not_move_the_answer():
    A, P = np.array([[-1.0, 4.0], [-1.0, -1.0]]), np.array([[1.0, 0.2], [0.2, 3.0]])
    for size in (1.0, 2.0**40, 2.0**-40):
        T = np.diag([size, 1.0])
        own = np.linalg.inv(T) @ A @ T, T @ P @ T / size
        assert answer(VertexPlant(own[0]), LyapunovClaim("stability", own[1])) == PROVEN


def test_a_decay_rate_that_is_met_with_equality_is_not_said_to_have_no_p():
    """P = I proves 1/2 of turning at any speed, with equality; diag(1, 2) does not."""
    J = np.array([[0.0, 1.0], [-1.0, 0.0]])
    plant = VertexPlant([-0.5 * np.eye(2) + J, -0.5 * np.eye(2) + 2 * J])
    assert answer(plant, LyapunovClaim("decay rate", np.eye(2), 0.5)) == PROVEN
    found = check(plant, LyapunovClaim("decay rate", np.diag([1.0, 2.0]), 0.5))
    assert found.answer == BY_ANOTHER
    assert "No constant P" not in found.reason


def test_a_sampled_decay_rate_that_is_met_to_a_digit_is_not_called_false():
    """exp(-100) rounded down decays by 100 a sample, where exp(100) is rounded too."""
    slow = math.nextafter(math.exp(-100.0), 0.0)
    assert mpmath.mpf(slow) < mpmath.exp(-100)
    plant = VertexPlant([[[slow]], [[slow]]], dt=1.0)
    assert answer(plant, LyapunovClaim("decay rate", [[1.0]], 100.0)) != FALSE


def test_a_feedback_of_each_vertex_says_what_a_combination_is():
    plant = VertexPlant([[[1.0]], [[2.0]]], [[[1.0]], [[2.0]]])
    several = check(plant, LyapunovClaim("stability", [[1.0]], K=[[[-2.0]], [[-2.0]]]))
    one = check(plant, LyapunovClaim("stability", [[1.0]], K=[[-2.0]]))
    assert (several.answer, one.answer) == (PROVEN, PROVEN)
    assert "combination of their closed loops" in several.hypotheses[-1]
    assert "closed loops" not in one.hypotheses[-1]


WRONG = {
    "not symmetric": lambda: LyapunovClaim("stability", [[1, 2], [0, 1]]),
    "expected a claim of": lambda: LyapunovClaim("passivity", [[1]]),
    "bound": lambda: LyapunovClaim("l2 gain", [[1]]),
    "number > 0": lambda: LyapunovClaim("l2 gain", [[1]], 0.0),
    "rate of at most": lambda: check(
        VertexPlant([[0.5]], dt=1.0), LyapunovClaim("decay rate", [[1]], 1e6)
    ),
    "expected square": lambda: LyapunovClaim("stability", [[1, 2]]),
    "ascending": lambda: GridPlant([1, 0], [[[-1]], [[-1]]]),
    "rate": lambda: GridPlant([0, 1], [[[-1]], [[-1]]], rate=-1),
    "one or more square": lambda: VertexPlant(np.zeros((0, 2, 2))),
    "in any way": lambda: check(SENAME, LyapunovClaim("stability", [np.eye(2)] * 2)),
    "from inputs to outputs": lambda: check(SENAME, LyapunovClaim("l2 gain", np.eye(2), 1)),
    "P: expected 2 x 2": lambda: check(SENAME, LyapunovClaim("stability", np.eye(3))),
    "is not known": lambda: check(SENAME, None),
}


@pytest.mark.parametrize("said", WRONG)
def test_wrong_input_is_told_in_a_sentence(said):
    with pytest.raises(InputError, match=said):
        WRONG[said]()
