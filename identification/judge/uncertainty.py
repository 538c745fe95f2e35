"""How well the coefficients are known: their covariance, honest about coloured residuals, bands
over p, and the standard error of the frozen frequency response.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from identification.design.excitation import excitation_of
from identification.judge.coefficient_covariance import covariances, drawn
from identification.model.lpvarx_model import LPVARXModel
from identification.model.realization import one_value
from identification.structure.regressors import Regression, as_records, stacked
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.html_table import as_table
from symheli.values.numbers import whole
from symheli.values.summary import summarized


class ResponseBand(NamedTuple):
    """A frozen response and its standard error: the root mean square of |G - truth|, to first order
    in the errors of the coefficients.

    Parameters
    ----------
    omega : array (k,)
        rad/s.
    G : complex array (k, ny, nu)
        Output per input.
    standard_error : array (k, ny, nu)
        In the units of G.

    Examples
    --------
    >>> band = idn.uncertainty(model, record).frequency_response(0.0, [0.1, 1.0])
    >>> print(np.abs(band.G[:, 0, 0]).round(1), bool(band.standard_error.max() < 0.05))
    [2. 2.] True
    """

    omega: Array
    G: Array
    standard_error: Array

    __repr__ = summarized


class Band(NamedTuple):
    """One coefficient function with its standard error at each p.

    Parameters
    ----------
    output : str
        Whose equation it is in.
    regressor : str
        What it multiplies.
    value, standard_error : array (n,)
        At each p, units of the output per that of the regressor.
    freedom, stretch : float
        Those of `Uncertainty`: they make intervals of short or coloured records wider than the
        normal ones.

    Examples
    --------
    >>> band = idn.uncertainty(model, record).bands([0.0])[0]
    >>> low, high = band.interval(0.95)
    >>> band.regressor, bool(low[0] < -0.5 < high[0])
    ('y(k-1)', True)
    """

    output: str
    regressor: str
    value: Array
    standard_error: Array
    freedom: float = float("inf")
    stretch: float = 1.0

    __repr__ = summarized

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper end (n,) of the confidence interval at each p: Student's, `stretch` times
        as wide.
        """
        if not 0 < level < 1:
            raise InputError(f"level: expected a share in (0, 1) such as 0.95, got {level!r}")
        half = student.ppf(0.5 + 0.5 * level, self.freedom) * self.stretch * self.standard_error
        return self.value - half, self.value + half


