"""How well the coefficients are known: their covariance, honest about coloured residuals, and bands over p."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.signal import fftconvolve
from scipy.stats import norm

from identification.excitation import column_scale
from identification.model import LPVARXModel
from identification.regressors import Regression, as_records, stacked
from symheli.errors import InputError
from symheli.lpv import FlightRecord
from symheli.lpv.arrays import Array


class Band(NamedTuple):
    """One coefficient function of the equation of `output`: what it multiplies, its `value` (n,) and `standard_error` (n,) at each p."""

    output: str
    regressor: str
    value: Array
    standard_error: Array

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper end (n,) of the normal confidence interval at each p."""
        if not 0 < level < 1:
            raise InputError(f"level: expected a share in (0, 1) such as 0.95, got {level!r}")
        half = norm.ppf(0.5 + 0.5 * level) * self.standard_error
        return self.value - half, self.value + half


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariance of the coefficients of `model`, an equation at a time.

    `covariance` (ny, n, n): of theta[:, y], zero for coefficients an equation does not have. `white` (ny, n, n): the same by the formula
    for white residuals. `colour` (ny,): by how much the standard errors grow on average where residuals are coloured (1: white).
    """

    model: LPVARXModel
    covariance: Array
    white: Array
    lags: int

    @property
    def standard_errors(self) -> Array:
        """(n, ny), the Cramer-Rao bounds of normal residuals, corrected for their colour; like `model.theta`."""
        return np.sqrt(np.einsum("yii->iy", self.covariance))

    @property
    def colour(self) -> Array:
        """Mean ratio (ny,) of corrected to white standard errors."""
        own = np.sqrt(np.einsum("yii->iy", self.white))
        return np.array([np.mean(self.standard_errors[free, y] / own[free, y]) for y, free in enumerate(self.model.structure.free.T)])

    def bands(self, p: object) -> tuple[Band, ...]:
        """Every coefficient function at p (n,) (or (n, parameters)), with its standard error."""
        arx, theta = self.model.structure, self.model.theta
        f = np.atleast_2d(arx.basis(p))
        size = arx.basis.size
        out = []
        for y, output in enumerate(arx.outputs):
            for entry in range(len(arx.entries)):
                block = slice(entry * size, (entry + 1) * size)
                if not arx.free[block, y].any():
                    continue
                error = np.sqrt(np.einsum("ki,ij,kj->k", f, self.covariance[y, block, block], f))
                name = arx.regressor_names[block.start].rsplit(" f0(", 1)[0]
                out.append(Band(output, name, f @ theta[block, y], error))
        return tuple(out)


def uncertainty(model: LPVARXModel, records: FlightRecord | Iterable[FlightRecord], *, lags: int | None = None) -> Uncertainty:
    """Covariance of the least-squares coefficients of `model` over the records it was fitted to.

    With D = (Phi' Phi)^-1 and R(l) the autocorrelation of the residuals, D [sum_k sum_l phi(k) R(k - l) phi(l)'] D instead of
    sigma^2 D: modelling errors colour residuals, and the white formula is then too optimistic, often by 5 to 10 times. R is tapered
    (Bartlett) over `lags` samples, default a fifth of the longest run, as in the source. Instrumental-variable estimates are less certain
    than this says: `InputError`. Source: Morelli and Klein, "Accuracy of aerodynamic model parameters estimated from flight test
    data", J. Guidance, Control, and Dynamics 20 (1997).
    """
    records = as_records(records)
    arx = model.structure
    if model.method not in ("ls", "rls"):
        raise InputError(f'uncertainty is that of least squares; the model was fitted by "{model.method}"')
    for record in records:
        model.require_same_kind(record)
    data = stacked(arx, records)
    if len(data.phi) <= arx.n_regressors:
        raise InputError(f"{len(data.phi)} usable samples say nothing about the certainty of {arx.n_regressors} coefficients an output")
    runs = _runs(data)
    longest = max(run.stop - run.start for run in runs)
    reach = min(max(longest // 5, 1), longest - 1) if lags is None else lags
    if not (isinstance(reach, int | np.integer) and 0 <= reach < longest):
        raise InputError(f"lags: expected 0 .. {longest - 1} samples, got {lags}")
    error = data.y - data.phi @ model.theta
    covariance, white = (np.zeros((arx.ny, arx.n_regressors, arx.n_regressors)) for _ in range(2))
    for group in arx.groups:
        at = arx.regressors(group)
        scale = column_scale(data.phi[:, at])
        phi = data.phi[:, at] / scale
        inverse = solve_triangular(np.linalg.qr(phi, mode="r"), np.eye(len(at)))
        D = inverse @ inverse.T / np.outer(scale, scale)
        left = max(len(phi) - len(at), 1)
        for y in group.outputs:
            place = (y, at[:, None], at)
            white[place] = D * (error[:, y] @ error[:, y] / left)
            middle = _coloured(phi, error[:, y], runs, reach) * (len(phi) / left) * np.outer(scale, scale)
            covariance[place] = D @ middle @ D
    return Uncertainty(model, covariance, white, reach)


def _coloured(phi: Array, error: Array, runs: list[slice], lags: int) -> Array:
    """sum_k sum_l phi(k) R(k - l) phi(l)' over unbroken runs, R the tapered autocorrelation of all residuals."""
    sums = np.zeros(lags + 1)
    for run in runs:
        e = error[run]
        full = fftconvolve(e, e[::-1])[len(e) - 1 :][: lags + 1]
        sums[: len(full)] += full
    R = sums / len(error) * (1 - np.arange(lags + 1) / (lags + 1))
    kernel = np.concatenate([R[:0:-1], R])
    out = np.zeros((phi.shape[1],) * 2)
    for run in runs:
        smooth = fftconvolve(phi[run], kernel[:, None], axes=0)[lags : lags + run.stop - run.start]
        out += phi[run].T @ smooth
    return 0.5 * (out + out.T)


def _runs(data: Regression) -> list[slice]:
    """Rows whose samples follow one another."""
    breaks = np.flatnonzero(np.diff(data.rows) != 1) + 1
    ends = [0, *breaks.tolist(), len(data.rows)]
    return [slice(a, b) for a, b in pairwise(ends)]
