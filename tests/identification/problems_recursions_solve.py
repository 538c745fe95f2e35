"""The least-squares problems that recursions solve, row by row or in fifty digits, with no
recursion of a factor.
"""

from __future__ import annotations

import mpmath
import numpy as np

from identification.recursive.forgetting import Constant, Directional

EPS = np.finfo(float).eps
PRIOR = 32 * EPS


class Rows:
    """Every row ever given, weighted: data, and what keeps the coefficients awake. For constant and
    variable forgetting.
    """

    def __init__(self, n, m, forgetting, largest):
        self.n, self.largest = n, largest
        fastest = (
            forgetting.factor if isinstance(forgetting, Constant) else 1 - 1 / forgetting.shortest
        )
        self.samples = (
            max(PRIOR, 2 * forgetting.floor / max(fastest**n, 1e-12)) if fastest < 1 else PRIOR
        )
        self.A, self.b, self.w, self.data = (
            np.zeros((0, n)),
            np.zeros((0, m)),
            np.zeros(0),
            np.zeros(0, bool),
        )
        self.peak, self.fed, self.turn = np.zeros(n), np.zeros(n), 0

    def absorb(self, phi, y, factor):
        """`factor` is what the recursion forgets with: variable forgetting chooses it by itself."""
        j, target = self.turn, self.samples * self.peak[self.turn] ** 2
        if 2 * self.fed[j] < target:
            self._add(
                np.eye(self.n)[j],
                self._now[j] if self.samples > PRIOR else 0 * y,
                target - self.fed[j],
            )
            self.fed[j] = target
        peak = peaks(self.peak, phi, self.largest)
        for i in np.flatnonzero(
            (peak > self.peak)
            & (self.samples * peak**2 > (100 if self.samples > PRIOR else 4) * self.fed)
        ):
            self._add(np.eye(self.n)[i], 0 * y, self.samples * peak[i] ** 2 - self.fed[i])
            self.fed[i] = self.samples * peak[i] ** 2
        self.peak, self.w, self.fed = peak, self.w * factor, self.fed * factor
        self._add(phi, y, 1.0, data=True)
        self.turn = (self.turn + 1) % self.n

    def _add(self, row, value, weight, data=False):
        self.A, self.b = np.vstack([self.A, row]), np.vstack([self.b, value])
        self.w, self.data = np.append(self.w, weight), np.append(self.data, data)

    @property
    def rows(self):
        """The data (k, n) and the root of the weight of each."""
        return self.A[self.data], np.sqrt(self.w[self.data])

    @property
    def theta(self):
        """By Householder's reflections, in extended precision where the machine has it."""
        A, b, scale = self._weighted
        seen, out = np.any(A != 0, axis=0), np.zeros((self.n, b.shape[1]))
        out[seen] = (
            triangular_solution(A[:, seen].astype(np.longdouble), b.astype(np.longdouble))
            / scale[seen, None]
        )
        return out

    @property
    def residual(self):
        """Weighted squares (m, m) of what the best coefficients leave of every row."""
        left = np.sqrt(self.w)[:, None] * (self.b - self.A @ self.theta)
        return left.T @ left

    @property
    def _now(self):
        """In double precision: where coefficients are kept awake the condition is moderate."""
        A, b, scale = self._weighted
        return np.linalg.lstsq(A, b, rcond=None)[0] / scale[:, None]

    @property
    def spectrum(self):
        """Scale (n,) of the columns, singular values, right singular vectors of the scaled
        columns.
        """
        A, _, scale = self._weighted
        _, values, V = np.linalg.svd(A, full_matrices=False)
        return scale, values, V

    @property
    def _weighted(self):
        root = np.sqrt(self.w)[:, None]
        A = root * self.A
        scale = np.linalg.norm(A, axis=0)
        scale[scale == 0] = 1
        return A / scale, root * self.b, scale


