"""The lasso: least squares with a price on every coefficient, so that some become exactly zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import ClassVar

import numpy as np
from scipy.linalg import solve_triangular

from identification.design.excitation import RANK_TOLERANCE, column_scale
from identification.design.tall_factors import triangular
from identification.estimators.least_squares import least_squares
from identification.estimators.method import Estimate, Method
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import InputError
from symheli.progress import tracked
from symheli.records import FlightRecord
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Lasso(Method):
    """Least squares with an L1 penalty on the coefficients, so that some become exactly zero.

    Parameters
    ----------
    weight : float, optional
        The price (in columns of mean square 1) as a fraction, in [0, 1], of the smallest at which
        all coefficients are zero; None: the point of the path with the smallest extended Bayesian
        information criterion, for each output, less the coefficients without which the criterion is
        smaller still.
    refit : bool
        Replace the shrunk coefficients by least squares on those kept.

    Raises
    ------
    InputError
        A weight outside [0, 1].

    References
    ----------
    Efron, Hastie, Johnstone and Tibshirani (2004), Least angle regression, Annals of Statistics 32.

    Examples
    --------
    Of B(p) = 1 the part that moves with p is left out:

    >>> idn.fit(arx, record, method=idn.methods.Lasso()).details["kept"]
    [3]
    """

    weight: float | None = None
    refit: bool = True
    shorthand: ClassVar[str] = "lasso"
    needs_excitation: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.weight is not None and not 0 <= self.weight <= 1:
            raise InputError(
                "weight: expected a fraction in [0, 1], or None for the information criterion, got"
                f" {self.weight!r}"
            )

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients, with the `weight` of each output and the number of
        coefficients it `kept` in the details.
        """
        theta, weights = lasso(arx, data, self)
        kept = np.count_nonzero(theta, axis=0).tolist()
        return Estimate(theta=theta, details={"weight": weights.tolist(), "kept": kept})


def lasso(arx: LPVARX, data: Regression, options: Lasso) -> tuple[Array, Array]:
    """Return theta (n_regressors, ny), zero for coefficients that are not kept, and the weight
    (ny,) of each output.
    """
    theta, weights = np.zeros((arx.n_regressors, arx.ny)), np.zeros(arx.ny)
    for group in arx.groups:
        regressors = arx.regressors(group)
        X = data.phi[:, regressors]
        scale = column_scale(X) / np.sqrt(len(X))
        for y in tracked("lasso", group.outputs):
            prices, path = lasso_path(X / scale, data.y[:, y])
            b, price = (
                _by_criterion(X / scale, data.y[:, y], prices, path)
                if options.weight is None
                else _at(options.weight, prices, path)
            )
            if options.refit:
                kept = (
                    np.flatnonzero(b)
                    if options.weight is not None
                    else _pruned(X / scale, data.y[:, y], np.flatnonzero(b))
                )
                b = _refitted(X / scale, data.y[:, y], kept)
            theta[regressors, y], weights[y] = (
                b / scale,
                price / max(prices[0], np.finfo(float).tiny),
            )
    return theta, weights


def lasso_path(X: Array, y: Array) -> tuple[Array, Array]:
    """Return all minimisers of |y - X b|^2 / (2 m) + price |b|_1: prices (K,), falling to 0, and b
    (K, n) at them; straight lines between.

    The path is followed exactly, corner by corner: a coefficient joins where its correlation with
    the residual reaches the price, and leaves where it passes zero. A column that depends on those
    kept (to 1e-11) never joins. Source: Efron, Hastie, Johnstone and Tibshirani (2004), Annals of
    Statistics 32, 407-499, with the lasso modification.
    """
    m, n = X.shape
    R = triangular(np.column_stack([X, y]))
    R, z = R[:, :n] / np.sqrt(m), R[:, n] / np.sqrt(m)
    b, active, barred = np.zeros(n), [], np.zeros(n, dtype=bool)
    price = float(np.abs(R.T @ z).max(initial=0.0))
    prices, path, left = [price], [b], -1
    for _ in tracked("corners of the path", range(20 * n)):
        if price <= 1e-14 * prices[0]:
            break
        correlation = R.T @ (z - R @ b)
        free = ~barred
        free[active] = False
        joining = np.flatnonzero(free & (np.abs(correlation) >= price * (1 - 1e-9)))
        for j in joining:
            if j == left:
                continue
            if _depends(R, [*active, int(j)]):
                barred[j] = True
            else:
                active.append(int(j))
        if not active:
            break
        T = np.linalg.qr(R[:, active], mode="r")
        signs = np.sign(correlation[active])
        direction = solve_triangular(T, solve_triangular(T, signs, trans=1))
        slope = R.T @ (R[:, active] @ direction)
        step, left = _next_corner(
            price, correlation, slope, b[active], direction, active, barred, left
        )
        b = b.copy()
        b[active] += step * direction
        price -= step
        if left >= 0:
            b[left] = 0.0
            active.remove(left)
        prices.append(price)
        path.append(b)
    return np.array(prices), np.array(path)


