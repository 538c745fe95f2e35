"""Regressors: lagged signals times functions of the scheduling parameter, row by row of a
record.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.structure.kinematic_arx import KinematicARX
from identification.structure.lpvarx import LPVARX
from symheli.errors import InputError
from symheli.records import FlightRecord
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.sample_period import JITTER, same_period

SIZE_LIMITS = 1e-70, 1e70
"""Least and largest permitted maximum of a signal: sums of squares outside under- or overflow."""


@dataclass(frozen=True, eq=False)
class Samples:
    """The signals of a structure in one record: y (n, ny), u (n, nu), p (n,), f (n, basis size),
    and its unbroken `segments`.

    Several scheduling parameters stand side by side, p (n, parameters). NaN marks what is missing;
    f is NaN where p is.
    """

    y: Array
    u: Array
    p: Array
    f: Array
    segments: tuple[slice, ...]

    @classmethod
    def of(cls, arx: LPVARX, record: FlightRecord) -> Samples:
        """Raises `UnknownNameError` for a signal the record lacks, `InputError` where p leaves the
        basis or a size is absurd.
        """
        record = arx.prepared(record)
        p = scheduling_values(arx, record)
        for name in (*arx.outputs, *arx.inputs):
            _check_size(name, record[name])
        return cls(
            record.columns(arx.outputs),
            record.columns(arx.inputs),
            p,
            basis_values(arx, p),
            record.segments(),
        )


@dataclass(frozen=True, eq=False)
class Regression:
    """y = phi theta + e, one row a usable sample: phi (m, n_regressors), y (m, ny), p (m,) or (m,
    parameters), `rows` (m,) in the record.

    p is that of the sample, or where it is missing there, the latest one in the sample's regressor:
    it is never NaN.
    `dropped` counts the samples without a complete regressor: the first ones after a start or a
    gap, and those NaN touches.
    """

    phi: Array
    y: Array
    p: Array
    rows: Array
    dropped: int

    def residuals(self, theta: Array) -> Array:
        """e (m, ny) of coefficients theta (n_regressors, ny); raises `InputError` where they are
        too large to be squared.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            error = self.y - self.phi @ theta
        size = float(np.max(np.abs(error), initial=0.0))
        if not size <= SIZE_LIMITS[1]:
            raise InputError(
                f"the model leaves residuals of {size:.3g} on these records, whose squares"
                " overflow; check its coefficients and the units of the records"
            )
        return error


def scheduling_values(arx: LPVARX | KinematicARX, record: FlightRecord) -> Array:
    """p of a record: (n,) for one parameter, (n, parameters) for several."""
    p = record.columns(arx.parameters)
    return p[:, 0] if len(arx.parameters) == 1 else p


def basis_values(arx: LPVARX, p: Array) -> Array:
    """The basis at each p (n, size), NaN where p is NaN."""
    out = np.full((len(p), arx.basis.size), np.nan)
    known = np.isfinite(p.reshape(len(p), -1)).all(axis=1)
    out[known] = arx.basis(p[known])
    return out


def regressor_rows(
    arx: LPVARX, y: Array, u: Array, p: Array, f: Array, kinds: Iterable[str] | None = None
) -> Array:
    """phi(k) for k = memory .. n-1 of n consecutive samples, shape (n - memory, number of
    regressors); NaN where a part is missing.

    Only the terms of `kinds` where given. These are the regressors of all equations, each uses its
    own (`arx.free`). An output enters as -y, so that the coefficients are those of A_i.
    """
    n, first, moving = len(p), arx.memory, p.reshape(len(p), -1)
    blocks = []
    for term in arx.terms:
        if kinds is not None and term.kind not in kinds:
            continue
        now, functions = (
            slice(first - term.lag, n - term.lag),
            f[first - term.p_lag : n - term.p_lag],
        )
        match term.kind:
            case "output":
                signal = -y[now][:, list(term.signals)]
            case "input":
                signal = u[now][:, list(term.signals)]
            case "offset":
                signal = np.ones((n - first, 1))
            case "increment":
                signal = moving[first:] - moving[now]
        blocks.append((signal[:, :, None] * functions[:, None, :]).reshape(n - first, -1))
    return np.hstack(blocks) if blocks else np.zeros((n - first, 0))


