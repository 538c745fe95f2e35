"""Batched matrix exponentials against SciPy's."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm as reference

from symheli.lpv.exponential import expm


def test_batched_exponentials_agree_with_scipy_over_many_sizes_and_norms():
    rng = np.random.default_rng(0)
    for n in (1, 3, 12):
        for scale in (1e-6, 0.1, 3.0, 30.0):
            M = scale * rng.standard_normal((20, n, n)) / np.sqrt(n)
            exact = reference(M)
            # squaring loses a bit each time: norm times rounding, both ways
            error = np.abs(expm(M) - exact).max(axis=(1, 2)) / np.abs(exact).max(axis=(1, 2))
            assert error.max() < 1e-14 * (10 + 30 * scale * n)


def test_an_empty_batch_is_an_empty_batch():
    assert expm(np.zeros((0, 2, 2))).shape == (0, 2, 2)
