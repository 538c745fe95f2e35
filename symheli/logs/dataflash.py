"""ArduPilot DataFlash logs, binary (.bin) and text (.log), and PX4's older ones of the same form
(sdlog2, .px4log).

A column is "message.field", such as "IMU.GyrY", of the first instance of the message, or
"IMU[1].GyrY" of another. Logs written since 2018 declare the unit of most fields (their FMTU, UNIT
and MULT messages); those are used. Headings count to 360 degrees and are made continuous.

The instant of a message is in itself, on the autopilot's clock; in the logs of sdlog2 it is that of
the latest message TIME. Where the clock begins again, a later log of the file is set `GAP` behind
the one before it, and "log" is the number of the log.
"""

from __future__ import annotations

import contextlib
import io
import mmap
import os
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.logs.column import GAP, RESTART, Column, continuous, on_one_axis
from symheli.logs.files import Table, bounded, error_text, positive, quiet, units_of, warn_of_damage
from symheli.logs.format import LogFormat
from symheli.logs.meaning import DATAFLASH, SDLOG2, Named
from symheli.logs.signal_map import SignalMap
from symheli.values.units import to_si

LABELS = {
    "deg": "deg",
    "degheading": "deg",
    "deglatitude": "deg",
    "deglongitude": "deg",
    "deg/s": "deg/s",
    "deg/s/s": "deg/s/s",
    "rad": "rad",
    "rad/s": "rad/s",
    "rad/s/s": "rad/s/s",
    "m": "m",
    "m/s": "m/s",
    "m/s/s": "m/s^2",
    "s": "s",
    "us": "us",
    "rpm": "rpm",
    "Hz": "1/s",
    "Pa": "Pa",
    "V": "V",
    "%": "%",
    "satellites": "1",
}
"""Units that ArduPilot writes (libraries/AP_Logger/LogStructure.h), as they are called here. Others
are of no use to a flight record and count as not declared.
"""

NOT_WORKED_OUT = "?"
"""Multiplier of a field whose scale ArduPilot does not know: its unit is then not known either."""

INSTANCE = "#"
"""Unit of the field that tells instances of a message apart."""

CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""Fields that hold the time, in s of one count."""

BATCH = "TIME", "StartTime", 1e-6
"""Message and field with the time of all messages that follow it, in s of one count (sdlog2)."""

BESIDE_THE_WEEK = "T"
"""Field of a GPS message with the autopilot's clock, in ms, where TimeMS beside it counts from the
beginning of the GPS week (until the end of 2014).
"""

FORMAT_HEAD = b"\xa3\x95\x80"
"""First bytes of a message FMT; the type it declares, its size and its name follow."""

HEADING = "degheading"

MODE = "M"
"""Type of a flight mode, which text logs write as a word."""

ABOUT_THE_LOG = ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "FILE")
"""Messages that hold no measurement."""


def read_dataflash(
    path: str | os.PathLike[str],
    fields: Mapping[str, str],
    dt: float,
    units: Mapping[str, str] | None = None,
) -> Table:
    """{signal: "message.field"}, interpolated to steps of `dt` (s) over their common time as
    `symheli.logs.column.on_one_axis` does.

    The log's own units are used; `units` declares those of the signals where it has none. Raises
    `InputError` without pymavlink, for a file that is no such log, messages without time or in no
    common time, and a unit that is missing or contradicts the log; `UnknownNameError` for messages
    and fields the log lacks.
    """
    dt = positive(dt)
    if not fields:
        raise InputError('name at least one signal: fields={"q": "IMU.GyrY", "theta": "ATT.Pitch"}')
    units = units_of(fields, units)
    split = {name: _split(column) for name, column in fields.items()}
    found, _ = _read(path, {message for message, _, _ in split.values()})
    columns = {name: _pick(found, *where, path) for name, where in split.items()}
    known = {
        name: _unit(name, fields[name], column.unit, units.get(name))
        for name, column in columns.items()
    }
    columns = {name: continuous(column, known[name]) for name, column in columns.items()}
    time, values = on_one_axis(columns, dt, path)
    return time, values, known


def dataflash_columns(path: str | os.PathLike[str]) -> dict[str, Column]:
    """Every column of numbers by its name, the instance in it where a message has more than one;
    and "log", the number of the log in the file, where the clock began again.
    """
    found, begun = _read(path, None)
    columns = {
        f"{message}{'' if i == 0 else f'[{instance}]'}.{field}": column
        for message, instances in found.items()
        for i, (instance, columns) in enumerate(instances.items())
        for field, column in columns.items()
        if column.time is not None and (message, field) != BATCH[:2]
    }
    if len(begun) > 1:
        columns["log"] = Column(np.array(begun), 1.0 + np.arange(len(begun)))
    return columns


_Found = dict[str, dict[str, dict[str, Column]]]
"""Column by message, instance ("" where there is only one) and field."""


class _Clock:
    """The clock of a file in which it may begin again: s to add to the instants of messages, so
    that each log is `GAP` behind the log before it, as the messages of one kind, `name`, show.

    One instant far ahead of its neighbours is damage, and no new beginning.
    """

    def __init__(self, log: Any) -> None:
        counts = log.counts
        kinds = {
            form.name: counts.get(form.name, 0) if isinstance(counts, dict) else counts[form.type]
            for form in log.formats.values()
            if _clock_of(form) is not None and form.name not in ABOUT_THE_LOG
        }
        self.name = max(kinds, key=lambda name: (kinds[name], name), default="")
        self.late, self.begun = 0.0, array("d")
        self._last: tuple[float, float] | None = None

    def places(self, message: Any) -> bool:
        """Take note of a message; whether it is known to which log it belongs: between the end of
        one and the first of the telling messages of the next it is not.
        """
        field = _clock_of(message.fmt)
        if field is None:
            return True
        now = CLOCKS[field] * float(getattr(message, field))
        again = self._last is not None and now < min(self._last) - RESTART
        if message.get_type() != self.name:
            return not again
        if self._last is None:
            self._last, self.begun = (now, now), array("d", [now])
        elif again:
            self.late += self._last[1] + GAP - now
            self.begun.append(now + self.late)
            self._last = now, now
        else:
            self._last = self._last[1], now
        return True


def _clock_of(form: Any) -> str | None:
    """The field of a kind of message with the autopilot's clock."""
    if form.name.startswith("GPS"):  # some count from the beginning of the week
        return None
    return next((name for name in CLOCKS if name in form.columns), None)


def _read(
    path: str | os.PathLike[str], wanted: Iterable[str] | None
) -> tuple[_Found, array[float]]:
    """Return these messages, or all, and the instant (s) at which each log of the file begins;
    raise `UnknownNameError` for a message that it lacks.
    """
    rows: dict[tuple[str, str], _Rows] = {}
    now = np.nan
    with _opened(path) as (log, output):
        declared = _declared(log)
        names = dict.fromkeys(form.name for form in log.formats.values())
        present = [name for name in names if name not in ABOUT_THE_LOG]
        chosen = present if wanted is None else wanted
        clock = _Clock(log)
        for message in _messages(log, {*chosen, BATCH[0], clock.name} - {""}):
            name, known = message.get_type(), declared.get(message.fmt.type, {})
            if not clock.places(message) or (name == clock.name and name not in chosen):
                continue
            if name == BATCH[0]:
                now = BATCH[2] * float(getattr(message, BATCH[1], np.nan))
                if name not in chosen:
                    continue
            field = next((f for f, ids in known.items() if ids.unit == INSTANCE), None)
            key = "" if field is None else str(getattr(message, field))
            if (name, key) not in rows:
                rows[name, key] = _Rows(message.fmt)
            rows[name, key].append(message, now, clock.late)
        out: _Found = {}
        for (name, key), found in rows.items():
            known = declared.get(found.form.type, {})
            out.setdefault(name, {})[key] = _columns(found, known)
    if not present:
        raise InputError(
            f"{path}: no readable message; an ArduPilot log begins with the formats of its"
            " messages, and this one may lack its beginning"
        )
    if output.getvalue():
        warn_of_damage(path)
    for name in wanted or ():
        if name not in out:
            raise UnknownNameError(f"message in {Path(path).name}", name, sorted(out) or present)
    return out, clock.begun


