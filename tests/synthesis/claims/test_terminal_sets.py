"""Terminal sets and costs of a double integrator, against closed forms and sampled motions."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from symheli.errors import InputError
from synthesis.checker import report
from synthesis.claims import LimitedPlant, TerminalClaim, check
from synthesis.claims.plants import box_limits

PROVEN, BY_ANOTHER, FALSE = "proven", "this P does not prove it", "the claim is false"
A, B = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[0.5], [1.0]])
Q, R = np.eye(2), np.array([[0.1]])
RICCATI = solve_discrete_are(A, B, Q, R)
RICCATI = (RICCATI + RICCATI.T) / 2
K = -np.linalg.solve(R + B.T @ RICCATI @ B, B.T @ RICCATI @ A)
LOOP = A + B @ K
PLANT = LimitedPlant(A, B, **box_limits([5, 5], [1]))
ABOVE = RICCATI * (1 + 2**-20)
LARGEST = 1 / float((K @ np.linalg.inv(ABOVE) @ K.T)[0, 0])
"""Level at which x'Px <= c touches |Kx| = 1, which comes before the limits of x."""


def of_level(level, P=ABOVE, **more):
    return check(PLANT, TerminalClaim(K=K, P=P, level=level, **more))


def test_an_ellipsoid_is_terminal_up_to_the_level_at_which_it_touches_a_limit():
    assert of_level(LARGEST * (1 - 1e-12)).answer == PROVEN
    found = of_level(LARGEST * (1 + 1e-12))
    assert found.answer == FALSE
    x = found.place.x
    assert x @ ABOVE @ x <= LARGEST * (1 + 2e-12)
    assert abs((K @ x)[0]) > 1 - 1e-12


def test_the_cost_of_a_rounded_riccati_equation_is_short_by_its_rounding_alone():
    found = of_level(0.5 * LARGEST, P=RICCATI, Q=Q, R=R)
    assert found.answer in (PROVEN, BY_ANOTHER)
    if found.answer == BY_ANOTHER:
        assert found.place.short < 1e-13
        assert "1.000000000001 P" in found.reason
    assert of_level(0.5 * LARGEST, Q=Q, R=R).answer == PROVEN
    assert of_level(0.5 * LARGEST, Q=1.1 * Q, R=R).answer == BY_ANOTHER


def test_a_set_that_grows_is_false_by_a_state_and_its_successor():
    found = check(PLANT, TerminalClaim(K=[[0.0, 0.0]], P=np.eye(2), level=1.0))
    assert found.answer == FALSE
    start, after = found.motion.x
    np.testing.assert_allclose(after, A @ start, atol=1e-14)
    assert start @ start <= 1 + 1e-15 < after @ after


def admissible(steps):
    limits = np.vstack([PLANT.H_x, PLANT.H_u @ K])
    H = np.vstack([limits @ np.linalg.matrix_power(LOOP, k) for k in range(steps)])
    return H, np.tile(np.r_[PLANT.h_x, PLANT.h_u], steps)


def test_the_admissible_set_is_terminal_once_it_is_finitely_determined():
    H, h = admissible(6)
    assert check(PLANT, TerminalClaim(K=K, H=H, h=h)).answer == PROVEN
    found = check(PLANT, TerminalClaim(K=K, H=H[:6], h=h[:6]))
    assert found.answer == FALSE
    start, after = found.motion.x
    assert np.all(H[:6] @ start <= h[:6] + 1e-12)
    assert np.any(H[:6] @ after > h[:6] + 1e-3)


def test_random_states_of_a_proven_polytope_stay_inside():
    H, h = admissible(6)
    x = np.random.default_rng(0).uniform(-5, 5, (20_000, 2))
    x = x[np.all(x @ H.T <= h, axis=1)]
    assert len(x) > 100
    assert np.all(x @ LOOP.T @ H.T <= h + 1e-12)


