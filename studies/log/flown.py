"""Parts of a log that a model is fitted to: segments that serve, at a step that its rates bear."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from symheli.errors import DataWarning, InputError
from symheli.logs.column import Column, unresolved
from symheli.logs.segments import MIN_DURATION, Segment, serving
from symheli.records import FlightRecord
from symheli.records.kinematics import comparable
from symheli.records.mending import all_repeats, frozen, without

SERVING, ALL = "serving", "all"
"""Words for the segments that serve, and for the whole log."""

COARSE = 1.5
"""A signal logged at steps longer than so many of the model's is slower than the model."""

UNRESOLVED = 0.05
"""Largest part of the variance of a slower signal above half of its Nyquist frequency: linear
interpolation then misses less than about a fifth of its rms.
"""


def chosen(found: Sequence[Segment], which: str, log: Path) -> tuple[Segment, ...]:
    """The segments called `which`: "serving", "all" or their numbers from 1, "2,3".

    Raises `InputError` for numbers that are none of these, and where no segment serves.
    """
    if which == ALL or not found:
        return tuple(found)
    if which == SERVING:
        if out := serving(found):
            return out
        phases = "; ".join(f"{s.start:.2f} to {s.stop:.2f} s {s.what}" for s in found[:4])
        more = f"; and {len(found) - 4} more" if len(found) > 4 else ""
        raise InputError(
            f"{log}: no segment is flight of at least {MIN_DURATION:g} s: {phases}{more};"
            " --segments all takes the log as it is"
        )
    try:
        return tuple(found[_index(number, len(found))] for number in which.split(","))
    except ValueError as error:
        raise InputError(
            f"--segments: expected serving, all or numbers from 1 to {len(found)} with commas"
            f" between them, got {which!r}"
        ) from error


def _index(number: str, count: int) -> int:
    if not 1 <= int(number) <= count:
        raise ValueError(number)
    return int(number) - 1


def within(record: FlightRecord, segments: Sequence[Segment], log: Path) -> FlightRecord:
    """The samples of a record in these segments; raises `InputError` where too few are left."""
    keep = np.zeros(len(record), bool)
    for one in segments:
        keep |= (record.time >= one.start) & (record.time <= one.stop)
    if keep.sum() < 2:
        raise InputError(
            f"{log}: the chosen segments hold no sample; all signals are there only from"
            f" {record.time[0]:.5g} to {record.time[-1]:.5g} s"
        )
    return record.rows(keep)


def slower(columns: Mapping[str, Column], dt: float) -> dict[str, float]:
    """{signal: its own step (s)} of those logged more seldom than every `dt` (s)."""
    steps = {n: _step(c) for n, c in columns.items() if c.time is not None and len(c.time) > 1}
    return {name: step for name, step in steps.items() if step > COARSE * dt}


def as_measured(
    record: FlightRecord, outputs: Sequence[str], log: Path
) -> tuple[FlightRecord, dict[str, Column]]:
    """The record without what frozen sensors repeat, which a `DataWarning` says, and with slower
    sensors interpolated; those, with the instants of their own values.
    """
    found = all_repeats(record, (*outputs, *comparable(record.signals)))
    for sentence in frozen(record, found):
        warnings.warn(f"{log}: {sentence}", DataWarning, stacklevel=2)
    masks = {name: one.mask for name, one in found.items() if one.mask.any()}
    out, slow = without(record, masks), {}
    for name in (n for n, one in found.items() if one.every > 1):
        known = np.isfinite(out[name])
        slow[name] = Column(record.time[known], out[name][known])
    made = {n: np.interp(record.time, c.time, c.values) for n, c in slow.items()}  # type: ignore[arg-type]
    for name, column in made.items():
        for first, last in found[name].spells:
            column[first + 1 : last + 1] = np.nan
    units = {str(s): s.unit for s in record.signals if str(s) in made}
    return out.with_signals(units, **made).select(list(map(str, record.signals))), slow


def refuse_what_is_invented(
    columns: Mapping[str, Column], names: Iterable[str], dt: float, log: Path
) -> None:
    """Raise `InputError` where one of these signals is slower than `dt` (s) and moves faster than
    its own rate shows.
    """
    for name, step in slower({n: columns[n] for n in names if n in columns}, dt).items():
        if (share := unresolved(columns[name])) > UNRESOLVED:
            raise InputError(
                f"{log}: {name} was logged every {step:.2g} s, and {100 * share:.0f} % of its"
                f" variance lies above {0.25 / step:.2g} Hz, which that rate does not resolve: at"
                f" steps of {dt:.2g} s most of it would be invented; --decimate to about"
                f" {step:.2g} s, or log it more often"
            )


def _step(column: Column) -> float:
    assert column.time is not None  # noqa: S101  asked by the caller
    return float(np.median(np.diff(column.time)))
