"""Ridge regression: coefficients that the data hardly determine are kept small, or constant
in p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.linalg import block_diag, solve_triangular
from scipy.optimize import minimize_scalar

from identification.design.excitation import column_scale
from identification.design.tall_factors import orthonormal
from identification.estimators.method import Estimate, Method
from identification.structure.lpvarx import LPVARX, EquationGroup
from identification.structure.regressors import Regression
from symheli.errors import ExcitationError, InputError
from symheli.lpv.bases import FunctionSpace
from symheli.progress import tracked
from symheli.records import FlightRecord
from symheli.values.arrays import Array

GRID = np.linspace(-14.0, 4.0, 37)
"""Decades of the weight at which cross-validation is computed before it is refined."""


@dataclass(frozen=True)
class Ridge(Method):
    """Least squares with a quadratic penalty on the coefficients: those that the data hardly
    determine are kept small, or constant in p.

    The penalty of one lagged signal with the coefficient a(p) is its mean square times the mean of
    a(p)^2 over the range of the basis, or of the variation of a(p) about its mean there. It is
    measured in the output squared, as the mean squared residual is, and depends neither on the
    units nor on the functions chosen to write a(p).

    Parameters
    ----------
    weight : float, optional
        Multiplies the penalty; None: by generalised cross-validation, for each output.
    towards : {"constant", "zero"}
        What is penalised, the variation about the mean ("constant": the more weight, the closer to
        the LTI model) or the coefficient itself.

    Raises
    ------
    InputError
        A negative weight, or another `towards`.

    References
    ----------
    Golub, Heath and Wahba (1979), Technometrics 21, 215-223 (the choice of the weight).

    Examples
    --------
    >>> flat = idn.fit(arx, record, method=idn.methods.Ridge(weight=1e6)).coefficients
    >>> print(np.ptp(flat.at([-1.0, 1.0]).A).round(3))
    0.0
    """

    weight: float | None = None
    towards: Literal["constant", "zero"] = "constant"
    shorthand: ClassVar[str] = "ridge"
    needs_excitation: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.weight is not None and not (np.isfinite(self.weight) and self.weight >= 0):
            raise InputError(
                f"weight: expected a number >= 0, or None for cross-validation, got {self.weight!r}"
            )
        if self.towards not in ("constant", "zero"):
            raise InputError(f'towards: expected "constant" or "zero", got {self.towards!r}')

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients, with the `weight` of each output and the penalized
        coefficients in the details.
        """
        theta, weights = ridge(arx, data, self)
        details = {"weight": weights.tolist(), "towards": self.towards}
        return Estimate(theta=theta, details=details)


def ridge(arx: LPVARX, data: Regression, options: Ridge) -> tuple[Array, Array]:
    """theta (n_regressors, ny) and the weight (ny,) of each output.

    Raises `ExcitationError` where data and penalty together leave a direction undetermined.
    Source of the choice of weight: Golub, Heath and Wahba (1979), Technometrics 21, 215-223.
    """
    theta, weights = np.zeros((arx.n_regressors, arx.ny)), np.zeros(arx.ny)
    for group in arx.groups:
        regressors, outputs = arx.regressors(group), np.array(group.outputs)
        problem = _RidgeProblem.of(arx, data, group, options)
        for y in tracked("ridge", outputs):
            weights[y] = problem.cross_validated(y) if options.weight is None else options.weight
            theta[regressors, y] = problem.solve(float(weights[y]), y)
    return theta, weights


