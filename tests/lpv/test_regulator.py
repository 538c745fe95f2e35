"""The linear-quadratic regulator of matrices: least cost, and reasons where there is none."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov, solve_discrete_lyapunov

from symheli.errors import InputError
from symheli.lpv.riccati import regulator

ONE = np.eye(1)


def random(seed, dt):
    """A, B, Q, R, N of four unstable states and two controls."""
    rng = np.random.default_rng(seed)
    A, B, root = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), rng.normal(size=(6, 6))
    whole = root @ root.T
    A = A + np.eye(4) if dt is None else expm(dt * A)
    return A, B, whole[:4, :4], whole[4:, 4:], whole[:4, 4:]


@pytest.mark.parametrize("dt", [None, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_no_gain_near_it_costs_less_and_the_cost_is_its_own(seed, dt):
    """J = x'Xx solves the Lyapunov equation of the loop, and is a minimum over gains."""
    A, B, Q, R, N = random(seed, dt)
    K, X, _ = regulator(A, B, Q, R, N, dt)

    def cost(K):
        loop, weight = A - B @ K, Q - N @ K - K.T @ N.T + K.T @ R @ K
        if dt is None:
            return solve_continuous_lyapunov(loop.T, -weight)
        return solve_discrete_lyapunov(loop.T, weight)

    np.testing.assert_allclose(cost(K), X, rtol=1e-8, atol=1e-8 * np.abs(X).max())
    rng = np.random.default_rng(seed)
    for _ in range(5):
        other = cost(K + 1e-3 * rng.normal(size=K.shape))
        assert np.linalg.eigvalsh(other - X)[0] > -1e-9 * np.abs(X).max()
        assert np.trace(other) > np.trace(X)


def test_a_weight_of_both_counts_and_units_do_not():
    A, B, Q, R, N = random(0, None)
    K = regulator(A, B, Q, R, N).K
    assert np.abs(regulator(A, B, Q, R).K - K).max() > 0.1
    T = np.diag([1e6, 1.0, 1e-5, 30.0])  # x = T z
    found = regulator(np.linalg.solve(T, A @ T), np.linalg.solve(T, B), T @ Q @ T, R, T @ N)
    np.testing.assert_allclose(found.K, K @ T, rtol=1e-8)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (([[1.0]], [[0.0]], ONE, ONE), r"mode at 1 rad/s is not stable and no control moves it"),
        (([[1.2]], [[0.0]], ONE, ONE, None, 0.1), r"mode z = 1\.2 is not stable and no control"),
        (([[0.0]], [[1.0]], 0 * ONE, ONE), "at 0 rad/s is on the border.*no weight"),
        (([[1.0]], [[1.0]], 0 * ONE, ONE, None, 0.1), "z = 1 is on the border.*no weight"),
        (([[1.0]], [[1.0]], ONE, 0 * ONE), "R is not positive definite"),
        (([[0.0]], [[1.0]], ONE, ONE, 2 * ONE), r"\[Q N; N' R\] is indefinite"),
    ],
)
def test_the_reason_why_there_is_none_is_told(given, reason):
    matrices = [M if M is None or isinstance(M, float) else np.array(M) for M in given]
    with pytest.raises(InputError, match=f"no linear-quadratic regulator: .*{reason}"):
        regulator(*matrices)


def test_matrices_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match=r"Q: expected shape \(1, 1\), got \(2, 2\)"):
        regulator(ONE, ONE, np.eye(2), ONE)
    with pytest.raises(InputError, match=r"A: entry .* must be a finite number"):
        regulator(np.nan * ONE, ONE, ONE, ONE)
