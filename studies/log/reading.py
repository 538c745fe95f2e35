"""Reader of a log of any known format, with the requested signals."""

from __future__ import annotations

import shlex
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from symheli.errors import DataWarning, InputError, UnknownNameError
from symheli.logs.format import format_named
from symheli.logs.signal_map import SignalMap, Source
from symheli.records import FlightRecord
from symheli.records.kinematics import COMPARED
from symheli.records.mending import SCATTER, even
from symheli.records.tied_units import POSITIONS
from symheli.values.sample_period import USUAL, units_of_step
from symheli.values.signal import UNITS

STILL = 1e-6
"""A scheduling signal that moves by less than this part of its size stays where it is."""

COMBINED = "speed"
"""The scheduling signal made of --scheduling-from."""

TIMES = ("t", "time")
"""Columns taken as the time where none is named."""


def read_mapped(path: Path, found: SignalMap, taken: str | None = None) -> FlightRecord:
    """The record by a signal map, on one step; `taken` is the unit of time that was given."""
    step = found.step(path)
    if step is not None:
        found = replace(found, dt=None)
    with _steps_told_here():
        record = FlightRecord.from_map(path, found)
    return on_one_step(record, step, path, taken or found.time_unit)


def on_one_step(
    record: FlightRecord, dt: float | None, path: Path, taken: str | None
) -> FlightRecord:
    """The record at steps of `dt` (s), or of its own where they are even; else, with a
    `DataWarning`, at the even steps that its stamps mean, or interpolated to their mean.

    Raises `InputError` where the time, `taken` in this unit (None: in s, as nobody said
    otherwise), makes steps that no flight record has, and those in another unit would be usual.
    """
    step = float(np.median(np.diff(record.time)))
    if not USUAL[0] <= step <= USUAL[1]:
        said = "" if taken is None else f" in {taken}"
        others = units_of_step(step, taken or "s")
        if others and not (taken == "s" and step > USUAL[1]):
            advice = " or ".join(f"--time-unit {u} ({s:.3g} s)" for u, s in others.items())
            raise InputError(
                f"{path}: the samples are {step:.6g} s apart if the time is{said or ' in s'}; give"
                f" {advice}"
            )
        told = f"the samples are {step:.6g} s apart"
        warnings.warn(told if taken else f"{told}: is the time in s?", DataWarning, stacklevel=3)
    if dt is not None:
        return record.resample(dt)
    try:
        record.dt  # noqa: B018  raises
    except InputError:
        pass
    else:
        return record
    made, period, scatter = even(record)
    if scatter <= SCATTER * period:
        told = (
            f"the stamps scatter by up to {scatter:.2g} s around steps of {period:.5g} s, now even"
        )
    else:
        made = record.resample(float(f"{period:.3g}"))
        told = f"the steps are uneven, the samples {made.resampled}"
    warnings.warn(f"{path}: {told}", DataWarning, stacklevel=3)
    return made


@contextmanager
def _steps_told_here() -> Iterator[None]:
    """Without the note that readers make on odd steps."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "the samples are .* s apart")
        yield


def read(
    path: Path,
    signals: Sequence[str],
    *,
    format: str,
    dt: float | None,
    time: str | None,
    units: Mapping[str, str],
    time_unit: str | None = None,
) -> FlightRecord:
    """Return the record on a uniform step, `dt` (s) if it is given; a time column is in
    `time_unit`.

    A log that names its own signals is read as a whole. Of a table, what `check_kinematics`
    compares is read too where it is there. `units` declares those of `signals`, before the header
    of a table; the names every room knows (u, q, theta, ...) are SI unless declared otherwise. A
    time column and `dt` together resample. Raises `InputError`.
    """
    form = format_named(format)
    if form.own_names:
        return read_mapped(path, SignalMap({}, format, dt=dt), "s")
    if form.own_clocks:
        raise InputError(
            f"{path}: the columns of an autopilot's log are named in a signal map, --map FILE.toml;"
            " symheli identify with the log alone suggests one"
        )
    known = form.declared(path)
    beside = (n for n in (*COMPARED, "airspeed", *POSITIONS) if n in known)
    declared = {
        name: units.get(name) or known.get(name) or UNITS.get(name) or _undeclared(name)
        for name in (*signals, *beside)
    }
    for name in units:
        if name not in declared:
            raise UnknownNameError("signal in --units", name, declared)
    if form.time_column:
        time = time or _time_column(path, known, dt)
    sources = {name: Source(name, unit) for name, unit in declared.items()}
    found = SignalMap(sources, format, time, time_unit, dt)
    return read_mapped(path, found, time_unit or known.get(time or ""))


def _undeclared(name: str) -> str:
    raise InputError(
        f"the unit of {name!r} is not known: --units {shlex.quote(f'{name}=UNIT')}, such as rad,"
        " deg/s, m/s, or 1 where it has none"
    )


def _time_column(path: Path, known: Mapping[str, str | None], dt: float | None) -> str | None:
    for name in TIMES:
        if name in known:
            return name
    if not known:  # a log that does not list its columns
        return TIMES[0]
    if dt is not None:
        return None
    raise InputError(
        f"{path}: no column is called {' or '.join(TIMES)}; name it with --time, or give the sample"
        f" period with --dt; found {', '.join(map(repr, known))}"
    )


def scheduling_range(values: np.ndarray, degree: int) -> tuple[float, float]:
    """The range of the record the basis is declared on. Raises `InputError` where it does not move
    and `degree` is not 0.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        raise InputError("the scheduling signal contains only NaN")
    low, high = float(known.min()), float(known.max())
    if high - low > STILL * max(abs(low), abs(high)):
        return low, high
    if degree > 0:
        raise InputError(
            f"the scheduling signal stays at {low:g}: a model scheduled by it cannot be identified;"
            " --degree 0 fits an LTI model"
        )
    return low - 0.5, high + 0.5
