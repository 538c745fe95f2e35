"""Coefficients that the truth may have: draws from the distribution of an estimate."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from symheli.values.arrays import Array
from symheli.values.numbers import whole


def drawn(
    theta: Array, joint: Array, free: Array, count: int, seed: int, boundary: float | None = None
) -> Array:
    """`count` coefficients (count, n, ny) around theta (n, ny) with the normal distribution of the
    covariance `joint` (ny, n, ny, n); those that are not `free` (n, ny) stay.

    `boundary`: each is moved along its ray to the boundary of the ellipsoid that holds this share
    of the distribution.
    """
    count, seed = whole(count, "draws", 1), whole(seed, "seed")
    mask = free.T.reshape(-1)
    square = joint.reshape(len(mask), len(mask))[mask][:, mask]
    scale = np.sqrt(np.diagonal(square))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(square / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    z = np.random.default_rng(seed).standard_normal((count, len(root)))
    if boundary is not None:
        z *= np.sqrt(chi2.ppf(boundary, len(root))) / np.linalg.norm(z, axis=1, keepdims=True)
    moved = np.tile(theta.T.reshape(-1), (count, 1))
    moved[:, mask] += z @ root.T
    return moved.reshape(count, theta.shape[1], -1).transpose(0, 2, 1)