@dataclass(frozen=True, eq=False, kw_only=True)
class Uncertainty:
    """Covariance of the coefficients of a model.

    Where a record holds fewer than about 15 independent residuals intervals hold the truth less
    often than they say still (docs/identification.md).

    Parameters
    ----------
    model : LPVARXModel
        With n regressors and ny outputs.
    covariance : array (ny, n, ny, n)
        Of theta[i, y] with theta[j, z], as that of the model, and honest about the colour of the
        residuals; zero for coefficients an equation does not have.
    white : array (ny, n, ny, n)
        The same by the formula for white residuals.
    freedom : array (ny,)
        Degrees of freedom of the standard errors; for `stretch` of intervals see
        `identification.judge.coefficient_covariance`.
    lags : int
        Of the correlation, samples.
    samples : int
        Of the fit.

    Examples
    --------
    >>> known = idn.uncertainty(model, record)
    >>> known.standard_errors.shape, bool(known.standard_errors.max() < 0.01)
    ((4, 1), True)
    """

    model: LPVARXModel
    covariance: Array
    white: Array
    freedom: Array
    lags: int
    samples: int

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def stretch(self) -> float:
        """What a taper over the fraction b of a record makes slow noise look smaller by: 1/sqrt(1 -
        b + b^2/3).
        """
        b = min(self.lags / self.samples, 1.0)
        return float(1 / np.sqrt(1 - b + b**2 / 3))

    @property
    def standard_errors(self) -> Array:
        """(n, ny), the Cramer-Rao bounds of normal residuals, corrected for their colour; like
        `model.theta`.
        """
        return np.sqrt(np.maximum(np.einsum("yiyi->iy", self.covariance), 0.0))

    @property
    def colour(self) -> Array:
        """Mean ratio (ny,) of corrected to white standard errors."""
        own = np.sqrt(np.einsum("yiyi->iy", self.white))
        return np.array(
            [
                np.mean(self.standard_errors[free, y] / own[free, y])
                for y, free in enumerate(self.model.structure.free.T)
            ]
        )

    def bands(self, p: object) -> tuple[Band, ...]:
        """Every coefficient function at p (n,) (or (n, parameters)), with its standard error."""
        arx, theta = self.model.structure, self.model.theta
        f = np.atleast_2d(arx.basis(p))
        if f.ndim > 2:
            raise InputError(f"p: expected (n,) or (n, parameters), got {p!r:.80}")
        size = arx.basis.size
        out = []
        for y, output in enumerate(arx.outputs):
            for entry in range(len(arx.entries)):
                block = slice(entry * size, (entry + 1) * size)
                if not arx.free[block, y].any():
                    continue
                error = np.sqrt(
                    np.maximum(
                        np.einsum("ki,ij,kj->k", f, self.covariance[y, block, y, block], f), 0.0
                    )
                )
                name = arx.regressor_names[block.start].rsplit(" f0(", 1)[0]
                out.append(
                    Band(
                        output,
                        name,
                        f @ theta[block, y],
                        error,
                        float(self.freedom[y]),
                        self.stretch,
                    )
                )
        return tuple(out)

    def draws(self, count: int, seed: int = 0) -> tuple[LPVARXModel, ...]:
        """`count` models with coefficients drawn from the normal distribution of this covariance:
        what the truth may be.

        Whatever is made of the model (state space, reduction, a controller's margin) is made of
        each of them to see how far it is certain.
        """
        free = self.model.structure.free
        thetas = drawn(self.model.theta, self.covariance, free, whole(count, "count", 1), seed)
        return tuple(map(self.model.with_theta, thetas))

    def frequency_response(self, p: object, omega: object) -> ResponseBand:
        """The response at `omega` (k,) in rad/s with the scheduling held at p, and its standard
        error.

        It is that of `at(p)` and of both exact state-space forms at p. Raises `InputError` for p
        outside the basis.
        """
        return _response_band(self.model, self.covariance, p, omega)

    def plot(self, level: float = 0.95) -> Array:
        """Axes (coefficients,) with every coefficient function and its confidence band over p; see
        `identification.judge.plots`.
        """
        from identification.judge.plots import plot_bands

        return plot_bands(self, level)