def _next_corner(
    price: float,
    correlation: Array,
    slope: Array,
    b: Array,
    direction: Array,
    active: list[int],
    barred: Array,
    left: int,
) -> tuple[float, int]:
    """Return how far the price falls until a coefficient joins, leaves (then which, else -1), or
    the price is zero.
    """
    step, leaves = price, -1
    for j in range(len(correlation)):
        if j in active or barred[j]:
            continue
        for sign in (1.0, -1.0):
            closing = 1.0 - sign * slope[j]
            gap = price - sign * correlation[j]
            if (
                closing > 1e-12
                and (gap > 1e-9 * price or j != left)
                and 1e-12 * price < gap / closing < step
            ):
                step = gap / closing
    for i, j in enumerate(active):
        if direction[i] and 0 < -b[i] / direction[i] < step:
            step, leaves = -b[i] / direction[i], j
    return step, leaves


def _depends(R: Array, columns: list[int]) -> bool:
    T = np.asarray(np.linalg.qr(R[:, columns], mode="r"))
    return len(columns) > T.shape[0] or abs(T[-1, -1]) <= RANK_TOLERANCE * np.linalg.norm(
        R[:, columns[-1]]
    )


def _at(weight: float, prices: Array, path: Array) -> tuple[Array, float]:
    price = weight * prices[0]
    k = int(np.clip(np.searchsorted(-prices, -price), 1, len(prices) - 1)) if len(prices) > 1 else 0
    if k == 0:
        return path[0], price
    t = np.clip((prices[k - 1] - price) / (prices[k - 1] - prices[k]), 0.0, 1.0)
    return (1 - t) * path[k - 1] + t * path[k], price


def _by_criterion(X: Array, y: Array, prices: Array, path: Array) -> tuple[Array, float]:
    """Return the corner of the path whose kept coefficients, refitted, have the smallest
    criterion.
    """
    found = {tuple(np.flatnonzero(b).tolist()): k for k, b in reversed(list(enumerate(path)))}
    corners = tracked("comparing corners", found)
    best = found[min(corners, key=lambda kept: _criterion(X, y, np.array(kept, dtype=int)))]
    return path[best], float(prices[best])


def _pruned(X: Array, y: Array, kept: Array) -> Array:
    """Return `kept` without the coefficients whose removal reduces the criterion, the best removal
    first.
    """
    score = _criterion(X, y, kept)
    while len(kept):
        less = [np.delete(kept, i) for i in range(len(kept))]
        scores = [_criterion(X, y, k) for k in tracked("leaving out", less)]
        best = int(np.argmin(scores))
        if scores[best] > score:
            break
        kept, score = less[best], scores[best]
    return kept


def _criterion(X: Array, y: Array, kept: Array) -> float:
    """m log(residual) + k log(m) + 2 log(n over k) of least squares with k of n coefficients: BIC
    that counts the models of that size.

    Source: Chen and Chen (2008), Biometrika 95, 759-771.
    """
    m, n = X.shape
    error = y - X @ _refitted(X, y, kept)
    floor = (
        1e-12 * np.linalg.norm(y)
    ) ** 2  # below this the residual is rounding and must not be rewarded
    residual = max(float(error @ error), floor, np.finfo(float).tiny)
    return float(
        m * np.log(residual / m) + len(kept) * np.log(m) + 2 * np.log(float(comb(n, len(kept))))
    )


def _refitted(X: Array, y: Array, kept: Array) -> Array:
    b = np.zeros(X.shape[1])
    if len(kept):
        b[kept] = least_squares(X[:, kept], y[:, None])[:, 0]
    return b
