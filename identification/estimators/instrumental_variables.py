"""Instrumental variables: closed-loop noise does not reach the external excitation, so that decides
what to believe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from identification.design.excitation import (
    RANK_TOLERANCE,
    column_scale,
    direction_in_words,
    spectrum,
)
from identification.estimators.first_stage import MIN_F, FirstStage, first_stage
from identification.estimators.instruments import (
    FlightSource,
    Instruments,
    InstrumentSource,
    column_space,
    instrument_rows,
    source_of,
)
from identification.estimators.least_squares import least_squares, least_squares_by_group
from identification.estimators.method import Estimate, Method
from identification.estimators.newey_west import long_run_covariance
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import Regression
from symheli.errors import DataWarning, ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array

NOISE_FREE = 1e-6
"""A residual below this part of every output biases no estimate."""

LAGS = 25
"""Number of samples over which residuals are taken to be correlated."""

FADE = 5
"""Samples over which instruments fall to the end of a stretch. Chosen on the seeds 1000 to 1005 of
the study's flights, 5 % of their rows lost.
"""

TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class InstrumentalVariables(Method):
    """Two-stage least squares: consistent whatever colours the noise, provided the instruments and
    p are independent of it.

    Parameters
    ----------
    instruments : str, sequence of str, InstrumentSource or FlightSource
        Names of signals of the record, `LaggedSignals` of them with their window, or another
        source. In closed loop name what is added to the stabilised inputs, in open loop the inputs.
        A `FlightSource` such as `symheli.flight.SimulatedFlight` gives the regressors themselves as
        a simulator flies them: theta = (Z' Phi)^-1 Z' Y. `fit` fills holes up to a tenth of a
        second by that flight.

    Raises
    ------
    InputError
        Neither names nor a source.

    References
    ----------
    Soderstrom and Stoica (1989), System Identification, ch. 8; Ljung (1999), sec. 15.3. Strength:
    Staiger and Stock, Econometrica 65 (1997). Instruments from a simulator: Gilson, Garnier and Van
    den Hof (2004), American Control Conference; Larsson, Sobron, Lundstrom and Enqvist (2020),
    Aerospace 7(9).

    Examples
    --------
    >>> found = idn.fit(arx, record, method=idn.methods.InstrumentalVariables("u"))
    >>> print(found.coefficients.at(0.0).A.round(2), found.details["first_stage_F"] > 10)
    [[[-0.5]]] True
    """

    instruments: Instruments
    shorthand: ClassVar[str] = "iv"

    def __post_init__(self) -> None:
        source_of(self.instruments)

    @classmethod
    def default(cls) -> Method:
        """Raise `InputError`: there is no default, since the external excitation of a flight must
        be named.
        """
        raise InputError(
            'method "iv" needs its instruments: InstrumentalVariables(("name", ...)), the external'
            " excitation added to the stabilised inputs"
        )

    def estimate(self, arx: LPVARX, records: Sequence[FlightRecord], data: Regression) -> Estimate:
        """Estimate the coefficients, with the strength of the instruments in the details, and a
        remark where they are weak.
        """
        source = source_of(self.instruments)
        theta, weakest, known = instrumental_variables(arx, records, data, source)
        error = np.mean((data.y - data.phi @ theta) ** 2, axis=0)
        residual = np.sqrt(error / np.mean(data.y**2, axis=0).clip(TINY))
        covariance = None
        if isinstance(source, FlightSource) and len(arx.groups) == 1:
            covariance = _of_flown(arx, records, data, source, theta)
        return Estimate(
            theta=theta,
            details={
                "first_stage_F": weakest.F,
                "weakest": weakest.direction,
                "without_instruments": len(data.phi) - known,
            },
            remarks=_weakness(weakest) if np.any(residual > NOISE_FREE) else (),
            covariance=covariance,
        )


def _of_flown(
    arx: LPVARX,
    records: Sequence[FlightRecord],
    data: Regression,
    source: FlightSource,
    theta: Array,
) -> Array:
    """M^-1 S M^-T (ny, n, ny, n) of theta = M^-1 Z' Y, M = Z' Phi, S the covariance of Z' e with e
    correlated over `LAGS` samples, in time and between equations.
    """
    Z = instrument_rows(arx, records, source, arx.input_lags.start)[data.rows]
    known = np.isfinite(Z).all(axis=1)
    Z, phi = Z[known] * _faded(data.rows[known], records)[:, None], data.phi[known]
    scale, lengths = column_scale(Z), column_scale(phi)
    W = np.linalg.inv((Z / scale).T @ (phi / lengths)) / lengths[:, None]
    n, ny = phi.shape[1], data.y.shape[1]
    error = data.y[known] - phi @ theta
    scores = ((error[:, :, None] * (Z / scale)[:, None, :]).reshape(len(Z), -1),)
    S = long_run_covariance(scores, LAGS).reshape(ny, n, ny, n)
    out = np.einsum("ab,ibjc,dc->iajd", W, S, W, optimize=True)
    return 0.5 * (out + out.transpose(2, 3, 0, 1))


def _faded(rows: Array, records: Sequence[FlightRecord]) -> Array:
    """Weights (m,) of samples at rows that count through the records: 1, and falling to both ends
    of every stretch. The noise of increments y(k) - y(k-1) cancels but for these ends.
    """
    starts = np.cumsum([0, *(len(record) for record in records)])[:-1]
    stretch = np.searchsorted(starts, rows, side="right")
    breaks = np.flatnonzero((np.diff(rows) > 1) | (np.diff(stretch) > 0)) + 1
    edges = np.concatenate([[0], breaks, [len(rows)]])
    k = np.arange(len(rows))
    after = np.searchsorted(edges, k, side="right")
    near = np.minimum(k + 1 - edges[after - 1], edges[after] - k)
    return np.minimum(near / (FADE + 1), 1.0)


def _weakness(weakest: FirstStage) -> tuple[Warning, ...]:
    if weakest.F >= MIN_F:
        return ()
    return (
        DataWarning(
            f"the instruments are weak (first-stage F {weakest.F:.2g}, usual least {MIN_F:g}):"
            f" along {weakest.direction} the estimate is nearly as biased as least squares; excite"
            " more, name more instruments, widen their window, or lower the order or the degree"
        ),
    )


def starting_point(
    arx: LPVARX,
    records: Sequence[FlightRecord],
    data: Regression,
    source: InstrumentSource | FlightSource | None,
) -> Array:
    """theta (n, ny) from which an iteration starts: by instruments, or without them by least
    squares.
    """
    if source is None:
        return least_squares_by_group(arx, data.phi, data.y)
    return instrumental_variables(arx, records, data, source)[0]


def instrumental_variables(
    arx: LPVARX,
    records: Sequence[FlightRecord],
    data: Regression,
    source: InstrumentSource | FlightSource,
) -> tuple[Array, FirstStage, int]:
    """theta (n, ny) by two-stage least squares with more instruments than unknowns, how strong they
    are where they are weakest, and how many samples have all of them.

    Each instrument is an excitation signal r(k-l) times f(p); offsets, and the increment of p,
    instrument themselves (p is taken as free of the noise). Stage one projects the regressors on
    the instruments (QR), stage two is least squares with what is left of them. Consistent whatever
    colours the noise, provided it is independent of r and p.

    Raises `ExcitationError` where the instruments do not determine every coefficient.
    Source: Soderstrom and Stoica (1989), System Identification, ch. 8; Ljung (1999), sec. 15.3.
    """
    W = instrument_rows(arx, records, source, arx.input_lags.start)[data.rows]
    known = np.isfinite(W).all(axis=1)
    W = W[known]
    if isinstance(source, FlightSource):
        W = W * _faded(data.rows[known], records)[:, None]
    Q = column_space(W) if len(W) else W
    theta, strengths = np.zeros((arx.n_regressors, arx.ny)), []
    own = np.repeat([e.kind in ("offset", "increment") for e in arx.entries], arx.basis.size)
    for group in arx.groups:
        regressors, outputs = arx.regressors(group), np.array(group.outputs)
        names = tuple(arx.regressor_names[i] for i in regressors)
        phi, y = data.phi[known][:, regressors], data.y[known][:, outputs]
        theta[regressors[:, None], outputs] = _two_stages(phi, y, W, Q, names, source)
        strengths.append(first_stage(phi, Q, names, own[regressors]))
    return theta, min(strengths), int(known.sum())


def _two_stages(
    phi: Array,
    y: Array,
    W: Array,
    Q: Array,
    names: tuple[str, ...],
    source: InstrumentSource | FlightSource,
) -> Array:
    n = phi.shape[1]
    if W.shape[1] < n or len(W) < W.shape[1]:
        raise ExcitationError(
            f"{W.shape[1]} instruments on {len(W)} samples cannot determine {n} coefficients an"
            " output: there must be at least as many instruments as coefficients and more samples"
            " than both; name more signals, or change the window or lags of LaggedSignals"
        )
    scale = column_scale(phi)
    first_stage = Q.T @ (phi / scale)
    values, directions = spectrum(first_stage)
    if values[-1] <= RANK_TOLERANCE * values[0]:
        missing = direction_in_words(directions[-1], names)
        raise ExcitationError(
            f"the instruments {source} do not determine: {missing}; excite more inputs, name more"
            " instruments or widen their window"
        )
    return least_squares(first_stage, Q.T @ y) / scale[:, None]
