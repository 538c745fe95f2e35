"""Recursive least squares as others write it: the textbook update of P in NumPy, and padasip's
filter once an output.
"""

from __future__ import annotations

import importlib.util

import numpy as np


class CovarianceRLS:
    """The textbook, vectorised, one P for all outputs (it loses its definiteness with raw
    monomials).
    """

    def __init__(self, n: int, outputs: int):
        self.P, self.theta = 1e6 * np.eye(n), np.zeros((n, outputs))

    def update(self, phi: np.ndarray, y: np.ndarray) -> np.ndarray:
        Pphi = self.P @ phi
        gain = Pphi / (1.0 + phi @ Pphi)
        self.theta = self.theta + np.outer(gain, y - phi @ self.theta)
        self.P = self.P - np.outer(gain, Pphi)
        return self.theta


class TunedCovarianceRLS(CovarianceRLS):
    """The same by somebody who counts allocations: rank-one updates by BLAS, in place."""

    def __init__(self, n: int, outputs: int):
        from scipy.linalg.blas import dger, dsymv

        super().__init__(n, outputs)
        self.P, self.theta = np.asfortranarray(self.P), np.asfortranarray(self.theta)
        self._ger, self._symv = dger, dsymv

    def update(self, phi: np.ndarray, y: np.ndarray) -> np.ndarray:
        Pphi = self._symv(1.0, self.P, phi)
        gain = Pphi / (1.0 + phi @ Pphi)
        self.theta = self._ger(1.0, gain, y - phi @ self.theta, a=self.theta, overwrite_a=1)
        self.P = self._ger(-1.0, gain, Pphi, a=self.P, overwrite_a=1)
        return self.theta


class Padasip:
    """padasip.filters.FilterRLS: one output each, hence as many filters as outputs."""

    def __init__(self, n: int, outputs: int):
        from padasip.filters import FilterRLS

        self.filters = [FilterRLS(n, mu=1.0, eps=1e-6) for _ in range(outputs)]

    def update(self, phi: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
        for one, value in zip(self.filters, y, strict=True):
            one.adapt(value, phi)
        return [one.w for one in self.filters]


def padasip_is_installed() -> bool:
    return importlib.util.find_spec("padasip") is not None
