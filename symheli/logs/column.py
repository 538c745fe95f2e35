"""One column of a log, with the clock it was written by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from symheli.errors import InputError
from symheli.values.units import to_si

MAX_PAUSE = 5.0
"""A pause of a column longer than this many of its median steps is filled with NaN."""

A_TURN = 0.9
"""Part of a turn that no angle moves by from one sample to the next."""

MAX_UPSAMPLING = 1e4
"""Largest number of samples, relative to the column with most, that a step may produce."""

MAX_SAMPLES = 2**24
"""Most samples of a column that a step may produce: 128 MiB."""

MIN_SPECTRUM = 32
"""Fewest samples of a column that have a spectrum."""

HOLE = 5.0
"""s: where no column has a sample for longer, none are made."""


@dataclass(frozen=True, eq=False)
class Column:
    """Samples (n,) of one column of a log and their instants in s (n,), as logged.

    `time` None where the log has no clock; `unit` None where the log declares none, else one that
    `symheli.values.units.to_si` knows.
    """

    time: np.ndarray | None
    values: np.ndarray
    unit: str | None = None


RESTART = 10.0
"""A clock that goes back by more, s, began again."""

GAP = 10.0
"""s between two logs of a file, of which the second begins earlier than the first ends."""


def forward(time: np.ndarray) -> np.ndarray:
    """Return the mask of the samples whose instant is later than all before: repeats and steps back
    are dropped.
    """
    return np.concatenate([[True], np.diff(np.maximum.accumulate(time)) > 0])


def continuous(column: Column, unit: str) -> Column:
    """An angle in `unit` goes on where it jumped by a turn, as headings do that end at 360 degrees;
    what is no angle stays as it is.
    """
    factor, si = to_si(unit)
    turn, known = 2 * np.pi / factor, np.isfinite(column.values)
    if si != "rad" or not np.any(np.abs(np.diff(column.values[known])) > A_TURN * turn):
        return column
    values = np.array(column.values, float)
    values[known] = np.unwrap(values[known], period=turn)
    return replace(column, values=values)


def unresolved(column: Column) -> float:
    """Part of the variance above half of the Nyquist frequency of the column's own rate, which
    linear interpolation misses by a fifth and more: 0 of what is slow, 0.5 of white noise.
    """
    known = column.values[np.isfinite(column.values)]
    if len(known) < MIN_SPECTRUM or not np.ptp(known) > 0:
        return 0.0
    from scipy.signal import welch

    frequency, density = welch(known - known.mean(), nperseg=min(256, len(known)))
    return float(density[frequency > 0.25].sum() / max(density.sum(), np.finfo(float).tiny))


def on_one_axis(
    columns: Mapping[str, Column], dt: float, path: object
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return columns of different rates at steps of `dt` (s), interpolated linearly between
    neighbours, over the interval common to all, at instants of the log's clock.

    Nothing is filtered: what is faster than half of 1 / dt folds back. Within a silence (more than
    5 median steps of that column) samples are missing; where all columns are silent for more than
    5 s there are none. Raises `InputError` where no instant is common, and for a step far finer
    than the log.
    """
    series = {}
    for name, column in columns.items():
        if column.time is None or len(column.time) < 2:
            raise InputError(f"{path}: {name!r} has fewer than two samples")
        keep = forward(column.time)
        series[name] = column.time[keep], column.values[keep]
    start, stop = max(t[0] for t, _ in series.values()), min(t[-1] for t, _ in series.values())
    if stop - start < dt:
        last, first = (
            pick(series, key=lambda name: series[name][0][end])
            for pick, end in ((max, 0), (min, -1))
        )
        raise InputError(
            f"{path}: the columns have no time in common: {last!r} starts at {start:.3f} s,"
            f" {first!r} ends at {stop:.3f} s; leave one of them out"
        )
    spans = without_holes([time for time, _ in series.values()], start, stop)
    samples, logged = np.ptp(spans, axis=1).sum() / dt, max(len(t) for t, _ in series.values())
    if not samples <= min(MAX_UPSAMPLING * logged, MAX_SAMPLES):
        raise InputError(
            f"{path}: {samples:.1e} steps of {dt:g} s for {logged} samples; dt is in seconds, or a"
            f" clock of the log is damaged (it runs from {start:.6g} to {stop:.6g} s)"
        )
    counts = np.floor((spans - start) / dt + 1e-9).astype(np.int64)  # grid points up to each end
    counts[1:, 0] = np.ceil((spans[1:, 0] - start) / dt - 1e-9).astype(np.int64)
    grid = start + dt * np.concatenate([np.arange(a, b + 1) for a, b in counts])
    return grid, {name: _interpolate(grid, *pair) for name, pair in series.items()}


def without_holes(times: Sequence[np.ndarray], start: float, stop: float) -> np.ndarray:
    """First and last instants (k, 2), s, of the parts of start to stop in which some column has a
    sample at least every `HOLE` seconds (every 5 of its median steps, where that is longer).
    """
    own = max(float(np.median(np.diff(time))) for time in times)
    instants = np.unique(np.concatenate([[start, stop], *times]))
    instants = instants[(instants >= start) & (instants <= stop)]
    holes = np.flatnonzero(np.diff(instants) > max(HOLE, MAX_PAUSE * own))
    firsts, lasts = [instants[0], *instants[holes + 1]], [*instants[holes], instants[-1]]
    return np.array([firsts, lasts]).T


def _interpolate(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    out = np.interp(grid, time, values)
    if len(time) > 2:
        after = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
        step = time[after] - time[after - 1]
        exact = np.isclose(grid, time[after], rtol=0, atol=1e-9) | np.isclose(
            grid, time[after - 1], rtol=0, atol=1e-9
        )
        out[(step > MAX_PAUSE * np.median(np.diff(time))) & ~exact] = np.nan
    return out
