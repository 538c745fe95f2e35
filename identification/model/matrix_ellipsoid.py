"""The coefficients of all outputs as one matrix, known to an ellipsoid of matrices: what a robust
certificate is about.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky
from scipy.special import gammaln, ndtri
from scipy.stats import binom, chi2

from identification.model.symmetric_root import symmetric_root
from symheli.errors import InputError
from symheli.values.arrays import Array, frozen
from symheli.values.summary import summarized

SETTLED = 1e-10
"""Relative change of the factors at which the fit ends."""
ROUNDS = 500
"""Most rounds of the fit: how close the cover is, never whether it covers, hangs on them."""
ROUNDING = 10 * np.finfo(float).eps
"""Times the square of the number of coefficients: what forming and factoring a matrix of ones on
the diagonal may lose of its least eigenvalue (Rump, BIT Numerical Mathematics 46 (2006)).
"""
EVENNESS = 0.1
"""Weight of all directions alike beside those that are emphasized, relative to the sum of these.
Chosen on seed 0 of the lateral loop in wind: .03 to .3 differ by 10 % of its gain.
"""
CHANCE = 1e-6
"""Chance that a radius of draws is too small."""
LOOSEST = 1e3
"""A cover that is verified only this many times larger than computed is none."""


class MatrixEllipsoid(NamedTuple):
    """Theta = Theta_hat + left D right with |D|_2 <= bound, coefficients Theta (n, m), n regressors
    by m outputs.

    Parameters
    ----------
    left : array (n, n)
        V^-1/2, zero in the rows of coefficients that are known exactly.
    right : array (m, m)
        Sigma^1/2.
    bound : float
        Radius in the spectral norm, beta.
    probability : float
        That of the ellipsoid, at least, for a Gaussian with the covariance covered.
    inflation : float
        The covariance is at most so many times Sigma (x) V^-1; 1 where it has that form.

    Examples
    --------
    >>> from identification.model.matrix_ellipsoid import MatrixEllipsoid
    >>> line = MatrixEllipsoid(np.eye(1), np.eye(1), 1.96, 0.95, 1.0)  # |theta| <= 1.96
    >>> line.contains([[[1.9]], [[2.0]]])
    array([ True, False])
    """

    left: Array
    right: Array
    bound: float
    probability: float
    inflation: float

    __repr__ = summarized

    def contains(self, error: object) -> Array:
        """Whether Theta - Theta_hat (..., n, m) lies in it, (...) of bool."""
        error = frozen(error, "error")
        if error.shape[-2:] != (len(self.left), self.right.shape[1]):
            shape = f"(..., {len(self.left)}, {self.right.shape[1]})"
            raise InputError(f"error: expected {shape}, got shape {error.shape}")
        seen, reached = np.any(self.left, axis=1), np.any(self.right, axis=0)
        left, right = self.left[np.ix_(seen, seen)], self.right[np.ix_(reached, reached)]
        D = np.linalg.solve(left, error[..., seen, :][..., reached]) @ np.linalg.inv(right)
        known = np.zeros(error.shape[:-2])
        for rest in (error[..., ~seen, :], error[..., ~reached]):
            known = np.maximum(known, np.abs(rest).max(axis=(-2, -1), initial=0.0))
        return (np.linalg.norm(D, 2, axis=(-2, -1)) <= self.bound) & (known == 0.0)


def matrix_ellipsoid(
    covariance: object,
    probability: float,
    draws: int = 0,
    seed: int = 0,
    emphasis: object = None,
) -> MatrixEllipsoid:
    """Return the ellipsoid of matrices that contains a Gaussian matrix with at least this
    probability.

    The covariance P need not have the form Sigma (x) V^-1 of a matrix Gaussian: the nearest of that
    form is fitted (flip-flop iteration) and scaled until P <= s Sigma (x) V^-1, which is verified
    by a Cholesky factorisation with a margin for rounding. A Gaussian of smaller covariance is in
    every symmetric convex set at least as often (Anderson), so that the ball of the larger one
    serves: `spectral_radius` times the root of s. That is proven, and larger than it need be; with
    `draws` the radius is the least that holds so many of `draws` matrices of the covariance itself
    that the probability is exceeded but for a chance of 1e-6.

    A ball is as wide in a direction that matters to nobody as in one that decides. With `emphasis`
    S the set is {|(S/tr S + c 1)^1/2 D|_2 <= bound}: tight where S is large, wider elsewhere, of
    the same probability.

    Parameters
    ----------
    covariance : array (m, n, m, n)
        Of the coefficients, by (output, regressor, output, regressor), as `Uncertainty` has it.
        Coefficients without variance are known exactly.
    probability : float
        In (0, 1).
    draws : int
        0: the proven radius; else of that many draws, some thousands.
    seed : int
        Of the draws.
    emphasis : array (n, n), optional
        Positive semidefinite, in the coordinates of D without it: second moments of left' x, x the
        regressors where the set is used.

    Returns
    -------
    MatrixEllipsoid
        Theta (n, m) = Theta_hat + left D right, |D|_2 <= bound.

    Raises
    ------
    InputError
        For another shape, a matrix that is no covariance or is one of no variance at all, a
        probability outside (0, 1), too few draws for it.

    References
    ----------
    Dutilleul, "The MLE algorithm for the matrix normal distribution", J. Statistical Computation
    and Simulation 64 (1999). Anderson, "The integral of a symmetric unimodal function over a
    symmetric convex set", Proc. American Mathematical Society 6 (1955).

    Examples
    --------
    >>> V_inverse, Sigma = np.diag([1.0, 0.01]), np.array([[1.0, 0.5], [0.5, 2.0]])
    >>> ellipsoid = idn.model.matrix_ellipsoid(np.einsum("ij,ab->iajb", Sigma, V_inverse), 0.95)
    >>> round(ellipsoid.inflation, 4), round(ellipsoid.bound, 2)
    (1.0, 3.08)
    """
    P = frozen(covariance, "covariance", (None, None, None, None))
    m, n = P.shape[:2]
    if P.shape != (m, n, m, n) or not m * n:
        raise InputError(
            "covariance: expected the shape (outputs, regressors, outputs, regressors), got"
            f" {P.shape}"
        )
    if isinstance(probability, bool) or not 0 < float(probability) < 1:
        raise InputError(f"probability: expected a number in (0, 1), got {probability!r:.60}")
    variance = np.einsum("iaia->ia", P)
    joint = P.reshape(m * n, m * n)
    if not np.allclose(joint, joint.T, rtol=1e-8, atol=0.0) or variance.min() < 0:
        raise InputError(
            "covariance: expected a symmetric array, P[i, a, j, b] = P[j, b, i, a], with variances"
            " >= 0"
        )
    seen, reached = np.any(variance > 0, axis=0), np.any(variance > 0, axis=1)
    if not np.any(seen):
        raise InputError(
            "covariance: every coefficient is known exactly; an uncertain model needs a variance"
        )
    P = P[np.ix_(reached, seen, reached, seen)]
    P = 0.5 * (P + P.transpose(2, 3, 0, 1))
    left, right, inflation = _cover(P)
    shape = np.eye(len(left)) if emphasis is None else _shape(emphasis, n, seen)
    left = left @ np.linalg.inv(shape)
    whole_left, whole_right = np.zeros((n, n)), np.zeros((m, m))
    whole_left[np.ix_(seen, seen)], whole_right[np.ix_(reached, reached)] = left, right
    if draws:
        bound = _drawn_radius(P, left, right, float(probability), draws, seed)
    else:
        bound = math.sqrt(inflation) * (
            spectral_radius(len(left), len(right), float(probability))
            if emphasis is None
            else _shaped_radius(shape, len(right), float(probability))
        )
    for array in (whole_left, whole_right):
        array.flags.writeable = False
    return MatrixEllipsoid(whole_left, whole_right, bound, float(probability), inflation)


def spectral_radius(n: int, m: int, probability: float) -> float:
    """A number that the spectral norm of an (n, m) matrix of standard Gaussians exceeds with at
    most the probability that is left.

    The smaller of two bounds. The norm is a convex function with Lipschitz constant 1, so it
    exceeds its median by t at most as often as a Gaussian exceeds t (Borell; Tsirelson, Ibragimov
    and Sudakov), the median is at most the mean (Kwapien), and that at most E|g_n| + E|g_m|, the
    mean lengths of Gaussian vectors (Chevet). And it is at most the Frobenius norm, whose square is
    chi-squared; that bound is exact for one row or column.

    Parameters
    ----------
    n, m : int
        Rows and columns.
    probability : float
        In (0, 1).

    Returns
    -------
    float
        The radius.

    References
    ----------
    Davidson and Szarek, "Local operator theory, random matrices and Banach spaces", Handbook of the
    Geometry of Banach Spaces 1 (2001), theorem 2.13. Kwapien, "A remark on the median and the
    expectation of convex functions of Gaussian vectors", Probability in Banach Spaces 9 (1994).

    Examples
    --------
    >>> from identification.model.matrix_ellipsoid import spectral_radius
    >>> round(spectral_radius(33, 6, 0.95), 2), round(spectral_radius(33, 1, 0.95), 2)
    (9.7, 6.88)
    """
    deviation = float(ndtri(probability))
    frobenius = math.sqrt(float(chi2.ppf(probability, n * m)))
    if deviation < 0:  # the median bounds what is above it
        return frobenius
    return min(_mean_length(n) + _mean_length(m) + deviation, frobenius)


def _shape(emphasis: object, n: int, seen: Array) -> Array:
    """(S/tr S + c 1)^1/2 in the coordinates that have a variance."""
    S = frozen(emphasis, "emphasis", (n, n))[np.ix_(seen, seen)]
    S = 0.5 * (S + S.T)
    total = float(np.trace(S))
    if not total > 0 or np.linalg.eigvalsh(S)[0] < -ROUNDING * n * total:
        raise InputError("emphasis: expected a positive semidefinite matrix that is not zero")
    return symmetric_root(S / total + EVENNESS * np.eye(len(S)))


def _shaped_radius(shape: Array, m: int, probability: float) -> float:
    """A number that the spectral norm of `shape` times a matrix of m columns of standard Gaussians
    exceeds with at most the probability that is left: as `spectral_radius`, by Chevet's inequality
    for a matrix, and by the mean of the Frobenius norm.
    """
    largest, frobenius = float(np.linalg.norm(shape, 2)), float(np.linalg.norm(shape))
    mean = min(largest * _mean_length(m) + frobenius, math.sqrt(m) * frobenius)
    return mean + max(float(ndtri(probability)), 0.0) * largest


def _drawn_radius(
    P: Array, left: Array, right: Array, probability: float, draws: int, seed: int
) -> float:
    """An order statistic of the norm that is below its quantile with a chance of `CHANCE` at
    most.
    """
    if isinstance(draws, bool) or not isinstance(draws, int | np.integer) or draws < 0:
        raise InputError(f"draws: expected an integer >= 0, got {draws!r:.60}")
    # below the quantile are so many of the draws, or more, with that chance
    rank = int(binom.isf(CHANCE, draws, probability)) + 1
    if rank > draws:
        least = math.ceil(math.log(CHANCE) / math.log(probability))
        raise InputError(
            f"draws: expected at least {least} to estimate a probability of {probability:g}, got"
            f" {draws}"
        )
    m, n = P.shape[:2]
    white = np.random.default_rng(seed).standard_normal((draws, m * n))
    joint = P.reshape(m * n, m * n)
    unit = np.sqrt(np.diag(joint))  # with units 1e8 apart a root of P itself loses the small ones
    unit = np.where(unit > 0, unit, 1.0)
    error = (white @ symmetric_root(joint / np.outer(unit, unit))) * unit
    error = error.reshape(draws, m, n).swapaxes(1, 2)
    rows, columns = np.abs(left).max(axis=1), np.abs(right).max(axis=0)
    D = np.linalg.solve(left / rows[:, None], error / rows[:, None] / columns)
    D = D @ np.linalg.inv(right / columns)
    return float(np.sort(np.linalg.norm(D, 2, axis=(1, 2)))[rank - 1])


def _mean_length(k: int) -> float:
    """E|g| of a standard Gaussian vector (k,)."""
    return math.sqrt(2.0) * math.exp(float(gammaln(0.5 * (k + 1)) - gammaln(0.5 * k)))


def _cover(P: Array) -> tuple[Array, Array, float]:
    """left (n, n), right (m, m) and the least verified s with P <= s right' right (x) left
    left'.
    """
    m, n = P.shape[:2]
    variance = np.einsum("iaia->ia", P)
    # in units in which the variances are of order one
    regressors = np.sqrt(variance.max(axis=0))
    outputs = np.sqrt((variance / regressors**2).max(axis=1))
    unit = np.multiply.outer(outputs, regressors)
    P = P / unit[:, :, None, None] / unit
    rows, columns = _fitted(P)
    s = _verified(
        P.reshape(m * n, m * n), np.kron(columns.T @ columns, rows @ rows.T), rows, columns
    )
    return regressors[:, None] * rows, columns * outputs, s


def _fitted(P: Array) -> tuple[Array, Array]:
    """Symmetric roots of V^-1 (n, n) and Sigma (m, m), Sigma (x) V^-1 nearest to P in the sense of
    Kullback and Leibler.
    """
    m, n = P.shape[:2]
    floor = np.finfo(float).eps ** 0.5
    V, Sigma = np.eye(n), np.eye(m)
    for _ in range(ROUNDS):
        before = np.concatenate([V.ravel(), Sigma.ravel()])
        V = np.einsum("ij,iajb->ab", np.linalg.inv(Sigma), P) / m
        V = V + floor * np.trace(V) / n * np.eye(n)
        Sigma = np.einsum("ab,iajb->ij", np.linalg.inv(V), P) / n
        Sigma = Sigma + floor * np.trace(Sigma) / m * np.eye(m)
        size = np.trace(Sigma) / m
        V, Sigma = V * size, Sigma / size
        change = np.abs(np.concatenate([V.ravel(), Sigma.ravel()]) - before).max()
        if change <= SETTLED * np.abs(before).max():
            break
    return symmetric_root(V), symmetric_root(Sigma)


def _verified(P: Array, K: Array, rows: Array, columns: Array) -> float:
    """The least s, up to what rounding asks for, at which a Cholesky factorisation shows P <= s
    K.
    """
    m, n = len(columns), len(rows)
    white = np.kron(np.linalg.inv(columns), np.linalg.inv(rows))
    s = float(np.linalg.eigvalsh(white @ P @ white.T)[-1])
    size = 1.0 / np.sqrt(np.diag(K))
    margin = ROUNDING * (m * n) ** 2 * np.eye(m * n)
    looser = 1e-9
    while looser < LOOSEST:
        tried = s * (1 + looser)
        try:
            cholesky(size[:, None] * (K - P / tried) * size - margin)
        except np.linalg.LinAlgError:
            looser *= 4
        else:
            return tried
    raise InputError(
        "covariance: no product of a matrix of the outputs and one of the regressors could be"
        " verified to cover it; its coefficients are nearly dependent: fewer regressors, or more"
        " excitation"
    )
