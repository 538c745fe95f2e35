"""The covariance of least-squares coefficients whose residuals are correlated, in time and between outputs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from numpy.fft import irfft, rfft
from scipy.fft import next_fast_len
from scipy.linalg import solve_triangular

from identification.excitation import column_scale
from identification.structure import LPVARX
from symheli.lpv.arrays import Array


def covariances(arx: LPVARX, phi: Array, error: Array, runs: Sequence[slice], lags: int) -> tuple[Array, Array]:
    """Of all coefficients together (ny, n, ny, n), and of each equation as if its residuals were white (ny, n, n).

    From regressors phi (m, n) and residuals (m, ny) in unbroken `runs`. With D_i = (Phi_i' Phi_i)^-1 of equation i and R_ij the correlation
    of residuals i and j over `lags` samples, tapered (Bartlett): D_i [sum_k sum_l phi_i(k) R_ij(l - k) phi_j(l)'] D_j, per degree of
    freedom left.
    """
    n, m = arx.n_regressors, len(phi)
    equations = {y: _Equation.of(arx.regressors(group), phi) for group in arx.groups for y in group.outputs}
    spectra = [_Spectra.of(phi[run], error[run], lags) for run in runs]
    R = sum(s.correlations(lags) for s in spectra) / m * (1 - np.abs(np.arange(-lags, lags + 1)) / (lags + 1))
    joint, white = np.zeros((arx.ny * n, arx.ny * n)), np.zeros((arx.ny, n, n))
    for i, j in combinations_with_replacement(range(arx.ny), 2):
        a, b = equations[i], equations[j]
        middle = sum(s.weighted(a.regressors, b.regressors, R[i, j]) for s in spectra) * m / np.sqrt(a.left * b.left)
        block = a.inverse @ middle @ b.inverse
        rows, columns = i * n + a.regressors, j * n + b.regressors
        joint[rows[:, None], columns] = block = 0.5 * (block + block.T) if i == j else block
        joint[columns[:, None], rows] = block.T
    for y, own in equations.items():
        white[y, own.regressors[:, None], own.regressors] = own.inverse * (error[:, y] @ error[:, y] / own.left)
    return joint.reshape(arx.ny, n, arx.ny, n), white


class _Equation(NamedTuple):
    """Regressors (n,) of an equation, (Phi' Phi)^-1 (n, n), and the degrees of freedom the residuals have left."""

    regressors: Array
    inverse: Array
    left: int

    @classmethod
    def of(cls, regressors: Array, phi: Array) -> _Equation:
        scale = column_scale(phi[:, regressors])
        R = np.linalg.qr(phi[:, regressors] / scale, mode="r")
        inverse = solve_triangular(R, np.eye(len(scale))) / scale[:, None]
        return cls(regressors, inverse @ inverse.T, max(len(phi) - len(scale), 1))


class _Spectra(NamedTuple):
    """Fourier transforms of the regressors (k, n) and residuals (k, ny) of an unbroken run, padded so that `lags` samples wrap nowhere."""

    phi: Array
    error: Array
    length: int

    @classmethod
    def of(cls, phi: Array, error: Array, lags: int) -> _Spectra:
        length: int = next_fast_len(max(len(phi) + lags, 2 * lags + 1), real=True)  # type: ignore[assignment]
        return cls(rfft(phi, length, axis=0), rfft(error, length, axis=0), length)

    def correlations(self, lags: int) -> Array:
        """sum_k e_i(k) e_j(k + l), (ny, ny, 2 lags + 1), l from -lags to lags."""
        full = irfft(np.einsum("ki,kj->ijk", self.error.conj(), self.error), self.length, axis=-1)
        return np.concatenate([full[..., self.length - lags :], full[..., : lags + 1]], axis=-1)

    def weighted(self, rows: Array, columns: Array, R: Array) -> Array:
        """sum_k sum_l phi_i(k) R(l) phi_j(k + l)', R (2 lags + 1,) from l = -lags on."""
        lags = len(R) // 2
        kernel = rfft(np.concatenate([R[lags:], np.zeros(self.length - len(R)), R[:lags]])).conj()
        kernel[1 : (self.length + 1) // 2] *= 2  # the negative frequencies
        return (self.phi[:, rows].conj().T @ (kernel[:, None] * self.phi[:, columns])).real / self.length
