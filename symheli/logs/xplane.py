"""X-Plane's Data.txt: knots, degrees and feet in, body axes and SI out.

| signal | from | unit |
|---|---|---|
| u, v, w | vX (east), vY (up), vZ (south) turned into body axes: velocity over ground | m/s |
| p, q, r | P, Q, R | rad/s |
| phi, theta, psi | roll, pitch, true heading (made continuous) | rad |
| airspeed | true airspeed | m/s |
| stick_lon, stick_lat, stick_ped | elev, ailrn, ruddr yoke, -1..1 as logged | 1 |
| throttle, throttle_actual | the first and the second `thro1`, 0..1 | 1 |
| alpha, beta | alpha, beta | rad |
| altitude, height | above sea level, above ground | m |

A signal is there where the log has its columns. The sticks are not called d_lon ...: what angle
they command is not in the log.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from symheli.errors import InputError
from symheli.logs.column import Column
from symheli.logs.files import Table, positive, text
from symheli.logs.format import Contents, LogFormat
from symheli.logs.meaning import XPLANE
from symheli.logs.signal_map import SignalMap
from symheli.values.units import to_si

CLOCKS = ("totl,time", "real,time", "missn,time", "timer,time")
"""Columns that count seconds, the best first."""

GAP = 10.0
"""Segments are set this many steps apart, so that a record splits there."""

SOURCES = {
    "p": ("P", {"rad/s": "rad/s", "deg/s": "deg/s"}),
    "q": ("Q", {"rad/s": "rad/s", "deg/s": "deg/s"}),
    "r": ("R", {"rad/s": "rad/s", "deg/s": "deg/s"}),
    "phi": ("roll", {"deg": "deg"}),
    "theta": ("pitch", {"deg": "deg"}),
    "psi": ("hding", {"true": "deg"}),
    "airspeed": ("Vtrue", {"ktas": "kt"}),
    "stick_lon": ("elev", {"yoke1": "1"}),
    "stick_lat": ("ailrn", {"yoke1": "1"}),
    "stick_ped": ("ruddr", {"yoke1": "1"}),
    "throttle": ("thro1", {"part": "1"}),
    "throttle_actual": ("thro1#2", {"part": "1"}),
    "alpha": ("alpha", {"deg": "deg"}),
    "beta": ("beta", {"deg": "deg"}),
    "altitude": ("alt", {"ftmsl": "ft"}),
    "height": ("alt", {"ftagl": "ft"}),
}
"""Signal: (name in the log, {second part of the header: unit})."""


@dataclass(frozen=True, eq=False)
class RawTable:
    """Rows under one header: raw columns by "name,unit" without padding, a repeated name with #2,
    #3 ...
    """

    columns: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def read_xplane(path: str | os.PathLike[str], dt: float | None = None) -> Table:
    """Time (s), signals and units (table above) of a Data.txt, its sessions separated by gaps.

    Every header starts a segment with columns of its own; empty segments and a last row cut short
    are left out. Rows are `dt` (s) apart where it is given, else the log's own clock counts; a log
    with neither raises `InputError` with an estimate of dt from the positions and velocities in it.
    A file that is no such log raises `InputError` that says why.
    """
    segments = [s for s in _segments(path) if len(s)]
    if not segments:
        raise InputError(f"{path}: headers but no complete row of numbers")
    signals = [_signals(s.columns) for s in segments]
    if not any(signals):
        raise InputError(
            f"{path}: none of the columns is known; found {', '.join(segments[0].columns)}"
        )
    times = [_clock(s, dt, path, segments) for s in segments]
    keep = [np.concatenate([[True], np.diff(np.maximum.accumulate(t)) > 0]) for t in times]
    step = (
        float(np.median(np.concatenate([np.diff(t[k]) for t, k in zip(times, keep, strict=True)])))
        if dt is None
        else dt
    )
    names = list(dict.fromkeys(name for s in signals for name in s))
    columns: dict[str, list[np.ndarray]] = {name: [] for name in names}
    clock, start = [], 0.0
    for seconds, rows, values in zip(times, keep, signals, strict=True):
        clock.append(start + seconds[rows] - seconds[0])
        start = clock[-1][-1] + GAP * step
        for name in names:
            columns[name].append(
                values[name][rows] if name in values else np.full(int(rows.sum()), np.nan)
            )
    return (
        np.concatenate(clock),
        {n: np.concatenate(c) for n, c in columns.items()},
        {n: _unit(n) for n in names},
    )


def xplane_columns(path: str | os.PathLike[str]) -> tuple[dict[str, Column], float | None]:
    """Signals of a Data.txt, without an instant where the log has no clock; then an estimate of its
    sample period (s), where its positions and velocities give one.
    """
    segments = [s for s in _segments(path) if len(s)]
    clock = all(any(name in s.columns for name in CLOCKS) for s in segments)
    time, values, units = read_xplane(path, None if clock else 1.0)
    step = None if clock else estimated_period(segments)
    return {n: Column(time if clock else None, v, units[n]) for n, v in values.items()}, step


def _segments(path: str | os.PathLike[str]) -> list[RawTable]:
    """Header by header; raises `InputError` with the line where a row does not fit its header."""
    numbered = enumerate(text(path).splitlines(), start=1)
    lines = [(i, line) for i, line in numbered if line.strip(" \t,|")]  # spreadsheets leave commas
    headers = [j for j, (_, line) in enumerate(lines) if _is_header(line)]
    if not headers or headers[0] > 0:
        raise InputError(
            f'{path}: not an X-Plane log: expected a header such as "____Q,rad/s | pitch,__deg |"'
            " in its first line"
        )
    out = []
    for begin, end in zip(headers, [*headers[1:], len(lines)], strict=True):
        names = _names(_fields(lines[begin][1]))
        rows = [(i, _fields(line)) for i, line in lines[begin + 1 : end]]
        if rows and len(rows[-1][1]) < len(names):
            rows.pop()  # the simulator stopped in the middle of a line
        table = np.array([_row(fields, len(names), i, path) for i, fields in rows]).reshape(
            len(rows), len(names)
        )
        out.append(RawTable(dict(zip(names, table.T, strict=True))))
    return out


def _is_header(line: str) -> bool:
    first = line.split("|")[0].strip()
    return "|" in line and "," in first and any(c.isalpha() for c in first)


def _fields(line: str) -> list[str]:
    fields = [field.strip(' \t,"') for field in line.split("|")]  # spreadsheets leave commas
    return fields[:-1] if fields[-1] == "" else fields


def _names(fields: list[str]) -> list[str]:
    names: list[str] = []
    for field in fields:
        name, _, unit = (part.strip("_ ") for part in field.partition(","))
        again = sum(
            n.split(",")[0].split("#")[0] == name and n.split(",")[1] == unit for n in names
        )
        names.append(f"{name}#{again + 1},{unit}" if again else f"{name},{unit}")
    return names


def _row(fields: list[str], width: int, line: int, path: object) -> list[float]:
    if len(fields) != width:
        raise InputError(
            f"{path}, line {line}: expected {width} fields as in the header above, got"
            f" {len(fields)}"
        )
    try:
        return [float(field) for field in fields]
    except ValueError as error:
        raise InputError(f"{path}, line {line}: expected numbers ({error})") from error


def _signals(raw: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The signals of the table that these columns give, in SI."""
    out = {}
    for signal, (name, units) in SOURCES.items():
        for second, unit in units.items():
            if f"{name},{second}" in raw:
                out[signal] = to_si(unit)[0] * raw[f"{name},{second}"]
    if "psi" in out:
        out["psi"] = np.unwrap(out["psi"])
    earth = [raw.get(f"{axis},m/s") for axis in ("vX", "vY", "vZ")]
    if all(v is not None for v in earth) and {"phi", "theta", "psi"} <= out.keys():
        east, up, south = (np.asarray(v) for v in earth)
        body = body_velocity(-south, east, -up, out["phi"], out["theta"], out["psi"])
        out = {**dict(zip("uvw", body, strict=True)), **out}
    return out