def uncertainty(
    model: LPVARXModel, records: FlightRecord | Iterable[FlightRecord], *, lags: int | None = None
) -> Uncertainty:
    """Compute the covariance of the least-squares coefficients of a model over the records it was
    fitted to.

    With D = (Phi' Phi)^-1 and R(l) the correlation of the residuals, D [sum_k sum_l phi(k) R(k - l)
    phi(l)'] D instead of sigma^2 D: modelling errors colour residuals, and the white formula is
    then too optimistic, often by 5 to 10 times. R is tapered (Bartlett).

    Parameters
    ----------
    model : LPVARXModel
        Fitted by "ls" or "rls".
    records : FlightRecord or iterable of FlightRecord
        Those it was fitted to.
    lags : int, optional
        Of R, samples; default a fifth of the longest run, as in the source.

    Returns
    -------
    Uncertainty
        Standard errors, bands over p, draws.

    Raises
    ------
    InputError
        A model that is not of least squares (instrumental-variable estimates are less certain than
        this says), lags beyond the longest run, coefficients that leave residuals beyond all
        measure.
    ExcitationError
        Records that do not determine the coefficients.

    See Also
    --------
    identification.fit : coefficients from records
    identification.residual_analysis : whiteness and correlations

    References
    ----------
    Morelli and Klein, Accuracy of aerodynamic model parameters estimated from flight test data, J.
    Guidance, Control, and Dynamics 20 (1997).

    Examples
    --------
    >>> bands = idn.uncertainty(model, record).bands([-1.0, 1.0])
    >>> bands[0].value.round(1).tolist()
    [-0.2, -0.8]
    """
    records = as_records(records)
    arx = model.structure
    if not model.least_squares:
        raise InputError(
            f'uncertainty is that of least squares; the model was fitted by "{model.method}"'
        )
    for record in records:
        model.require_same_kind(record)
    data = stacked(arx, records)
    if len(data.phi) <= arx.n_regressors:
        raise InputError(
            f"{len(data.phi)} usable samples say nothing about the certainty of {arx.n_regressors}"
            " coefficients an output"
        )
    excitation_of(arx, data).require()
    runs = _runs(data)
    longest = max(run.stop - run.start for run in runs)
    reach = min(max(longest // 5, 1), longest - 1) if lags is None else lags
    if not (isinstance(reach, int | np.integer) and 0 <= reach < longest):
        raise InputError(f"lags: expected 0 .. {longest - 1} samples, got {lags}")
    error, reach = data.residuals(model.theta), int(reach)
    covariance, white, freedom = covariances(arx, data.phi, error, runs, reach)
    return Uncertainty(
        model=model,
        covariance=covariance,
        white=white,
        freedom=freedom,
        lags=reach,
        samples=len(error),
    )


def _runs(data: Regression) -> list[slice]:
    """Rows whose samples follow one another."""
    breaks = np.flatnonzero(np.diff(data.rows) != 1) + 1
    ends = [0, *breaks.tolist(), len(data.rows)]
    return [slice(a, b) for a, b in pairwise(ends)]


def _response_band(model: LPVARXModel, joint: Array, p: object, omega: object) -> ResponseBand:
    """The response with the scheduling held at p, and its error from the covariance `joint` (ny, n,
    ny, n) of the coefficients.

    With M = I + sum_i A_i z^-i and M G = sum_j B_j z^-j, coefficients that change move G by M^-1
    (sum_j dB_j z^-j - sum_i dA_i z^-i G). Raises `InputError` for p outside the basis.
    """
    arx = model.structure
    omega = np.atleast_1d(frozen(omega, "omega"))
    if omega.ndim != 1:
        raise InputError(f"omega: expected (k,) rad/s, got shape {omega.shape}")
    f = arx.basis(one_value(p, arx.basis))
    size, ny, count = arx.basis.size, arx.ny, len(arx.entries)
    entries = np.einsum(
        "yeazfb,a,b->yezf", joint.reshape(ny, count, size, ny, count, size), f, f
    ).reshape(ny * count, ny * count)
    theta = np.einsum("eby,b->ey", model.theta.reshape(count, size, ny), f)
    G, error = np.zeros((len(omega), ny, arx.nu), complex), np.zeros((len(omega), ny, arx.nu))
    for k, z in enumerate(np.exp(1j * omega * model.dt)):
        M, N = np.eye(ny, dtype=complex), np.zeros((ny, arx.nu), complex)
        for e, entry in enumerate(arx.entries):
            if entry.kind == "output":
                M[:, entry.channel] += theta[e] * z**-entry.lag
            elif entry.kind == "input":
                N[:, entry.channel] += theta[e] * z**-entry.lag
        inverse = np.linalg.inv(M)
        G[k] = inverse @ N
        moved = np.zeros(
            (count, arx.nu), complex
        )  # what a change of an entry's coefficient does to M G
        for e, entry in enumerate(arx.entries):
            if entry.kind == "output":
                moved[e] = -G[k, entry.channel] * z**-entry.lag
            elif entry.kind == "input":
                moved[e, entry.channel] = z**-entry.lag
        J = np.einsum("oy,eu->ouye", inverse, moved).reshape(ny, arx.nu, ny * count)
        error[k] = np.sqrt(np.maximum(np.einsum("oui,ij,ouj->ou", J, entries, J.conj()).real, 0.0))
    return ResponseBand(omega, G, error)