def regression(arx: LPVARX, record: FlightRecord) -> Regression:
    """Every complete regressor of a record with the outputs it must explain; nothing reaches across
    a gap or a missing sample.
    """
    s = Samples.of(arx, record)
    parts, rows = [], []
    for part in s.segments:
        if part.stop - part.start > arx.memory:
            parts.append(regressor_rows(arx, s.y[part], s.u[part], s.p[part], s.f[part]))
            rows.append(np.arange(part.start + arx.memory, part.stop))
    phi = np.vstack(parts) if parts else np.zeros((0, arx.n_regressors))
    index = np.concatenate(rows) if rows else np.zeros(0, dtype=int)
    keep = np.isfinite(phi).all(axis=1) & np.isfinite(s.y[index]).all(axis=1)
    index = index[keep]
    return Regression(
        phi[keep], s.y[index], _latest(arx, s.p, index), index, len(record) - len(index)
    )


def _latest(arx: LPVARX, p: Array, rows: Array) -> Array:
    """p at each row, or where it is missing there, the latest one that the row's regressor uses."""
    lags = {0, *(term.p_lag for term in arx.terms)}
    points = p.reshape(len(p), p.size // max(len(p), 1))
    choices = np.stack([points[rows - lag] for lag in sorted(lags)])
    first = np.argmax(np.isfinite(choices).all(axis=-1), axis=0)
    return choices[first, np.arange(len(rows))].reshape(len(rows), *p.shape[1:])


def stacked(arx: LPVARX, records: Sequence[FlightRecord]) -> Regression:
    """The regressions of several records on top of each other; `rows` count through the records in
    order.
    """
    parts = [regression(arx, record) for record in records]
    starts = np.cumsum([0, *(len(record) for record in records)])
    return Regression(
        np.vstack([r.phi for r in parts]),
        np.vstack([r.y for r in parts]),
        np.concatenate([r.p for r in parts]),
        np.concatenate([r.rows + start for r, start in zip(parts, starts, strict=False)]),
        sum(r.dropped for r in parts),
    )


def as_records(records: FlightRecord | Iterable[FlightRecord]) -> tuple[FlightRecord, ...]:
    """One or several records as a tuple; raises `InputError` where they are none, or differ in
    sample period or units.
    """
    out = (
        (records,)
        if isinstance(records, FlightRecord)
        else tuple(records)
        if isinstance(records, Iterable)
        else ()
    )
    if not out or not all(isinstance(r, FlightRecord) for r in out):
        raise InputError(
            "expected a FlightRecord or a list of them; build one with FlightRecord.from_frame,"
            " from_csv, ..."
        )
    periods = [r.dt for r in out]
    if not same_period(min(periods), max(periods), JITTER):
        raise InputError(
            f"the records differ in sample period ({min(periods):.4g} to {max(periods):.4g} s);"
            " resample them to one dt"
        )
    return out


def check_units(signals: Iterable[Signal], record: FlightRecord) -> None:
    """Raises `InputError` where `record` has one of these signals in another unit,
    `UnknownNameError` where it lacks one.
    """
    for signal, found in zip(signals, units_of([str(s) for s in signals], [record]), strict=True):
        if signal.unit != found.unit:
            raise InputError(
                f"{str(signal)!r} is in {found.unit} in the record, the model was identified in"
                f" {signal.unit}"
            )


def units_of(names: Sequence[str], records: Sequence[FlightRecord]) -> tuple[Signal, ...]:
    """Return the named signals with the unit the records declare; raise `InputError` where two
    records disagree.
    """
    out = []
    for name in names:
        found = []
        for record in records:
            record.columns([name])  # raises UnknownNameError with the nearest names
            found.append(record.signals[record.signals.index(name)].unit)  # type: ignore[arg-type]
        if len(set(found)) > 1:
            raise InputError(
                f"{name!r} has different units in the records: {', '.join(sorted(set(found)))}"
            )
        out.append(Signal(name, found[0]))
    return tuple(out)


def _check_size(name: str, signal: Array) -> None:
    size, (low, high) = (
        float(np.max(np.abs(signal), initial=0.0, where=np.isfinite(signal))),
        SIZE_LIMITS,
    )
    if size > high or 0 < size < low:
        raise InputError(
            f"{name} reaches {size:.3g}, {'beyond' if size > high else 'below'} what squares can"
            " express; check its unit"
        )


def vector(value: object, size: int, name: str) -> Array:
    """`size` numbers as float64; raises `InputError` for anything else."""
    try:
        array = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected {size} numbers, got {value!r:.80}") from error
    if array.shape != (size,):
        raise InputError(f"{name}: expected shape ({size},), got {array.shape}")
    return np.ascontiguousarray(array)
