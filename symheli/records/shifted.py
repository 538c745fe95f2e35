"""Signals of a record where they belong in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from symheli.records.flight_record import FlightRecord
from symheli.values.arrays import Array
from symheli.values.runs import runs

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
        for a, b in runs(np.isfinite(signal[part])):
            if b - a >= SPLINE:
                piece = slice(part.start + a, part.start + b)
                time = record.time[piece]
                out[piece] = CubicSpline(time, signal[piece], extrapolate=False)(time + by)
    return out
