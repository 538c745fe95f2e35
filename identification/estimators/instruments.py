"""Sources of instruments, and their regressors: signals that are independent of the noise, at
several lags, times the functions of the scheduling parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from identification.design.excitation import RANK_TOLERANCE, column_scale
from identification.design.tall_factors import orthonormal
from identification.structure.lpvarx import LPVARX
from identification.structure.regressors import (
    Samples,
    basis_values,
    regressor_rows,
    scheduling_values,
    units_of,
)
from symheli.errors import ExcitationError, InputError
from symheli.records import FlightRecord
from symheli.values.arrays import Array, frozen
from symheli.values.numbers import whole


@runtime_checkable
class InstrumentSource(Protocol):
    """Signals independent of the noise in a record, and the lags at which they instrument: anything
    with these two methods.

    `str(source)` names it in messages. The signals may be measured beside the others
    (`LaggedSignals`), or computed: a flight of the same plan in a simulator knows no noise either.

    Examples
    --------
    The same plan, flown by another plant without noise:

    >>> class Simulated:
    ...     def instrument_signals(self, record, names):
    ...         x = np.zeros(len(record))
    ...         for k in range(1, len(x)):
    ...             x[k] = 0.4 * x[k - 1] + record["u"][k - 1]
    ...         return np.column_stack([x, record["u"]])
    ...
    ...     def instrument_lags(self, dt, first, memory):
    ...         return tuple(range(first, memory + 4))
    >>> isinstance(Simulated(), idn.methods.InstrumentSource)
    True
    >>> found = idn.fit(arx, record, method=idn.methods.InstrumentalVariables(Simulated()))
    >>> print(found.coefficients.at(0.0).A.round(2))
    [[[-0.5]]]
    """

    def instrument_signals(self, record: FlightRecord, names: tuple[str, ...]) -> Array:
        """Return the instruments (n, k), a row for each sample of `record`, NaN where unknown;
        `names` are the outputs and inputs of the structure.
        """
        ...

    def instrument_lags(self, dt: float, first: int, memory: int) -> tuple[int, ...]:
        """Lags (samples of `dt` s) from `first`, the least that may instrument; `memory` is the
        longest lag of the structure.
        """
        ...


@runtime_checkable
class FlightSource(Protocol):
    """Instruments from a simulated repetition of the recorded flight without noise and
    disturbances: its regressors, one for each coefficient.

    `symheli.flight.SimulatedFlight` flies the plan of the record in a simulator. That may be wrong:
    the regressors of its flight depend on nothing but what was commanded.

    Examples
    --------
    >>> class Clean:
    ...     def flown(self, record):
    ...         y = np.zeros(len(record))
    ...         for k in range(1, len(y)):
    ...             y[k] = 0.4 * y[k - 1] + record["u"][k - 1]
    ...         return record.with_signals({"y": "1"}, y=y)
    >>> isinstance(Clean(), idn.methods.FlightSource)
    True
    >>> found = idn.fit(arx, record, method=idn.methods.InstrumentalVariables(Clean()))
    >>> print(found.coefficients.at(0.0).A.round(2))
    [[[-0.5]]]
    """

    def flown(self, record: FlightRecord) -> FlightRecord:
        """A record at the times of `record`, with the signals the structure needs."""
        ...


MAX_SAMPLES = 10**9
"""Largest number of samples in a window of instruments."""

Instruments = str | Sequence[str] | InstrumentSource | FlightSource
"""A source of instruments, or the names of signals of the record with the defaults of
`LaggedSignals`.
"""


USUAL_WINDOW, FEWEST = 1.0, 10
"""s, and samples where they lie further apart than such a window can hold."""


@dataclass(frozen=True)
class LaggedSignals:
    """Instruments made of lagged signals of the record, with lags spaced evenly over a window.

    In closed loop what is added to the stabilised inputs, in open loop the inputs; the command is
    an excitation too.

    Parameters
    ----------
    signals : str or sequence of str
        Their names in the record.
    window : float, optional
        How far back they instrument, s; default 1 s, or ten samples where those are longer.
    lags : int
        Most of them in the window.

    Raises
    ------
    InputError
        No names, or an empty window.

    Examples
    --------
    >>> idn.structure.LaggedSignals("u", window=0.5).instrument_lags(dt=0.1, first=1, memory=1)
    (1, 2, 3, 4, 5)
    """

    signals: tuple[str, ...]
    window: float | None = None
    lags: int = 24

    def __post_init__(self) -> None:
        given = (self.signals,) if isinstance(self.signals, str) else tuple(self.signals)
        object.__setattr__(self, "signals", given)
        if not given or not all(isinstance(name, str) for name in given):
            raise InputError(
                "instruments: expected names of signals, the external excitation added to the"
                f" stabilised inputs, got {given!r:.80}"
            )
        whole(self.lags, "lags", 1)
        if self.window is not None and not (np.isfinite(self.window) and self.window > 0):
            raise InputError(f"instruments need a window > 0 s, got {self.window} s")

    def __str__(self) -> str:
        return ", ".join(self.signals)

    def instrument_signals(self, record: FlightRecord, names: tuple[str, ...]) -> Array:
        """The columns (n, k) of the record; `UnknownNameError` for a signal it lacks."""
        return record.columns(self.signals)

    def instrument_lags(self, dt: float, first: int, memory: int) -> tuple[int, ...]:
        """Evenly over the window, whatever the memory of the structure."""
        window = max(USUAL_WINDOW, FEWEST * dt) if self.window is None else self.window
        if not window / MAX_SAMPLES < dt < np.inf:
            raise InputError(
                f"dt: expected seconds, at least a {MAX_SAMPLES}th of the window of {window:g} s,"
                f" got {dt}"
            )
        first = whole(first, "first")
        last = max(first + 1, round(window / dt))
        count = min(self.lags, last - first + 1)
        return tuple(int(i) for i in np.unique(np.round(np.linspace(first, last, count))))


def source_of(instruments: Instruments) -> InstrumentSource | FlightSource:
    """A source itself, or names of signals at the default lags; raises `InputError` for anything
    else.
    """
    if isinstance(instruments, InstrumentSource | FlightSource):
        return instruments
    if isinstance(instruments, str | list | tuple):
        return LaggedSignals(instruments)  # type: ignore[arg-type]
    raise InputError(
        "instruments: expected names of signals of the record, LaggedSignals(...) or another source"
        f" with instrument_signals and instrument_lags, got {instruments!r:.80}"
    )


def instrument_rows(
    arx: LPVARX,
    records: Sequence[FlightRecord],
    source: InstrumentSource | FlightSource,
    first: int,
) -> Array:
    """Instruments (n, m) of every sample of the records, from lag `first` on, NaN where one is
    missing.

    Offsets and the increment of p instrument themselves; of a `FlightSource` they are those of the
    flight, as all its regressors are.
    """
    if isinstance(source, FlightSource):
        return np.vstack([flown_rows(arx, record, source) for record in records])
    return np.vstack([_rows(arx, record, source, first) for record in records])


def flown_rows(arx: LPVARX, record: FlightRecord, source: FlightSource) -> Array:
    """Regressors (n, n_regressors) of the flight a source makes of a record, NaN without a full
    past; raises `InputError` where its samples are not those of the record.
    """
    flown = source.flown(record)
    if len(flown) != len(record) or not np.allclose(flown.time, record.time, atol=0.02 * record.dt):
        raise InputError(
            f"{source} flew other samples than those of the record: {len(flown)} from"
            f" {flown.time[0]:.6g} s, not {len(record)} from {record.time[0]:.6g} s"
        )
    s, out = Samples.of(arx.simulated, flown), np.full((len(record), arx.n_regressors), np.nan)
    for part in record.segments():
        if part.stop - part.start > arx.memory:
            out[part.start + arx.memory : part.stop] = regressor_rows(
                arx, s.y[part], s.u[part], s.p[part], s.f[part]
            )
    return out


def _rows(arx: LPVARX, record: FlightRecord, source: InstrumentSource, first: int) -> Array:
    r, p = _signals(arx, record, source), scheduling_values(arx, record)
    f, y, u = basis_values(arx, p), record.columns(arx.outputs), record.columns(arx.inputs)
    at_lag = arx.scheduling_at == "lag"
    n, parts = len(record), []
    for lag in source.instrument_lags(record.dt, first, arx.memory):
        block = np.full((n, r.shape[1] * f.shape[1]), np.nan)
        for part in record.segments():
            here, then = (
                slice(min(part.start + lag, part.stop), part.stop),
                slice(part.start, max(part.stop - lag, part.start)),
            )
            functions = f[then] if at_lag else f[here]
            products = r[then][:, :, None] * functions[:, None, :]
            block[here] = products.reshape(len(functions), block.shape[1])
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


def _signals(arx: LPVARX, record: FlightRecord, source: InstrumentSource) -> Array:
    found = source.instrument_signals(record, (*arx.outputs, *arx.inputs))
    return frozen(found, f"instruments {source}", (len(record), None), finite=False)


def column_space(W: Array) -> Array:
    """Orthonormal basis of the columns of W, dependent ones dropped."""
    Q, R = orthonormal(W / column_scale(W))
    U, values, _ = np.linalg.svd(R)
    return Q @ U[:, values > RANK_TOLERANCE * values[0]]


def explained(
    arx: LPVARX, records: Sequence[FlightRecord], source: InstrumentSource | FlightSource
) -> tuple[list[FlightRecord], list[FlightRecord]]:
    """Return the records, and the same with inputs and outputs replaced by their projection on the
    instruments (least squares, lags from 0 on).

    What is explained does not know the noise that feedback carries round. Both are NaN where an
    instrument is missing, so that both break at the same samples.
    """
    names = (*arx.inputs, *arx.outputs)
    W = instrument_rows(arx, records, source, 0)
    measured = np.vstack([record.columns(names) for record in records])
    known = np.logical_and(np.isfinite(W).all(axis=1), np.isfinite(measured).all(axis=1))
    if known.sum() <= W.shape[1]:
        raise ExcitationError(
            f"{W.shape[1]} instruments on {known.sum()} samples fit any data exactly; record"
            " longer, or use fewer lags"
        )
    Q = column_space(W[known])
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
