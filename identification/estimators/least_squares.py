"""Batch least squares, by orthogonal factors of scaled columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import solve_triangular

from identification.design.excitation import column_scale
from identification.design.tall_factors import orthonormal
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
    >>> print(idn.fit(arx, record, method=idn.LeastSquares()).coefficients.at(1.0).A.round(2))
    [[[-0.8]]]
    """

    shorthand: ClassVar[str] = "ls"

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """By an orthogonal factor for each group of equations with the same regressors."""
        theta = least_squares_by_group(arx, data.phi, data.y)
        check_least_squares(arx, data.phi, data.y, theta, self.shorthand)
        return Estimate(theta=theta)


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


def residual_covariance(arx: LPVARX, phi: Array, y: Array, theta: Array) -> Array:
    """Covariance (ny, ny) of y - phi theta, per degree of freedom left (geometric mean of those of
    two outputs).
    """
    error = y - phi @ theta
    left = np.sqrt(np.maximum(len(phi) - np.sum(arx.free, axis=0), 1))
    return error.T @ error / np.outer(left, left)
