"""The unexplained part of a model: are the residuals white, do inputs still show in them, where
does the error come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm

from identification.model.lpvarx_model import LPVARXModel
from identification.model.prediction import LARGEST
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.numbers import whole
from symheli.values.summary import summarized

ROUNDING = 1e-14
"""An error below this fraction of the signals' size is rounding: it has no causes to share out."""


class Theil(NamedTuple):
    """Theil's inequality coefficient and the shares of the mean squared error, which sum to 1.

    All are 0 where the error is rounding. A good model errs by covariance.

    Parameters
    ----------
    coefficient : float
        In [0, 1], 0: perfect.
    bias : float
        Share of a wrong mean.
    variance : float
        Share of a wrong size.
    covariance : float
        The rest: noise and wrong phase.

    Examples
    --------
    >>> found = idn.judge.theil(record["y"], record["y"] + 0.5)
    >>> round(found.bias, 3), round(found.variance, 3), round(found.covariance, 3)
    (1.0, 0.0, 0.0)
    """

    coefficient: float
    bias: float
    variance: float
    covariance: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ResidualAnalysis:
    """One-step residuals of a model on a record, one entry per output.

    Parameters
    ----------
    outputs, inputs : tuple of str
        ny and nu names.
    autocorrelation : array (lags + 1, ny)
        Normalised.
    cross_correlation : array (lags + 1, ny, nu)
        Of the residuals with past inputs, normalised.
    bound : float
        Beyond it in size a correlation is significant at 99 %.
    portmanteau : array (ny,)
        Ljung and Box's probability that white residuals look like this or worse.
    theil : tuple of Theil
        Of the one-step prediction.

    Examples
    --------
    >>> found = idn.residual_analysis(model, record)
    >>> found.autocorrelation.shape, bool(found.portmanteau[0] > 0.01)
    ((26, 1), True)
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    autocorrelation: Array
    cross_correlation: Array
    bound: float
    portmanteau: Array
    theil: tuple[Theil, ...]

    __repr__ = summarized

    @property
    def outside(self) -> Array:
        """(ny,)"""
        return np.mean(np.abs(self.autocorrelation[1:]) > self.bound, axis=0)

    @property
    def inputs_outside(self) -> Array:
        """Share (ny, nu) of the cross-correlation beyond the bound."""
        return np.mean(np.abs(self.cross_correlation) > self.bound, axis=0)

    def __str__(self) -> str:
        lines = [
            f"residuals, one step ahead; correlations beyond {self.bound:.3f} are significant at"
            " 99 %"
        ]
        for y, output in enumerate(self.outputs):
            t = self.theil[y]
            inputs = ", ".join(
                f"{u} {100 * share:.0f} %"
                for u, share in zip(self.inputs, self.inputs_outside[y], strict=True)
            )
            lines.append(
                f"  {output}: {'white' if self.portmanteau[y] > 0.01 else 'coloured'} (p ="
                f" {self.portmanteau[y]:.2g}, {100 * self.outside[y]:.0f} % of lags outside);"
                f" inputs outside: {inputs or 'none'}; Theil {t.coefficient:.3g} (bias"
                f" {t.bias:.2f}, variance {t.variance:.2f}, covariance {t.covariance:.2f})"
            )
        return "\n".join(lines)


def residual_analysis(model: LPVARXModel, record: FlightRecord, lags: int = 25) -> ResidualAnalysis:
    """Compute whiteness, cross-correlation with the inputs, and Theil's coefficients of the
    one-step residuals.

    Rows with a missing neighbour are left out. Cross-correlation with inputs in closed loop may be
    feedback, at positive lags only it is unmodelled dynamics.

    Parameters
    ----------
    model : LPVARXModel
        Any.
    record : FlightRecord
        Of its sample period and units.
    lags : int
        Of the correlations, samples.

    Returns
    -------
    ResidualAnalysis
        `str()` of it says it in a line an output.

    Raises
    ------
    InputError
        Fewer than 10 `lags` residuals remain.

    See Also
    --------
    identification.scores : one step ahead to free run
    identification.uncertainty : covariance that coloured residuals allow

    References
    ----------
    Ljung (1999), System Identification, ch. 16.6; Ljung and Box, Biometrika 65 (1978).

    Examples
    --------
    A model that takes p for constant leaves what moves with it in the residuals:

    >>> lti = idn.residual_analysis(idn.fit(arx.lti(), record), record)
    >>> lpv = idn.residual_analysis(model, record)
    >>> bool(lti.portmanteau[0] < 0.01 < lpv.portmanteau[0])
    True
    """
    guess = model.predict(record, 1)
    y, u = record.columns(model.outputs), record.columns(model.inputs)
    keep = np.isfinite(guess).all(axis=1) & np.isfinite(y).all(axis=1) & np.isfinite(u).all(axis=1)
    n = int(keep.sum())
    lags = whole(lags, "lags", 1)
    if n < 10 * lags:
        raise InputError(
            f"{n} residuals are too few for correlations over {lags} lags; record longer or ask for"
            " fewer"
        )
    error = (y - guess)[keep]
    auto = _correlation(error, error, lags)
    auto = np.stack([auto[:, i, i] for i in range(error.shape[1])], axis=1)
    cross = _correlation(error, u[keep], lags)
    weights = n - np.arange(1, lags + 1)
    statistic = n * (n + 2) * np.sum(auto[1:] ** 2 / weights[:, None], axis=0)
    return ResidualAnalysis(
        outputs=tuple(model.outputs),
        inputs=tuple(model.inputs),
        autocorrelation=auto,
        cross_correlation=cross,
        bound=float(norm.ppf(0.995) / np.sqrt(n)),
        portmanteau=chi2.sf(statistic, lags),
        theil=tuple(theil(y[keep, i], guess[keep, i]) for i in range(y.shape[1])),
    )


def theil(measured: Array, predicted: Array) -> Theil:
    """Return Theil's coefficients of a prediction of a measured signal.

    Parameters
    ----------
    measured, predicted : array (n,)
        In one unit, finite.

    Returns
    -------
    Theil
        Coefficient and shares, dimensionless.

    Raises
    ------
    InputError
        The shapes differ, nothing is in them, or an entry is not finite or too large to be squared.

    References
    ----------
    Theil (1970), Economic Forecasts and Policy.

    Examples
    --------
    >>> round(idn.judge.theil([1.0, 2.0, 3.0], [1.1, 1.9, 3.2]).coefficient, 3)
    0.032
    """
    measured, predicted = np.asarray(measured, float), np.asarray(predicted, float)
    if (
        measured.shape != predicted.shape
        or measured.ndim != 1
        or not len(measured)
        or not np.all(np.abs([measured, predicted]) < LARGEST)
    ):
        raise InputError(
            "theil: expected two finite arrays (n,) of one length, a number in each at least, all"
            f" below {LARGEST:.0e} in magnitude"
        )
    square = float(np.mean((measured - predicted) ** 2))
    size = float(np.sqrt(np.mean(measured**2)) + np.sqrt(np.mean(predicted**2)))
    if np.sqrt(square) <= ROUNDING * size:
        return Theil(0.0, 0.0, 0.0, 0.0)
    a, b = measured - measured.mean(), predicted - predicted.mean()
    bias = float((measured.mean() - predicted.mean()) ** 2) / square
    variance = float((a.std() - b.std()) ** 2) / square
    return Theil(
        float(np.sqrt(square)) / size,
        bias,
        variance,
        float(2 * (a.std() * b.std() - np.mean(a * b))) / square,
    )


def _correlation(e: Array, x: Array, lags: int) -> Array:
    """Correlation (lags + 1, ne, nx) of e(k) with x(k - l)."""
    e, x = e - e.mean(axis=0), x - x.mean(axis=0)
    size = np.sqrt(np.outer(np.sum(e**2, axis=0), np.sum(x**2, axis=0)))
    size = np.where(size > 0, size, 1.0)
    return np.stack([e[lag:].T @ x[: len(x) - lag] / size for lag in range(lags + 1)])