def test_the_square_that_one_vertex_turns_out_of_itself_is_false():
    square = {"H": np.vstack([np.eye(2), -np.eye(2)]), "h": np.ones(4)}
    turned = 0.8 * np.array([[0.8, -0.6], [0.6, 0.8]])
    none = {"K": np.zeros((1, 2)), **square}
    inputs, limits = np.zeros((2, 2, 1)), box_limits([2, 2], [1])
    halves = LimitedPlant([0.5 * np.eye(2), 0.7 * np.eye(2)], inputs, **limits)
    assert check(halves, TerminalClaim(**none)).answer == PROVEN
    both = LimitedPlant([0.5 * np.eye(2), turned], inputs, **limits)
    assert check(both, TerminalClaim(**none)).answer == FALSE
    # 0.8 (0.8 + 0.6) = 1.12 of the side
    assert check(both, TerminalClaim(**none)).place.short == pytest.approx(0.12)


def test_a_unit_square_that_is_just_kept_is_proven():
    """The successor touches all sides: equality is enough for an invariant set."""
    quarter = LimitedPlant([[0.0, -1.0], [1.0, 0.0]], [[0.0], [0.0]], **box_limits([1, 1], [1]))
    square = {"H": np.vstack([np.eye(2), -np.eye(2)]), "h": np.ones(4)}
    assert check(quarter, TerminalClaim(K=[[0.0, 0.0]], **square)).answer == PROVEN
    ball = TerminalClaim(K=[[0.0, 0.0]], P=np.eye(2), level=1.0)
    assert check(quarter, ball).answer == PROVEN


WRONG = {
    "level": lambda: TerminalClaim(K=K),
    "P is missing": lambda: TerminalClaim(K=K, level=1.0),
    "both Q and R": lambda: TerminalClaim(K=K, P=Q, level=1.0, Q=Q),
    "symmetric": lambda: TerminalClaim(K=K, P=[[1, 2], [0, 1]], level=1.0),
    "h: expected": lambda: TerminalClaim(K=K, H=Q, h=[1, -1]),
    "K: expected shape": lambda: check(PLANT, TerminalClaim(K=[[1.0]], P=Q, level=1.0)),
    "is not allowed": lambda: LimitedPlant(A, B, H_x=[[1, 0]], h_x=[-1]),
    "both H_x": lambda: LimitedPlant(A, B, H_x=[[1, 0]]),
}


@pytest.mark.parametrize("said", WRONG)
def test_wrong_input_is_told_in_a_sentence(said):
    with pytest.raises(InputError, match=said):
        WRONG[said]()


def test_the_multiple_of_a_terminal_cost_that_is_named_does_when_it_is_typed():
    rng, followed = np.random.default_rng(3), 0
    for _ in range(20):
        A, B = rng.normal(size=(3, 3)), rng.normal(size=(3, 1))
        C = rng.normal(size=(1, 3))
        Q, R = C.T @ C, np.eye(1)
        P = solve_discrete_are(A, B, Q, R)
        P, K = (P + P.T) / 2, -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        plant, level = LimitedPlant(A, B, **box_limits([1e3] * 3, [1e3])), 1e-3
        found = check(plant, TerminalClaim(K=K, P=P, level=level, Q=Q, R=R))
        if " P as terminal cost" in found.reason:
            factor = float(found.reason.split(" P as terminal cost")[0].split()[-1])
            again = check(plant, TerminalClaim(K=K, P=factor * P, level=level, Q=Q, R=R))
            assert again.answer == "proven"
            followed += 1
    assert followed > 5


def test_a_strip_that_is_not_bounded_is_decided(tmp_path):
    """x1 halves and x2 stays: |x1| <= 1 is not left, and x2 may be anything."""
    H, h = [[1.0, 0.0], [-1.0, 0.0]], [1.0, 1.0]
    plant = LimitedPlant([[0.5, 0.0], [0.0, 1.0]], [[0.0], [0.0]], H_x=H, h_x=h)
    found = check(plant, TerminalClaim(K=[[0.0, 0.0]], H=H, h=h))
    assert found.answer == "proven"
    assert report.main([str(found.save(tmp_path / "strip.json"))]) == 0
    larger = TerminalClaim(K=[[0.0, 0.0]], H=H, h=[1.5, 1.5])
    assert check(plant, larger).answer != "proven"
