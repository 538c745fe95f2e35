"""Survey of a log of which only the file is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from symheli.logs.column import Column, forward, unresolved
from symheli.logs.format import Contents, own_clocks
from symheli.logs.meaning import Guess, guesses, moves, plain_name
from symheli.logs.segments import Segment, segments, serving
from symheli.values.sample_period import JITTER, USUAL
from symheli.values.units import to_si

GAP = 1.5
"""Two samples further apart than this many median steps have a gap between them."""

CLOCKS = ("t", "time", "timestamp", "timeus", "timems", "timestampus", "timestampms", "stamp")
"""Plain names of columns that may be the time."""

FORWARD = 0.8
"""Least part of the rows of a clock that come after the row above."""

WINDOW = 25
"""Rows over which an angle is held against its rate: the noise of the rate averages out."""


@dataclass(frozen=True)
class LogClock:
    """The time of a log: the column that counts it ("" where the columns have clocks of their own)
    in `unit`; median step, gaps, the longest step and the duration, all in s.
    """

    column: str
    unit: str
    step: float
    even: bool
    gaps: int
    longest: float
    duration: float


@dataclass(frozen=True)
class ColumnSummary:
    """Motion of a column: samples and those missing, range, mean and standard deviation in its
    guessed or declared unit, its own median step (s).
    """

    samples: int
    missing: int
    low: float
    high: float
    mean: float
    deviation: float
    moves: bool
    step: float | None


@dataclass(frozen=True)
class Survey:
    """What was found; `step` is the sample period that is suggested where the log has no clock,
    `segments` what the log is from when to when, on its own clock, `unresolved` the part of the
    variance of a guessed column that its own rate does not resolve.
    """

    log: Path
    format: str
    clock: LogClock | None
    step: float | None
    motions: Mapping[str, ColumnSummary]
    units: Mapping[str, str | None]
    guesses: Mapping[str, Guess]
    segments: tuple[Segment, ...] = ()
    unresolved: Mapping[str, float] = field(default_factory=dict)

    @property
    def serving(self) -> tuple[Segment, ...]:
        """The segments to identify from; none where nothing is flight of some seconds."""
        return serving(self.segments)

    @property
    def moving(self) -> dict[str, Guess]:
        """Guessed signals that move."""
        return {s: g for s, g in self.guesses.items() if self.motions[g.column].moves}


def survey(
    log: Path,
    contents: Contents,
    *,
    time: str | None = None,
    time_unit: str = "s",
    dt: float | None = None,
) -> Survey:
    """Examine every column of `contents`; `time` (in `time_unit`) and `dt` (s) as the user gives
    them.
    """
    clock, name = None, time
    held = dict(contents.columns)
    if all(column.time is None for column in held.values()):
        name, unit = (time, time_unit) if time in held else _time_of(held)
        if name is not None:
            stamps = to_si(unit)[0] * held.pop(name).values
            held = {
                n: Column(stamps, c.values, c.unit)
                for n, c in held.items()
                if len(c.values) == len(stamps)
            }
            clock = _clock(name, unit, stamps)
    elif not own_clocks(contents.format):
        stamps = next(iter(held.values())).time
        clock = None if stamps is None else _clock("", "s", stamps)
    guessed = guesses(held, contents.format)
    step = contents.step if dt is None else dt
    if step is None and clock is None and not own_clocks(contents.format):
        step = _step_of(held, guessed)
    return Survey(
        log,
        contents.format,
        clock,
        step,
        {n: _motion(c) for n, c in held.items()},
        {n: c.unit for n, c in held.items()},
        guessed,
        segments(held, guessed),
        {g.column: unresolved(held[g.column]) for g in guessed.values()},
    )


def _time_of(held: Mapping[str, Column]) -> tuple[str | None, str]:
    """Return the column that probably is the time, and its unit: by name, and steps that fit;
    (None, "s") where none does.
    """
    for name, column in sorted(held.items(), key=lambda item: item[0] not in ("t", "time")):
        plain, _ = plain_name(name)
        values = column.values
        if plain not in CLOCKS or len(values) < 2 or np.mean(np.diff(values) > 0) < FORWARD:
            continue
        step = float(np.nanmedian(np.diff(values)))
        declared = column.unit if column.unit and to_si(column.unit)[1] == "s" else None
        for unit in [declared] if declared else ["s", "ms", "us", "ns"]:
            if declared or USUAL[0] <= to_si(unit)[0] * step <= USUAL[1]:
                return name, unit
    return None, "s"


def _clock(name: str, unit: str, stamps: np.ndarray) -> LogClock:
    stamps = stamps[np.isfinite(stamps)]
    stamps = stamps[forward(stamps)]
    steps = np.diff(stamps)
    step = float(np.median(steps))
    inside = steps[steps <= GAP * step]
    return LogClock(
        name,
        unit,
        step,
        bool(np.ptp(inside) <= JITTER * step),
        int(np.sum(steps > GAP * step)),
        float(steps.max()),
        float(stamps[-1] - stamps[0]),
    )


def _motion(column: Column) -> ColumnSummary:
    known = column.values[np.isfinite(column.values)]
    step = None
    if column.time is not None and np.sum(forward(column.time)) > 1:
        time = column.time[forward(column.time)]
        step = float(np.median(np.diff(time)))
    shown = known if len(known) else np.array([np.nan])
    return ColumnSummary(
        samples=len(column.values),
        missing=len(column.values) - len(known),
        low=float(shown.min()),
        high=float(shown.max()),
        mean=float(shown.mean()),
        deviation=float(shown.std()),
        moves=moves(column.values),
        step=step,
    )


def _step_of(held: Mapping[str, Column], guessed: Mapping[str, Guess]) -> float | None:
    """Return the sample period (s) by which an angle follows its rate; None where they do not
    determine it.
    """
    for rate, angle in (("q", "theta"), ("p", "phi")):
        if rate in guessed and angle in guessed:
            w, a = (
                to_si(guessed[n].unit)[0] * held[guessed[n].column].values for n in (rate, angle)
            )
            moved = a[WINDOW:] - a[:-WINDOW]
            turned = np.cumsum(np.append(0.0, 0.5 * (w[1:] + w[:-1])))  # NaN from there on
            mean = turned[WINDOW:] - turned[:-WINDOW]
            good = np.isfinite(moved) & np.isfinite(mean)
            moved, mean = moved[good], mean[good]
            if len(mean) and np.any(mean) and np.any(moved):
                step = float(moved @ mean / (mean @ mean))
                agree = moved @ mean / np.sqrt((moved @ moved) * (mean @ mean))
                if agree > 0.5 and USUAL[0] <= step <= USUAL[1]:
                    return step
    return None