def dataflash_parameters(path: str | os.PathLike[str]) -> dict[str, float]:
    """The last value of every parameter in the log that is a finite number."""
    with _opened(path) as (log, _):
        found = {str(m.Name): float(m.Value) for m in _messages(log, {"PARM"})}
    return {name: value for name, value in found.items() if np.isfinite(value)}


@contextlib.contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[tuple[Any, io.StringIO]]:
    """The log, binary or text, and what its reader says of damage."""
    with extra("logs", "reading an ArduPilot log"):
        from pymavlink.DFReader import (  # type: ignore[import-not-found]
            DFReader_binary,
            DFReader_text,
        )
    file = bounded(path)
    with file.open("rb") as opened:
        reader = DFReader_binary if opened.read(2) == b"\xa3\x95" else DFReader_text
    if reader is DFReader_binary:
        _refuse_empty_messages(file)
    try:
        with quiet() as output, _closing(reader) as log:
            log.__init__(str(file))
            yield log, output
    except Exception as error:
        raise InputError(
            f"{file}: not an ArduPilot log, or one that was damaged ({error_text(error)}); download"
            " it once more"
        ) from error


def _refuse_empty_messages(file: Path) -> None:
    """Raise `InputError` where the log declares a message shorter than its own head: readers would
    stand still in front of it.
    """
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at = data.find(FORMAT_HEAD)
        while at >= 0 and at + 9 <= len(data):
            if data[at + 4] < len(FORMAT_HEAD) and data[at + 5 : at + 9].strip(b"\0").isalnum():
                raise InputError(
                    f"{file}: damaged: it declares messages of {data[at + 4]} bytes; download it"
                    " once more"
                )
            at = data.find(FORMAT_HEAD, at + 1)


@contextlib.contextmanager
def _closing(reader: Any) -> Iterator[Any]:
    """A reader that is closed even if it fails to open (its constructor leaves the file open),
    reports damage by Python's logging (its compiled index ignores `quiet`), and skips the search
    for GPS time (which fails for old logs).
    """
    log = object.__new__(reader)
    log.init_arrays_fast, log.init_clock = log.init_arrays, lambda: None
    try:
        yield log
    finally:
        for part in ("data_map", "filehandle"):
            if hasattr(log, part):
                getattr(log, part).close()


def _messages(log: Any, names: Iterable[str]) -> Iterator[Any]:
    """The messages of these names, in order, from the beginning."""
    names = set(names)
    log.rewind()
    while (message := log.recv_match(type=list(names))) is not None:
        if message.get_type() in names:
            yield message


class _FieldUnit(NamedTuple):
    """Unit of a field: its letter, its label here, and the value of one count (None: not known)."""

    unit: str
    label: str
    factor: float | None


def _declared(log: Any) -> dict[int, dict[str, _FieldUnit]]:
    """Return the units that the log declares for its fields, by type of message and name."""
    labels: dict[str, str] = {}
    factors: dict[str, float] = {}
    fields: dict[int, tuple[str, str]] = {}
    for message in _messages(log, ("UNIT", "MULT", "FMTU")):
        match message.get_type():
            case "UNIT":
                labels[chr(message.Id)] = message.Label
            case "MULT":  # a double that was a float
                factors[chr(message.Id)] = float(f"{message.Mult:.7g}") or 1.0
            case _:
                fields[message.FmtType] = message.UnitIds, message.MultIds
    forms = {form.type: form for form in log.formats.values()}
    return {
        number: {
            name: _FieldUnit(
                unit,
                labels.get(unit, ""),
                None if mult == NOT_WORKED_OUT else 1.0 if own else factors.get(mult, 1.0),
            )
            for name, own, unit, mult in zip(
                forms[number].columns, forms[number].msg_mults, *ids, strict=False
            )
        }
        for number, ids in fields.items()
        if number in forms
    }


