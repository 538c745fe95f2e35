"""Instrumental variables: closed-loop noise does not reach the external excitation, so that decides
what to believe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.design.excitation import (
    RANK_TOLERANCE,
    column_scale,
    direction_in_words,
    spectrum,
)
from identification.estimators.first_stage import FirstStage, first_stage
from identification.estimators.least_squares import least_squares
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import (
    Regression,
    basis_values,
    regressor_rows,
    scheduling_values,
    units_of,
)
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array


@dataclass(frozen=True)
class Instruments:
    """External excitation `signals`, over the last `window` s at no more than `lags` lags each."""

    signals: tuple[str, ...]
    window: float = 1.0
    lags: int = 24

    def __post_init__(self) -> None:
        object.__setattr__(
            self,
            "signals",
            (self.signals,) if isinstance(self.signals, str) else tuple(self.signals),
        )
        if not self.signals:
            raise InputError(
                'method="iv" needs instruments=("name", ...): the external excitation added to the'
                " stabilised inputs"
            )
        if not (np.isfinite(self.window) and self.window > 0) or self.lags < 1:
            raise InputError(
                f"instruments need a window > 0 s and at least one lag, got {self.window} s and"
                f" {self.lags}"
            )

    @classmethod
    def of(cls, value: Sequence[str] | Instruments) -> Instruments:
        """Names, or the options themselves."""
        return value if isinstance(value, Instruments) else cls(value)  # type: ignore[arg-type]

    def at(self, dt: float, first: int) -> tuple[int, ...]:
        """The lags in samples, from `first` (the delay of the inputs) on, evenly over the
        window.
        """
        last = max(first + 1, round(self.window / dt))
        return tuple(
            int(i)
            for i in np.unique(np.round(np.linspace(first, last, min(self.lags, last - first + 1))))
        )


def instrumental_variables(
    arx: LPVARX, records: Sequence[FlightRecord], data: Regression, instruments: Instruments
) -> tuple[Array, FirstStage]:
    """theta (n, ny) by two-stage least squares with more instruments than unknowns, and how strong
    they are where they are weakest.

    Each instrument is an excitation signal r(k-l) times f(p); offsets, and the increment of p,
    instrument themselves (p is taken as free of the noise). Stage one projects the regressors on
    the instruments (QR), stage two is least squares with what is left of them. Consistent whatever
    colours the noise, provided it is independent of r and p.

    Raises `ExcitationError` where the instruments do not determine every coefficient.
    Source: Soderstrom and Stoica (1989), System Identification, ch. 8; Ljung (1999), sec. 15.3.
    """
    W = np.vstack(
        [_instrument_rows(arx, record, instruments, arx.input_lags.start) for record in records]
    )[data.rows]
    known = np.isfinite(W).all(axis=1)
    W = W[known]
    Q = _range(W) if len(W) else W
    theta, strengths = np.zeros((arx.n_regressors, arx.ny)), []
    own = np.repeat([e.kind in ("offset", "increment") for e in arx.entries], arx.basis.size)
    for group in arx.groups:
        regressors, outputs = arx.regressors(group), np.array(group.outputs)
        names = tuple(arx.regressor_names[i] for i in regressors)
        phi, y = data.phi[known][:, regressors], data.y[known][:, outputs]
        theta[regressors[:, None], outputs] = _two_stages(phi, y, W, Q, names, instruments)
        strengths.append(first_stage(phi, Q, names, own[regressors]))
    return theta, min(strengths)


def _two_stages(
    phi: Array, y: Array, W: Array, Q: Array, names: tuple[str, ...], instruments: Instruments
) -> Array:
    n = phi.shape[1]
    if W.shape[1] < n or len(W) < W.shape[1]:
        raise ExcitationError(
            f"{W.shape[1]} instruments on {len(W)} samples cannot determine {n} coefficients an"
            " output: there must be at least as many instruments as coefficients and more samples"
            " than both; name more signals, or change the window or lags of Instruments"
        )
    scale = column_scale(phi)
    first_stage = Q.T @ (phi / scale)
    values, directions = spectrum(first_stage)
    if values[-1] <= RANK_TOLERANCE * values[0]:
        missing = direction_in_words(directions[-1], names)
        raise ExcitationError(
            f"the instruments {', '.join(instruments.signals)} leave undetermined: {missing}; "
            "excite more inputs, name more instruments or widen their window"
        )
    return least_squares(first_stage, Q.T @ y) / scale[:, None]


def explained(
    arx: LPVARX, records: Sequence[FlightRecord], instruments: Instruments
) -> tuple[list[FlightRecord], list[FlightRecord]]:
    """The records, and the same with inputs and outputs replaced by what the instruments explain of
    them (least squares, lags from 0 on).

    What is explained does not know the noise that feedback carries round. Both are NaN where an
    instrument is missing, so that both break at the same samples.
    """
    names = (*arx.inputs, *arx.outputs)
    tables = [_instrument_rows(arx, record, instruments, 0) for record in records]
    W, measured = np.vstack(tables), np.vstack([record.columns(names) for record in records])
    known = np.logical_and(np.isfinite(W).all(axis=1), np.isfinite(measured).all(axis=1))
    if known.sum() <= W.shape[1]:
        raise ExcitationError(
            f"{W.shape[1]} instruments on {known.sum()} samples explain anything; record longer, or"
            " use fewer lags"
        )
    Q = _range(W[known])
    found = np.full_like(measured, np.nan)
    found[known] = Q @ (Q.T @ measured[known])
    units = {str(s): s.unit for s in units_of(names, records)}
    ends = np.cumsum([len(r) for r in records])[:-1]

    def replaced(table: Array) -> list[FlightRecord]:
        parts = zip(records, np.split(table, ends), strict=True)
        return [
            record.with_signals(units, **dict(zip(names, part.T, strict=True)))
            for record, part in parts
        ]

    return replaced(np.where(known[:, None], measured, np.nan)), replaced(found)


def _instrument_rows(
    arx: LPVARX, record: FlightRecord, instruments: Instruments, first: int
) -> Array:
    """Instruments (n, m) of every sample of a record, from lag `first` on, NaN where one is
    missing.
    """
    r, p = record.columns(instruments.signals), scheduling_values(arx, record)
    f, y, u = basis_values(arx, p), record.columns(arx.outputs), record.columns(arx.inputs)
    at_lag = arx.scheduling_at == "lag"
    n, parts = len(record), []
    for lag in instruments.at(record.dt, first):
        block = np.full((n, r.shape[1] * f.shape[1]), np.nan)
        for part in record.segments():
            here, then = (
                slice(min(part.start + lag, part.stop), part.stop),
                slice(part.start, max(part.stop - lag, part.start)),
            )
            functions = f[then] if at_lag else f[here]
            block[here] = (r[then][:, :, None] * functions[:, None, :]).reshape(len(functions), -1)
        parts.append(block)
    offsets = np.full(
        (n, (arx.offset + arx.offset_rate * len(arx.parameters)) * f.shape[1]), np.nan
    )
    for part in record.segments():
        if part.stop - part.start > arx.memory:
            offsets[part.start + arx.memory : part.stop] = regressor_rows(
                arx, y[part], u[part], p[part], f[part], kinds=("offset", "increment")
            )
    return np.hstack([*parts, offsets])


def _range(W: Array) -> Array:
    """Orthonormal basis of the columns of W, dependent ones dropped."""
    Q, R = np.linalg.qr(W / column_scale(W))
    U, values, _ = np.linalg.svd(R)
    return Q @ U[:, values > RANK_TOLERANCE * values[0]]
