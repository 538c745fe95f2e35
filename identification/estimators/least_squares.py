"""Batch least squares, by orthogonal factors of scaled columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import solve_triangular

from identification.design.excitation import column_scale
from identification.design.tall_factors import orthonormal, triangular
from identification.estimators.method import Estimate, Method
from identification.estimators.self_check import check_least_squares
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.records import FlightRecord
from symheli.values.arrays import Array


@dataclass(frozen=True)
class LeastSquares(Method):
    """Least squares over all samples, by QR of scaled columns; the residual is checked to be
    orthogonal to every regressor.

    Examples
    --------
    >>> model = idn.fit(arx, record, method=idn.methods.LeastSquares())
    >>> print(model.coefficients.at(1.0).A.round(2))
    [[[-0.8]]]
    """

    shorthand: ClassVar[str] = "ls"
    least_squares: ClassVar[bool] = True

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate by an orthogonal factor for each group of equations with the same regressors."""
        theta = least_squares_by_group(arx, data.phi, data.y)
        check_least_squares(arx, data.phi, data.y, theta, self.shorthand)
        return Estimate(theta=theta, covariance=least_squares_covariance(arx, data, theta))


def least_squares(phi: Array, y: Array) -> Array:
    """theta (n, ny) that minimises |y - phi theta|, from phi (m, n) of full rank and y (m, ny).

    QR of phi with columns scaled to length 1; the normal equations, which square the condition, are
    never formed.
    """
    scale = column_scale(phi)
    Q, R = orthonormal(phi / scale)
    return solve_triangular(R, Q.T @ y) / scale[:, None]


def least_squares_by_group(arx: LPVARX, phi: Array, y: Array) -> Array:
    """theta (n_regressors, ny) of a structure, each equation with its own regressors; zero where it
    has none.
    """
    theta = np.zeros((arx.n_regressors, arx.ny))
    for group in arx.groups:
        regressors, outputs = arx.regressors(group), np.array(group.outputs)
        theta[regressors[:, None], outputs] = least_squares(phi[:, regressors], y[:, outputs])
    return theta


def residual_covariance(arx: LPVARX, error: Array) -> Array:
    """Covariance (ny, ny) of residuals (m, ny), per degree of freedom left (geometric mean of those
    of two outputs).
    """
    left = np.sqrt(np.maximum(len(error) - np.sum(arx.free, axis=0), 1))
    return error.T @ error / np.outer(left, left)


def least_squares_covariance(arx: LPVARX, data: Regression, theta: Array) -> Array | None:
    """Return the `white_covariance` of the least-squares coefficients theta with the covariance of
    their residuals; None where no degrees of freedom are left.
    """
    if len(data.phi) <= np.max(np.sum(arx.free, axis=0)):
        return None
    error = data.y - data.phi @ theta
    return white_covariance(arx, data.phi, residual_covariance(arx, error))


def white_covariance(arx: LPVARX, phi: Array, residual: Array) -> Array:
    """Return the covariance (ny, n, ny, n) of least-squares coefficients whose residuals are white
    with the covariance `residual` (ny, ny), and independent of regressors phi (m, n) of full rank.

    residual (x) (phi' phi)^-1 where all equations have the same regressors; else D_i phi_i' phi_j
    D_j residual_ij with D = (phi' phi)^-1 of the regressors of an equation. Zero for coefficients
    an equation does not have.
    """
    n, out = arx.n_regressors, np.zeros((arx.ny, arx.n_regressors) * 2)
    roots = []
    for group in arx.groups:
        root = np.zeros((n, n))
        own = np.asarray(arx.regressors(group))
        root[own[:, None], own] = inverse_root(phi[:, own])
        roots.append((np.array(group.outputs), root, phi @ root))
    for i, (rows, left, one) in enumerate(roots):
        for j, (columns, right, other) in enumerate(roots):
            between = left @ right.T if i == j else left @ (one.T @ other) @ right.T
            block = np.einsum("yz,ab->yazb", residual[np.ix_(rows, columns)], between)
            out[rows[:, None], :, columns] = block.transpose(0, 2, 1, 3)
    return out


def inverse_root(phi: Array) -> Array:
    """W (n, n) with W W' = (phi' phi)^-1, phi (m, n) of full rank."""
    scale = column_scale(phi)
    R = triangular(phi / scale)
    return solve_triangular(R, np.eye(len(scale))) / scale[:, None]