@dataclass(frozen=True, eq=False)
class _RidgeProblem:
    """|Z - R b|^2 + m weight |L b|^2 in scaled columns, R'R = X'X; `rest` what no b explains, m
    samples.
    """

    R: Array
    Z: Array
    L: Array
    rest: Array
    m: int
    scale: Array

    @classmethod
    def of(
        cls, arx: LPVARX, data: Regression, group: EquationGroup, options: Ridge
    ) -> _RidgeProblem:
        X = data.phi[:, arx.regressors(group)]
        scale = column_scale(X) / np.sqrt(max(len(X), 1))
        (root, whitened), size = _penalty_roots(arx.basis, options.towards), arx.basis.size
        blocks = [
            X[:, j : j + size] @ whitened for j in range(0, X.shape[1], size)
        ]  # one lagged signal each, in orthonormal functions
        sizes = [np.linalg.norm(block) / np.sqrt(size * max(len(X), 1)) for block in blocks]
        Q, R = orthonormal(X / scale)
        Z = Q.T @ data.y
        return cls(
            R,
            Z,
            block_diag(*(s * root for s in sizes)) / scale,
            np.sum((data.y - Q @ Z) ** 2, axis=0),
            len(X),
            scale,
        )

    def solve(self, weight: float, y: int) -> Array:
        """Coefficients (n,) of one output."""
        T, Z = self._triangle(weight, y)
        diagonal = np.abs(np.diagonal(T))
        if diagonal.min(initial=np.inf) <= 1e-13 * diagonal.max(initial=0.0):
            raise ExcitationError(
                "data and penalty do not determine every coefficient; raise the weight, penalise"
                " towards zero, or excite the inputs"
            )
        return solve_triangular(T, Z) / self.scale

    def cross_validated(self, y: int) -> float:
        """The weight with the smallest score m |residual|^2 / (m - degrees of freedom)^2."""
        scores = [self._score(10.0**d, y) for d in GRID]
        best = int(np.argmin(scores))
        around = (GRID[max(best - 1, 0)], GRID[min(best + 1, len(GRID) - 1)])
        found = minimize_scalar(
            lambda d: self._score(10.0**d, y),
            bounds=around,
            method="bounded",
            options={"xatol": 0.01},
        )
        return float(10.0 ** (found.x if found.fun < scores[best] else GRID[best]))

    def _score(self, weight: float, y: int) -> float:
        T, Z = self._triangle(weight, y)
        with np.errstate(all="ignore"):
            try:
                b, H = solve_triangular(T, Z), solve_triangular(T, self.R.T, trans=1)
            except np.linalg.LinAlgError:
                return np.inf
        left = self.m - np.sum(H**2)
        residual = np.sum((self.Z[:, y] - self.R @ b) ** 2) + self.rest[y]
        return float(self.m * residual / left**2) if left > 0 and np.isfinite(residual) else np.inf

    def _triangle(self, weight: float, y: int) -> tuple[Array, Array]:
        Q, T = np.linalg.qr(np.vstack([self.R, np.sqrt(weight * self.m) * self.L]))
        return T, Q[: len(self.R)].T @ self.Z[:, y]


def _penalty_roots(basis: FunctionSpace, towards: str) -> tuple[Array, Array]:
    """L with |L a|^2 the mean square over the box of sum_j a_j f_j, or its variance, and W such
    that the functions W'f are orthonormal.
    """
    nodes, weights = np.polynomial.legendre.leggauss(
        128 if basis.dimension == 1 else max(round(4096 ** (1 / basis.dimension)), 8)
    )
    axes = [0.5 * (low + high) + 0.5 * (high - low) * nodes for low, high in basis.ranges]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, basis.dimension)
    mass = np.prod(
        np.stack(np.meshgrid(*[weights / 2] * basis.dimension, indexing="ij"), axis=-1).reshape(
            -1, basis.dimension
        ),
        axis=1,
    )
    f = basis(grid[:, 0] if basis.dimension == 1 else grid)
    values, vectors = np.linalg.eigh(f.T @ (mass[:, None] * f))
    whitened = vectors / np.sqrt(np.maximum(values, 1e-14 * values[-1]))
    if towards == "constant":
        f = f - mass @ f
        values, vectors = np.linalg.eigh(f.T @ (mass[:, None] * f))
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T, whitened
