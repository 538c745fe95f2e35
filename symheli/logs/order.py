"""Order of the rows of a table by their clock: late and repeated rows, and clocks that jump."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from symheli.errors import DataWarning, InputError
from symheli.values.arrays import Array

FAR = 50
"""Median steps from its neighbours beyond which a stamp is no late row's."""

FEW = 20
"""Fewer rows than this in a run of stamps far from their neighbours' are left out."""

OVERLAP = 3
"""New rows at instants already logged that show a clock set back."""

REPEATED = 0.2
"""Part of the rows that may repeat an instant with other values: beyond it the clock is coarse."""

PAUSE = 10.0
"""s between what was logged before a clock was set back and what was logged after it."""


def in_order(
    time: Array, columns: Mapping[str, Array], path: object
) -> tuple[Array, dict[str, Array]]:
    """The instants (n,) in s, increasing, and the columns at them; `DataWarning` says what was
    changed.

    Rows that come late are sorted, rows that repeat an instant or have no instant left out, and
    what follows a clock set back stands 10 s behind what is before it. A few rows with stamps far
    from their neighbours' are left out. Raises `InputError` where a fifth of the rows shares its
    instant with others.
    """
    if np.all(np.diff(time) > 0):
        return time, dict(columns)
    values = np.column_stack([time, *columns.values()])
    known = np.flatnonzero(np.isfinite(time))
    said = [(len(time) - len(known), "without a time left out")]
    if len(known) < 2:
        missing = int(np.flatnonzero(~np.isfinite(time))[0]) + 1
        raise InputError(f"{path}: the time is missing in row {missing} and all others but one")
    time = time[known]
    forward = np.diff(time)[np.diff(time) > 0]
    step = float(np.median(forward)) if len(forward) else 1.0
    kept, shifts = _runs(time, values[known], step)
    said.append(
        (len(time) - sum(map(len, kept)), "with a time far from their neighbours' left out")
    )
    stamps = np.concatenate([time[run] + shift for run, shift in zip(kept, shifts, strict=True)])
    index = np.concatenate(kept)
    late = int(np.sum(stamps < np.maximum.accumulate(stamps)))
    order = np.argsort(stamps, kind="stable")
    stamps, index = stamps[order], known[index[order]]
    fresh = np.concatenate([[True], np.diff(stamps) > 0])
    copies = np.concatenate([[False], _same(values[index[1:], 1:], values[index[:-1], 1:])])
    if np.sum(~fresh & ~copies) > REPEATED * len(stamps):
        raise InputError(
            f"{path}: {int(np.sum(~fresh))} of {len(time)} rows have the time of the row before"
            " and other values: the time must increase; log it with more digits"
        )
    said += [(int(np.sum(~fresh)), "that repeat a time left out"), (late, "that come late sorted")]
    told = [f"{many} {'row' if many == 1 else 'rows'} {what}" for many, what in said if many]
    if backs := int(np.sum(np.diff(shifts) > 0)):
        told.append(
            f"the clock was set back {backs} time{'s' * (backs > 1)}, what follows counts as"
            f" {PAUSE:g} s later"
        )
    if told:
        warnings.warn(f"{path}: {', '.join(told)}", DataWarning, stacklevel=4)
    index = index[fresh]
    return stamps[fresh], {name: column[index] for name, column in columns.items()}


def _runs(time: Array, values: Array, step: float) -> tuple[list[Array], list[float]]:
    """Indices of each run of rows on one clock, and what is added to its stamps (s)."""
    jumps = np.flatnonzero(np.abs(np.diff(time)) > FAR * step) + 1
    cuts = [0, *jumps.tolist(), *_set_back(time, values, step, jumps), len(time)]
    runs = [np.arange(a, b) for a, b in pairwise(sorted(set(cuts)))]
    kept: list[Array] = []
    shifts: list[float] = []
    last, shift = -np.inf, 0.0
    for i, run in enumerate(runs):
        first, ahead = time[run].min() + shift, runs[i + 1 :]
        behind = ahead[0] if ahead else run
        fits = first > last and time[run].max() <= time[behind].max()
        if len(run) < FEW and not fits and len(runs) > 1:
            continue
        if first <= last:
            shift += last + PAUSE - first
        kept.append(run)
        shifts.append(shift)
        last = time[run].max() + shift
    return kept, shifts


def _set_back(time: Array, values: Array, step: float, jumps: Array) -> list[int]:
    """Rows from which a clock that was set back by less goes on over instants already logged."""
    out, begin = [], 0
    for k in np.flatnonzero(np.diff(time) < 0) + 1:
        begin = max([begin, *jumps[jumps < k].tolist()])
        before = np.arange(begin, k)
        if k in jumps or not len(before):
            continue
        latest = time[before].max()
        after = np.arange(k, min(k + FAR, len(time)))
        passed = np.flatnonzero(time[after] > latest)
        after = after[: passed[0] if len(passed) else None]
        nearest = before[np.argmin(np.abs(time[before][None] - time[after][:, None]), axis=1)]
        again = np.abs(time[nearest] - time[after]) < 0.5 * step
        fresh = again & ~_same(values[nearest, 1:], values[after, 1:])
        if np.sum(fresh) >= max(OVERLAP, 0.5 * len(after)):
            out.append(int(k))
            begin = int(k)
    return out


def _same(one: Array, other: Array) -> Array:
    """Whether rows hold the same numbers, or are missing alike."""
    return np.all((one == other) | (np.isnan(one) & np.isnan(other)), axis=1)