class Information:
    """The information of directional forgetting, in fifty digits. Cao and Schwartz (2000), with
    what `Directional` says.
    """

    def __init__(self, n, m, forgetting, largest):
        self.n, self.forgetting, self.largest = n, forgetting, largest
        self.L, self.b = (np.array([[mpmath.mpf(0)] * k for _ in range(n)], object) for k in (n, m))
        self.A = np.zeros((0, n))
        self.peak, self.fed, self.turn = np.zeros(n), np.zeros(n), 0

    def absorb(self, phi, y, _):
        with mpmath.workdps(50):
            j, target = self.turn, PRIOR * self.peak[self.turn] ** 2
            if 2 * self.fed[j] < target:
                self.L[j, j] += mpmath.mpf(target - self.fed[j])
                self.fed[j] = target
            peak = peaks(self.peak, phi, self.largest)
            for i in np.flatnonzero((peak > self.peak) & (PRIOR * peak**2 > 4 * self.fed)):
                self.L[i, i] += mpmath.mpf(PRIOR * peak[i] ** 2 - self.fed[i])
                self.fed[i] = PRIOR * peak[i] ** 2
            self.peak = peak
            exact, outputs = (
                np.array([mpmath.mpf(float(v)) for v in part], object) for part in (phi, y)
            )
            if (np.abs(phi[peak > 0]) >= self.forgetting.quiet * peak[peak > 0]).any():
                v, c = self.L @ exact, exact @ self.b
                length = exact @ v
                if length > mpmath.mpf("1e-290"):
                    share = (1 - mpmath.mpf(self.forgetting.factor)) / length
                    self.L, self.b = (
                        self.L - share * np.outer(v, v),
                        self.b - share * np.outer(v, c),
                    )
            self.L, self.b = self.L + np.outer(exact, exact), self.b + np.outer(exact, outputs)
        self.A, self.turn = np.vstack([self.A, phi]), (self.turn + 1) % self.n

    @property
    def rows(self):
        return self.A, np.ones(len(self.A))

    @property
    def theta(self):
        with mpmath.workdps(50):
            seen = [i for i in range(self.n) if self.L[i, i] != 0]
            out, A = np.zeros(self.b.shape), mpmath.matrix(self.L[np.ix_(seen, seen)].tolist())
            for j in range(self.b.shape[1] if seen else 0):
                out[seen, j] = [
                    float(v) for v in mpmath.lu_solve(A, mpmath.matrix(self.b[seen, j].tolist()))
                ]
            return out

    @property
    def spectrum(self):
        with mpmath.workdps(50):
            scale = np.array(
                [mpmath.sqrt(v) if v > 0 else mpmath.mpf(1) for v in np.diagonal(self.L)], object
            )
            values, vectors = mpmath.eigsy(
                mpmath.matrix((self.L / np.outer(scale, scale)).tolist())
            )
        return (
            scale.astype(float),
            np.sqrt([max(float(v), 0.0) for v in values]),
            np.array(vectors.T.tolist(), float),
        )


def triangular_solution(A, b):
    """argmin |b - A x| for A (m, n) of full rank, in the precision of A."""
    A, b, n = A.copy(), b.copy(), A.shape[1]
    for k in range(n):
        v = A[k:, k].copy()
        v[0] += np.copysign(np.sqrt(v @ v), v[0])
        v /= np.sqrt(v @ v)
        A[k:, k:] -= 2 * np.outer(v, v @ A[k:, k:])
        b[k:] -= 2 * np.outer(v, v @ b[k:])
    x = np.zeros((n, b.shape[1]), A.dtype)
    for k in range(n - 1, -1, -1):
        x[k] = (b[k] - A[k, k + 1 :] @ x[k + 1 :]) / A[k, k]
    return x


def peaks(before, phi, largest):
    """Each signal at its largest so far times each function at its largest."""
    signal = (np.abs(phi).reshape(-1, len(largest)) / largest).max(axis=1)
    return np.maximum(before, np.outer(signal, largest).reshape(-1))


def problem(n, m, forgetting, largest):
    return (Information if isinstance(forgetting, Directional) else Rows)(n, m, forgetting, largest)