class _Rows:
    """Messages of one kind: the instants (s) of the batches they stand in (NaN: none), what is to
    be added to their own (s), and their fields of numbers, eight bytes each.
    """

    def __init__(self, form: Any) -> None:
        self.form, self.now, self.late = form, array("d"), array("d")
        self.fields = {
            name: array("d")
            for name, kind, letter in zip(form.columns, form.msg_types, form.msg_fmts, strict=False)
            if kind in (int, float) and letter != MODE
        }

    def append(self, message: Any, now: float, late: float) -> None:
        if message.fmt.columns != self.form.columns:
            return  # its format was declared anew
        self.now.append(now)
        self.late.append(late)
        for name, values in self.fields.items():
            values.append(float(getattr(message, name)))


def _columns(rows: _Rows, known: Mapping[str, _FieldUnit]) -> dict[str, Column]:
    """The fields of numbers of messages of one kind."""
    clock = next((name for name in CLOCKS if name in rows.fields), None)
    factor = CLOCKS.get(clock or "", 1.0)
    if clock == "TimeMS" and rows.form.name.startswith("GPS") and BESIDE_THE_WEEK in rows.fields:
        clock = BESIDE_THE_WEEK
    now, time, keep = np.array(rows.now), None, np.ones(len(rows.now), bool)
    if clock is not None:
        time = factor * np.array(rows.fields[clock]) + np.array(rows.late)
    elif (known_times := np.isfinite(now)).any():
        time, keep = now[known_times], known_times
    out = {}
    for name, field in rows.fields.items():
        if name in (*CLOCKS, clock):
            continue
        values = np.array(field)[keep]
        unit = known.get(name)
        if unit is None or unit.factor is None or unit.label not in LABELS:
            out[name] = Column(time, values)
            continue
        if unit.label == HEADING:
            values = np.unwrap(values, period=360.0)
        scaled = values if unit.factor == 1 else unit.factor * values
        out[name] = Column(time, scaled, LABELS[unit.label])
    return out


def _split(column: str) -> tuple[str, str | None, str]:
    match = re.fullmatch(r"(\w+)(?:\[(\w+)\])?\.(\w+)", column)
    if match is None:
        raise InputError(
            f'{column!r}: a column of an ArduPilot log is "message.field", such as "IMU.GyrY", or'
            ' "IMU[1].GyrY" of another instance'
        )
    message, instance, field = match.groups()
    return message, instance, field


def _pick(found: _Found, message: str, instance: str | None, field: str, path: object) -> Column:
    instances = found[message]
    if instance is not None and instance not in instances:
        raise UnknownNameError(f"instance of {message}", instance, sorted(filter(None, instances)))
    columns = instances[next(iter(instances)) if instance is None else instance]
    if field not in columns:
        raise UnknownNameError(f"field of {message} that holds numbers", field, columns)
    if columns[field].time is None:
        raise InputError(
            f"{path}: {message} carries no time (logs from before 2014), and no message TIME stands"
            " before it; it cannot be placed beside other messages"
        )
    return columns[field]


def _unit(name: str, column: str, logged: str | None, given: str | None) -> str:
    """The log's unit, else the one given."""
    if given is not None:
        to_si(given)
    if logged is None and given is None:
        raise InputError(
            f"the log does not declare the unit of {column}; give it: units={{{name!r}: ...}}"
            " ('1' where it has none)"
        )
    if logged is not None and given is not None and to_si(logged) != to_si(given):
        raise InputError(
            f"{name}: the log says that {column} is in {logged}, not {given}; leave out the unit"
        )
    return logged or given or "1"


class DataFlash(LogFormat):
    """ArduPilot's DataFlash, binary or text, and PX4's older logs of the same form."""

    name, own_clocks = "dataflash", True
    columns = staticmethod(dataflash_columns)

    def recognises(self, head: bytes) -> bool:
        """Whether it declares messages."""
        text = re.search(rb"^FMT, ?\d+, ?\d+, ?\w+,", head, re.MULTILINE)
        return head.startswith(FORMAT_HEAD[:2]) or text is not None

    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Read the fields of a map, on its step."""
        fields = {column: column for column in by.given}
        units = {column: unit for column, unit in by.given.items() if unit}
        return read_dataflash(path, fields, by.needed_step(path), units)

    def named(self, columns: Mapping[str, Column]) -> Named:
        """Return the columns of the firmware."""
        return SDLOG2 if "ATT.RollRate" in columns else DATAFLASH
