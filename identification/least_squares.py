"""Batch least squares, by orthogonal factors of scaled columns."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from identification.excitation import column_scale
from symheli.lpv.arrays import Array


def least_squares(phi: Array, y: Array) -> Array:
    """theta (n, ny) that minimises |y - phi theta|, from phi (m, n) of full rank and y (m, ny).

    QR of phi with columns scaled to length 1; the normal equations, which square the condition, are never formed.
    """
    scale = column_scale(phi)
    Q, R = np.linalg.qr(phi / scale)
    return solve_triangular(R, Q.T @ y) / scale[:, None]


def residual_covariance(phi: Array, y: Array, theta: Array) -> Array:
    """Covariance (ny, ny) of y - phi theta, per degree of freedom left."""
    error = y - phi @ theta
    return error.T @ error / max(len(phi) - phi.shape[1], 1)
