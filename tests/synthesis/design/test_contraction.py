"""The least norm of a matrix of which some rows and columns are free (Parrott)."""

import numpy as np
import pytest
from scipy.optimize import minimize

from synthesis.design.lpv.recovery import contraction


def problem(seed, shape=(4, 5), k=2, l=2):
    rng = np.random.default_rng(seed)
    r, c = shape
    return tuple(rng.standard_normal((3, *s)) for s in ((r, c), (r, k), (l, c)))


def sizes(M, left, right, K):
    return np.linalg.norm(M + left @ K @ right, 2, axis=(1, 2))


def least(M, left, right):
    """What the rows and the columns that are not free leave."""
    rows = np.linalg.qr(left, mode="complete")[0][:, :, left.shape[-1] :]
    columns = np.linalg.qr(np.swapaxes(right, 1, 2), mode="complete")[0][:, :, right.shape[1] :]
    return np.maximum(*(
        np.linalg.norm(X, 2, axis=(1, 2)) for X in (np.swapaxes(rows, 1, 2) @ M, M @ columns)
    ))  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_the_least_norm_is_reached_and_no_search_goes_below_it(seed):
    M, left, right = problem(seed)
    reached = sizes(M, left, right, contraction(M, left, right, 0.0))
    floor = least(M, left, right)
    assert np.all(reached >= floor * (1 - 1e-12))
    # the level is kept a millionth above the least
    np.testing.assert_allclose(reached, floor, rtol=2e-6)
    size = lambda k: np.linalg.norm(M[0] + left[0] @ k.reshape(2, 2) @ right[0], 2)  # noqa: E731
    assert minimize(size, np.zeros(4), method="Nelder-Mead").fun >= floor[0] * (1 - 1e-12)


def test_a_level_above_the_least_is_kept():
    M, left, right = problem(7)
    level = 1.3 * least(M, left, right).max()
    assert np.all(sizes(M, left, right, contraction(M, left, right, level)) <= level)


def test_where_every_row_and_column_is_free_nothing_remains():
    M, left, right = problem(2, (3, 3), 3, 3)
    np.testing.assert_allclose(M + left @ contraction(M, left, right, 0.0) @ right, 0, atol=1e-12)
