"""A TOML file that says where a log keeps which signal, in which unit: written once for an
aircraft, used for every flight of it.

    format = "csv"          # the names of `symheli identify --help`; default: by its content
    time = "time_us"        # time column of csv and mat
    time_unit = "us"
    dt = 0.02               # s: resample to (needed for autopilots, and without a clock)

    [signals]
    q = { column = "gyro_y", unit = "deg/s", scale = -1 }
    airspeed = { column = "pitot", unit = "km/h", offset = 0.4 }

A signal is (scale * column + offset) in `unit`; a log that declares the unit needs none. What the
columns are called stands at the head of the module of the format, such as `symheli.logs.ulog`.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from symheli.errors import InputError, UnknownNameError
from symheli.logs.files import Table, text
from symheli.logs.format import LogFormat, format_named, format_of, known_formats
from symheli.values.units import to_si

KEYS = ("format", "time", "time_unit", "dt", "signals")
ENTRY = ("column", "unit", "scale", "offset")


@dataclass(frozen=True)
class Source:
    """Source of one signal: `column`, its `unit` (None: that of the log), scale * column +
    offset.
    """

    column: str
    unit: str | None
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class SignalMap:
    """The content of a signal map; `load` reads one, `read` applies it to a log. Without signals
    those of a log that names its own are read.
    """

    signals: dict[str, Source]
    format: str | None = None
    time: str | None = None
    time_unit: str | None = None
    dt: float | None = None

    @classmethod
    def load(cls, path: str | os.PathLike[str] | SignalMap) -> SignalMap:
        """Load a map from a TOML file, or return one that is loaded; raise `InputError` with the
        file and the invalid entry.
        """
        if isinstance(path, SignalMap):
            return path
        try:
            table = tomllib.loads(text(path))
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{path} is not valid TOML: {error}") from error
        for key in table:
            if key not in KEYS:
                raise UnknownNameError(f"entry of {path}", key, KEYS)
        given = table.get("signals")
        if not isinstance(given, dict) or not given:
            raise InputError(
                f'{path}: a [signals] table is needed, such as q = {{ column = "gyro_y", unit ='
                ' "deg/s" }'
            )
        signals = {name: _source(entry, f"{path}, signals.{name}") for name, entry in given.items()}
        kind, dt = table.get("format"), table.get("dt")
        if kind is not None and kind not in known_formats():
            raise UnknownNameError(f"format in {path}", str(kind), tuple(known_formats()))
        if dt is not None and not (isinstance(dt, int | float) and math.isfinite(dt) and dt > 0):
            raise InputError(f"{path}: dt must be a positive number of seconds, got {dt!r}")
        return cls(signals, kind, table.get("time"), table.get("time_unit"), dt)

    def over(
        self,
        *,
        time: str | None = None,
        time_unit: str | None = None,
        dt: float | None = None,
        units: Mapping[str, str] | None = None,
    ) -> SignalMap:
        """The map with what is given in place of its own; raises `UnknownNameError` for the unit of
        a signal it lacks.
        """
        signals = dict(self.signals)
        for name, unit in (units or {}).items():
            if name not in signals:
                raise UnknownNameError("signal of the map in units", name, signals)
            signals[name] = replace(signals[name], unit=unit)
        return SignalMap(
            signals, self.format, time or self.time, time_unit or self.time_unit, dt or self.dt
        )

    def read(self, log: str | os.PathLike[str]) -> Table:
        """Time (s), the mapped signals and their units."""
        time, columns, units = self._format(log).read(log, self)
        mapped = {}
        for name, source in (self.signals or {n: Source(n, None) for n in columns}).items():
            if source.column not in columns:
                raise UnknownNameError("signal", source.column, columns)
            unit = self._unit(name, source, units[source.column])
            # scale and offset speak of the declared unit
            factor = to_si(units[source.column])[0] / to_si(unit)[0]
            mapped[name] = source.scale * factor * columns[source.column] + source.offset, unit
        return (
            time,
            {name: column for name, (column, _) in mapped.items()},
            {name: unit for name, (_, unit) in mapped.items()},
        )

    def step(self, log: str | os.PathLike[str]) -> float | None:
        """The sample period (s) to which the log is still to be brought, None where it has it."""
        return self.dt if self._format(log).time_column and self.time is not None else None

    def resampled(self, log: str | os.PathLike[str]) -> str:
        """How the samples that `read` gives were made of others; empty where they were not."""
        return f"columns interpolated to {self.dt:g} s" if self._format(log).own_clocks else ""

    @property
    def given(self) -> dict[str, str | None]:
        """The columns it names, with the unit it gives each (None: that of the log)."""
        return {s.column: s.unit for s in self.signals.values()}

    def needed_step(self, log: str | os.PathLike[str]) -> float:
        """Return dt (s); raise `InputError` where it has none."""
        if self.dt is None:
            raise InputError(
                f"{log}: its columns have clocks of their own; give dt (s) in the signal map to"
                " resample them"
            )
        return self.dt

    def _format(self, log: str | os.PathLike[str]) -> LogFormat:
        return format_named(self.format or format_of(log))

    def _unit(self, name: str, source: Source, found: str) -> str:
        if source.unit is None:
            return found
        if to_si(source.unit)[1] != to_si(found)[1]:
            raise InputError(
                f"signals.{name}: {source.column} comes in {to_si(found)[1]}, which does not"
                f" convert to {source.unit}; correct or leave out the unit"
            )
        return source.unit


def _source(entry: Any, where: str) -> Source:
    if not isinstance(entry, dict) or not isinstance(entry.get("column"), str):
        raise InputError(f'{where}: expected {{ column = "...", unit = "..." }}, got {entry!r}')
    for key in entry:
        if key not in ENTRY:
            raise UnknownNameError(f"entry of {where}", key, ENTRY)
    unit = entry.get("unit")
    if unit is not None:
        to_si(unit)
    numbers = [entry.get("scale", 1.0), entry.get("offset", 0.0)]
    if not all(isinstance(n, int | float) and math.isfinite(n) for n in numbers) or numbers[0] == 0:
        raise InputError(
            f"{where}: scale must be a number other than 0 and offset a number, got {numbers}"
        )
    return Source(entry["column"], unit, float(numbers[0]), float(numbers[1]))
