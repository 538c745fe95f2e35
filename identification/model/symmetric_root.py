"""The root of a covariance."""

from __future__ import annotations

import numpy as np

from symheli.values.arrays import Array


def symmetric_root(covariance: Array) -> Array:
    """The symmetric root (n, n) of a positive semidefinite matrix (n, n).

    Random draws take it rather than a root by eigenvectors: those have signs that rounding decides,
    and the same seed would give other draws.
    """
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
