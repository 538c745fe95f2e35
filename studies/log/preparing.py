"""What is done to a record before it is fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symheli.errors import InputError
from symheli.lpv import FlightRecord

COMBINED = "speed"


def with_norm(record: FlightRecord, parts: Sequence[str]) -> FlightRecord:
    """With the signal "speed": the Euclidean length of `parts`, which must share one unit."""
    found = {record.signals[record.signals.index(name)].unit for name in parts}  # type: ignore[arg-type]
    if len(found) > 1:
        raise InputError(f"a length needs one unit, {', '.join(parts)} come in {', '.join(sorted(found))}")
    length = np.linalg.norm(record.columns(parts), axis=1)
    return record.with_signals({COMBINED: found.pop()}, **{COMBINED: length})


def smoothed(record: FlightRecord, name: str, seconds: float) -> FlightRecord:
    """`name` after a causal first-order low-pass with this time constant (s), started anew in each segment and behind missing samples."""
    signal, out = record[name], np.full(len(record), np.nan)
    for part in record.segments():
        state = math.nan
        for k in range(part.start, part.stop):
            step = record.time[k] - record.time[k - 1] if k > part.start else 0.0
            state = signal[k] if not math.isfinite(state) else state + (1 - math.exp(-step / seconds)) * (signal[k] - state)
            out[k] = state
    unit = record.signals[record.signals.index(name)].unit  # type: ignore[arg-type]
    return record.with_signals({name: unit}, **{name: out})


def decimated(record: FlightRecord, n: int) -> FlightRecord:
    """Means of `n` samples in a row, all signals alike: a linear relation between them is kept, noise and dt change."""
    if n == 1:
        return record
    times, values = [], []
    for part in record.segments():
        rows = (part.stop - part.start) // n
        stop = part.start + rows * n
        times.append(record.time[part.start : stop].reshape(rows, n).mean(axis=1))
        values.append(record.values[part.start : stop].reshape(rows, n, -1).mean(axis=1))
    if sum(map(len, times)) < 2:
        raise InputError(f"taking {n} samples together leaves fewer than two; the record has {len(record)}")
    return replace(record, time=np.concatenate(times), values=np.concatenate(values))


def cut(record: FlightRecord, start: float | None, stop: float | None) -> FlightRecord:
    """The samples from `start` to `stop` (s on the record's clock)."""
    low, high = -math.inf if start is None else start, math.inf if stop is None else stop
    keep = (record.time >= low) & (record.time < high)
    if keep.sum() < 2:
        raise InputError(f"nothing is left between --start and --stop; the record goes from {record.time[0]:g} to {record.time[-1]:g} s")
    return record.rows(keep)


def split(record: FlightRecord, fraction: float) -> tuple[FlightRecord, FlightRecord | None]:
    """The first `fraction` of the time to fit, and the rest held out (None where nothing rests)."""
    edge = record.time[0] + fraction * (record.time[-1] - record.time[0])
    early = record.time <= edge
    if fraction >= 1 or early.all():
        return record, None
    if early.sum() < 2 or (~early).sum() < 2:
        raise InputError(f"--train {fraction:g} leaves {int(early.sum())} samples to fit and {int((~early).sum())} to judge; record longer")
    return record.rows(early), record.rows(~early)
