"""The covariance of least-squares coefficients whose residuals are correlated, in time and between
outputs; draws of coefficients from a covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from numpy.fft import irfft, rfft
from scipy.fft import next_fast_len
from scipy.stats import chi2

from identification.estimators.least_squares import (
    inverse_root,
    residual_covariance,
    white_covariance,
)
from identification.model.symmetric_root import symmetric_root
from identification.structure.lpvarx import LPVARX
from symheli.values.arrays import Array
from symheli.values.numbers import whole

TAKEN = 0.8
"""Share of the residuals' power that the fit is taken to have removed at most."""

LEAST_FREEDOM = 2.0

SINGULAR = 1e-13
"""Share of the largest eigenvalue of a correlation matrix that is rounding."""


def covariances(
    arx: LPVARX, phi: Array, error: Array, runs: Sequence[slice], lags: int
) -> tuple[Array, Array, Array]:
    """Covariances of all coefficients together (ny, n, ny, n), the same as if residuals were white,
    and freedom (ny,).

    From regressors phi (m, n) and residuals (m, ny) in unbroken `runs`. With D_i = (Phi_i'
    Phi_i)^-1 of equation i and R_ij the correlation of residuals i and j over `lags` samples,
    tapered (Bartlett): D_i [sum_k sum_l phi_i(k) R_ij(l - k) phi_j(l)'] D_j, divided by the share
    of the noise's power that the fit has not removed: 1 - tr(D_i M_i)/(m R_ii(0)) with M_i the
    bracket; 1 - n/m for white residuals.

    `freedom`: degrees of freedom of the estimated variances. There are m/(1 + 2 sum R(l)^2/R(0)^2)
    independent residuals, and a taper over a fraction b = lags/m of the record leaves 1.5/b of them
    to tell slow noise by; the reciprocals add up. Sources: Bartlett (1946) for the first, Kiefer
    and Vogelsang, Econometric Theory 21 (2005), for fixed b.
    """
    n, m = arx.n_regressors, len(phi)
    equations = {
        y: _Equation.of(arx.regressors(group), phi) for group in arx.groups for y in group.outputs
    }
    spectra = [_Spectra.of(phi[run], error[run], lags) for run in runs]
    R = (
        sum(s.correlations(lags) for s in spectra)
        / m
        * (1 - np.abs(np.arange(-lags, lags + 1)) / (lags + 1))
    )
    joint, taken = np.zeros((arx.ny * n, arx.ny * n)), np.zeros(arx.ny)

    def between(i: int, j: int) -> Array:
        return sum(
            s.weighted(equations[i].regressors, equations[j].regressors, R[i, j]) for s in spectra
        )  # type: ignore[return-value]

    power = np.maximum(R[range(arx.ny), range(arx.ny), lags], np.finfo(float).tiny)
    own = [between(i, i) for i in range(arx.ny)]
    for i, middle in enumerate(own):
        taken[i] = min(
            max(float(np.sum(equations[i].inverse * middle)) / (m * power[i]), 0.0), TAKEN
        )
    for i, j in combinations_with_replacement(range(arx.ny), 2):
        a, b = equations[i], equations[j]
        middle = (own[i] if i == j else between(i, j)) / np.sqrt((1 - taken[i]) * (1 - taken[j]))
        block = a.inverse @ middle @ b.inverse
        rows, columns = i * n + a.regressors, j * n + b.regressors
        joint[rows[:, None], columns] = block = 0.5 * (block + block.T) if i == j else block
        joint[columns[:, None], rows] = block.T
    white = white_covariance(arx, phi, residual_covariance(arx, error))
    independent = m / np.sum((np.einsum("iil->il", R) / power[:, None]) ** 2, axis=1) * (1 - taken)
    freedom = 1 / (1 / np.maximum(independent, LEAST_FREEDOM) + lags / (1.5 * m))
    return joint.reshape(arx.ny, n, arx.ny, n), white, freedom


class _Equation(NamedTuple):
    """Regressors (n,) of an equation and (Phi' Phi)^-1 (n, n)."""

    regressors: Array
    inverse: Array

    @classmethod
    def of(cls, regressors: Array, phi: Array) -> _Equation:
        root = inverse_root(phi[:, regressors])
        return cls(regressors, root @ root.T)


class _Spectra(NamedTuple):
    """Fourier transforms of the regressors (k, n) and residuals (k, ny) of an unbroken run, padded
    so that `lags` samples wrap nowhere.
    """

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
        return (
            self.phi[:, rows].conj().T @ (kernel[:, None] * self.phi[:, columns])
        ).real / self.length


def drawn(
    theta: Array, joint: Array, free: Array, count: int, seed: int, boundary: float | None = None
) -> Array:
    """`count` coefficients (count, n, ny) around theta (n, ny) with the normal distribution of the
    covariance `joint` (ny, n, ny, n); those that are not `free` (n, ny) stay.

    `boundary`: each is moved along its ray to the boundary of the ellipsoid that holds this share
    of the distribution.
    """
    count, seed = whole(count, "draws", 1), whole(seed, "seed")
    mask = free.T.reshape(-1)
    square = joint.reshape(len(mask), len(mask))[mask][:, mask]
    scale = np.sqrt(np.diagonal(square))
    scale = np.where(scale > 0, scale, 1.0)
    root = scale[:, None] * symmetric_root(square / np.outer(scale, scale))
    z = np.random.default_rng(seed).standard_normal((count, len(root)))
    if boundary is not None:
        values, vectors = np.linalg.eigh(square / np.outer(scale, scale))
        known = int(np.sum(values > SINGULAR * values[-1]))
        if known < len(root):  # of states only what changes the response is distributed
            z = z @ vectors[:, -known:] @ vectors[:, -known:].T
        z *= np.sqrt(chi2.ppf(boundary, known)) / np.linalg.norm(z, axis=1, keepdims=True)
    moved = np.tile(theta.T.reshape(-1), (count, 1))
    moved[:, mask] += z @ root.T
    return moved.reshape(count, theta.shape[1], -1).transpose(0, 2, 1)
