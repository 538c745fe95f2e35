"""Signals of a record where they belong in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array

SPLINE = 4
"""Least number of samples of a cubic spline."""


def shifted(record: FlightRecord, late: Mapping[str, float]) -> FlightRecord:
    """The record with the signals `late` (name: s) as they are that much later, between samples by
    cubic splines over every unbroken piece; NaN where that is not in the record.
    """
    columns = {name: _later(record, record[name], by) for name, by in late.items() if by}
    units = {str(s): s.unit for s in record.signals if s in columns}
    return record.with_signals(units, **columns) if columns else record


def _later(record: FlightRecord, signal: Array, by: float) -> Array:
    out = np.full_like(signal, np.nan)
    for part in record.segments():
        known = np.isfinite(signal[part]).astype(int)
        edges = part.start + np.flatnonzero(np.diff(np.concatenate([[0], known, [0]])))
        for a, b in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            if b - a >= SPLINE:
                time = record.time[a:b]
                out[a:b] = CubicSpline(time, signal[a:b], extrapolate=False)(time + by)
    return out