def body_velocity(
    north: np.ndarray,
    east: np.ndarray,
    down: np.ndarray,
    phi: np.ndarray,
    theta: np.ndarray,
    psi: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u, v, w (m/s) of a velocity in earth axes (m/s), by the Euler angles psi, theta, phi (rad) in
    that order.
    """
    ahead, right = (
        np.cos(psi) * north + np.sin(psi) * east,
        -np.sin(psi) * north + np.cos(psi) * east,
    )
    u, below = (
        np.cos(theta) * ahead - np.sin(theta) * down,
        np.sin(theta) * ahead + np.cos(theta) * down,
    )
    return u, np.cos(phi) * right + np.sin(phi) * below, -np.sin(phi) * right + np.cos(phi) * below


def _clock(
    segment: RawTable, dt: float | None, path: object, segments: list[RawTable]
) -> np.ndarray:
    if dt is not None:
        return positive(dt) * np.arange(len(segment))
    for name in CLOCKS:
        if name in segment.columns:
            return segment.columns[name]
    estimate = estimated_period(segments)
    hint = (
        ""
        if estimate is None
        else f"; positions against velocities (dX against vX) suggest dt = {estimate:.3f} s"
    )
    raise InputError(f"{path}: the log has no time column; give the sample period dt in s{hint}")


def estimated_period(segments: list[RawTable]) -> float | None:
    """The step (s) that best explains the changes of X, Y, Z by vX, vY, vZ; None where the log
    lacks them or nothing moved.
    """
    moved, speed = [np.zeros(0)], [np.zeros(0)]
    for columns in (s.columns for s in segments):
        for axis in "XYZ":
            if f"{axis},m" in columns and f"v{axis},m/s" in columns:
                v = columns[f"v{axis},m/s"]
                moved.append(np.diff(columns[f"{axis},m"]))
                speed.append(0.5 * (v[1:] + v[:-1]))
    dx, v = np.concatenate(moved), np.concatenate(speed)
    if not np.any(v):
        return None
    near = np.abs(dx) < 10 * np.median(np.abs(dx)) + 1e-9  # a jump of the simulator is no flight
    return float(dx[near] @ v[near] / (v[near] @ v[near]))


def _unit(signal: str) -> str:
    if signal in ("u", "v", "w"):
        return "m/s"
    return to_si(next(iter(SOURCES[signal][1].values())))[1]


class XPlane(LogFormat):
    """X-Plane's Data.txt."""

    name, own_names = "xplane", True
    guessed = XPLANE

    def recognises(self, head: bytes) -> bool:
        """Whether its first line has "name,unit |"."""
        first = next((line for line in head.splitlines() if line.strip()), b"")
        return b"|" in first and b"," in first.split(b"|")[0]

    @staticmethod
    def columns(path: str | os.PathLike[str]) -> Mapping[str, Column]:
        """Return every signal."""
        return xplane_columns(path)[0]

    def contents(self, path: str | os.PathLike[str]) -> Contents:
        """Return every signal, and an estimate of the step of a log without a clock."""
        return Contents(self.name, *xplane_columns(path))

    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Read every signal; with dt in the map rows are dt apart."""
        return read_xplane(path, by.dt)
