"""PX4 ULog files.

A column is "topic.field", such as "vehicle_angular_velocity.xyz[1]", of the first instance of the
topic, or "topic.1.field" of another. Beside what is logged, a topic with a quaternion q[0..3] has
the Euler angles `phi`, `theta` and `psi` (rad, psi continuous) of the rotation from body to earth
axes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.logs.column import Column, continuous, on_one_axis
from symheli.logs.files import Table, bounded, error_text, positive, quiet, warn_of_damage
from symheli.logs.format import LogFormat
from symheli.logs.meaning import ULOG
from symheli.logs.signal_map import SignalMap

QUATERNION = tuple(f"q[{i}]" for i in range(4))
ANGLES = ("phi", "theta", "psi")

HEADER = 16
"""Bytes before the first message."""

FIELD = re.compile(r"\s*(\w+)(?:\[(\d+)\])?\s+\w+;?")
"""Type of a field, and how many it has."""

MAX_FIELDS = 2**16
"""A message has at most so many bytes, and a topic no more fields."""

MAX_NESTED = 50
"""Most topics within each other."""


class _Instance(NamedTuple):
    """Instance of a topic: its number in the log, and its fields."""

    number: int
    data: Mapping[str, np.ndarray]


def read_ulog(
    path: str | os.PathLike[str], topics: Mapping[str, tuple[str, str, str]], dt: float
) -> Table:
    """{signal: (topic, field, unit)}, interpolated to steps of `dt` (s) over their common time as
    `symheli.logs.column.on_one_axis` does. "topic.1" is another instance of a topic than its first.

    Raises `InputError` without pyulog, for a file that is no ULog or was cut, and where the topics
    do not overlap; `UnknownNameError` for topics, instances and fields the log lacks.
    """
    dt = positive(dt)
    if not topics:
        raise InputError(
            'name at least one signal: topics={"q": ("vehicle_angular_velocity", "xyz[1]",'
            ' "rad/s")}'
        )
    logged = _topics(path)
    columns = {
        name: continuous(_column(logged, topic, field), unit)
        for name, (topic, field, unit) in topics.items()
    }
    time, values = on_one_axis(columns, dt, path)
    return time, values, {name: unit for name, (_, _, unit) in topics.items()}


def ulog_columns(path: str | os.PathLike[str]) -> dict[str, Column]:
    """Every column of numbers by its name, the instance in it where a topic has more than one."""
    out = {}
    for topic, instances in _topics(path).items():
        for i, (number, data) in enumerate(instances):
            names = [*data, *(ANGLES if set(QUATERNION) <= data.keys() else ())]
            for field in names:
                if not field.startswith(("timestamp", "_padding")):
                    prefix = topic if i == 0 else f"{topic}.{number}"
                    out[f"{prefix}.{field}"] = _column({topic: [instances[i]]}, topic, field)
    return out


def split_column(column: str) -> tuple[str, str]:
    """("topic", "field") or ("topic.1", "field") of a column; raises `InputError` where it is
    none.
    """
    topic, _, field = column.partition(".")
    number, dot, rest = field.partition(".")
    if dot and number.isdigit():
        topic, field = f"{topic}.{number}", rest
    if not field:
        raise InputError(
            f'{column!r}: a column of a ULog is "topic.field", such as'
            ' "vehicle_angular_velocity.xyz[1]", or "topic.1.field" of another instance'
        )
    return topic, field


def unit_of(field: str) -> str:
    """Return the unit of a field that the user gave none for: a ULog declares none; phi, theta and
    psi are computed in rad.
    """
    return "rad" if field in ANGLES else "1"


def _refuse_endless_formats(file: Path) -> None:
    """Raise `InputError` where a topic is declared with more fields than a message can hold, or as
    a part of itself: a reader would list them all.
    """
    parts: dict[str, list[tuple[str, float]]] = {}
    with file.open("rb") as opened:
        opened.seek(HEADER)
        while len(head := opened.read(3)) == 3:
            size, kind = int.from_bytes(head[:2], "little"), head[2:]
            if kind in b"AD":  # what is declared stands before what is logged
                break
            content = opened.read(size)
            if kind == b"F":
                name, _, fields = content.decode("latin-1").partition(":")
                parts[name] = [(m[1], float(m[2] or 1)) for m in FIELD.finditer(fields)]
    counts: dict[str, float] = {}

    def count(name: str, above: tuple[str, ...] = ()) -> float:
        if name in above or len(above) > MAX_NESTED:
            return np.inf
        if name not in counts:
            inside = parts.get(name)
            counts[name] = (
                1.0
                if inside is None
                else sum(n * count(kind, (*above, name)) for kind, n in inside)
            )
        return counts[name]

    for name in parts:
        if count(name) > MAX_FIELDS:
            raise InputError(
                f"{file}: damaged: topic {name!r} is declared with {count(name):.0f} fields, a"
                f" message holds at most {MAX_FIELDS}; copy it from the aircraft once more"
            )


def _topics(path: str | os.PathLike[str]) -> dict[str, list[_Instance]]:
    """The instances of each topic, by number."""
    with extra("logs", "reading a ULog file"):
        from pyulog import ULog  # type: ignore[import-not-found]
    file = bounded(path)
    _refuse_endless_formats(file)
    try:
        with file.open("rb") as opened, quiet():
            log = ULog(opened)
    except Exception as error:
        raise InputError(
            f"{file}: not a ULog file, or one that was cut or damaged"
            f" ({error_text(error)}); copy it from the aircraft once more"
        ) from error
    if log.file_corruption:
        warn_of_damage(file)
    out: dict[str, list[_Instance]] = {}
    for dataset in log.data_list:
        if "timestamp" not in dataset.data:  # its name was damaged
            warn_of_damage(file)
            continue
        out.setdefault(dataset.name, []).append(_Instance(dataset.multi_id, dataset.data))
    if not out:
        raise InputError(f"{file}: a ULog without a sample; was the aircraft armed?")
    return {topic: sorted(found, key=lambda one: one.number) for topic, found in out.items()}


def _column(logged: Mapping[str, list[_Instance]], topic: str, field: str) -> Column:
    name, dot, number = topic.partition(".")
    if name not in logged:
        raise UnknownNameError("topic", name, sorted(logged))
    found = [one for one in logged[name] if not dot or str(one.number) == number]
    if not found:
        numbers = [str(one.number) for one in logged[name]]
        raise UnknownNameError(f"instance of {name}", number, numbers)
    data: Mapping[str, Any] = found[0].data
    time = 1e-6 * np.asarray(data["timestamp"], dtype=float)
    if field in ANGLES and set(QUATERNION) <= data.keys():
        quaternion = [np.asarray(data[q], dtype=float) for q in QUATERNION]
        return Column(time, euler_angles(*quaternion)[ANGLES.index(field)], "rad")
    if field not in data:
        raise UnknownNameError(f"field of {topic}", field, sorted(data))
    return Column(time, np.asarray(data[field], dtype=float))


def euler_angles(
    q0: np.ndarray, q1: np.ndarray, q2: np.ndarray, q3: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """phi, theta, psi (rad) of the unit quaternion that turns body into earth axes (forward, right,
    down; north, east, down), psi made continuous; NaN where it has no length.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.sqrt(q0**2 + q1**2 + q2**2 + q3**2)
        a, b, c, d = (q / size for q in (q0, q1, q2, q3))
    phi = np.arctan2(2 * (a * b + c * d), 1 - 2 * (b**2 + c**2))
    theta = np.arcsin(np.clip(2 * (a * c - b * d), -1.0, 1.0))
    psi, known = np.arctan2(2 * (a * d + b * c), 1 - 2 * (c**2 + d**2)), np.isfinite(size)
    psi[known] = np.unwrap(psi[known])
    return phi, theta, psi


class ULog(LogFormat):
    """PX4's ULog."""

    name, begins, own_clocks = "ulog", b"ULog", True
    guessed = ULOG
    columns = staticmethod(ulog_columns)

    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Read the fields of a map, on its step."""
        step = by.needed_step(path)
        topics = {}
        for column, unit in by.given.items():
            topic, field = split_column(column)
            topics[column] = topic, field, unit or unit_of(field)
        return read_ulog(path, topics, step)
