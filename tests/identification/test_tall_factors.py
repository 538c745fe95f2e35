"""Orthogonal factors of tall matrices by blocks of rows are those of the whole."""

import numpy as np
import pytest

from identification.design import tall_factors
from identification.design.tall_factors import orthonormal, triangular

EPS = np.finfo(float).eps


def graded(m, n, smallest=1.0, seed=0):
    """Columns of lengths from 1 down to `smallest`."""
    return np.random.default_rng(seed).standard_normal((m, n)) * np.geomspace(1.0, smallest, n)


@pytest.fixture
def small_blocks(monkeypatch):
    """Of four times as many rows as columns: the triangles are cut in turn."""
    monkeypatch.setattr(tall_factors, "MAX_OPERATIONS", 1.0)


@pytest.mark.parametrize("smallest", [1.0, 1e-12])
@pytest.mark.parametrize("m", [7, 31, 64, 1999])
def test_factors_of_blocks_are_factors_of_the_whole(m, smallest, small_blocks):
    A = graded(m, 7, smallest)
    Q, R = orthonormal(A)
    # rounding errors of a column, over the levels of blocks
    assert np.abs(Q.T @ Q - np.eye(7)).max() < 100 * EPS
    assert (np.linalg.norm(A - Q @ R, axis=0) <= 100 * EPS * np.linalg.norm(A, axis=0)).all()
    assert np.array_equal(R, np.triu(R))
    # the triangle is known up to the signs of its rows
    expected = np.abs(np.linalg.qr(A, mode="r"))
    np.testing.assert_allclose(np.abs(triangular(A)), expected, rtol=1e-8, atol=1e-12 * smallest)
    np.testing.assert_allclose(np.abs(R), expected, rtol=1e-8, atol=1e-12 * smallest)


def test_columns_that_depend_on_each_other_are_found_dependent(small_blocks):
    A = graded(500, 6)
    A[:, 4] = A[:, :3] @ [1.0, -2.0, 0.5]
    Q, R = orthonormal(A)
    assert abs(R[4, 4]) < 1e-13 * np.linalg.norm(A[:, 4])
    np.testing.assert_allclose(Q @ R, A, atol=1e-13)


@pytest.mark.parametrize("shape", [(0, 3), (2, 5), (5, 0), (400, 9)])
def test_one_block_has_the_bits_of_lapack(shape):
    A = np.random.default_rng(1).standard_normal(shape)
    for found, expected in zip(orthonormal(A), np.linalg.qr(A), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(triangular(A), np.linalg.qr(A, mode="r"))


def test_a_block_is_some_tenths_of_a_second_of_work():
    """Of an hour at 50 Hz and 288 instruments: 180 000 rows, in blocks of 5000."""
    parts = tall_factors._blocks(np.broadcast_to(1.0, (180_000, 288)))
    assert sum(map(len, parts)) == 180_000
    assert max(map(len, parts)) * 288**2 <= 1.2 * tall_factors.MAX_OPERATIONS
