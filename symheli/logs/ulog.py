"""PX4 ULog files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.logs.files import Table, existing, positive

SILENCE = 5.0
"""A topic that pauses for more than this many of its median steps is missing (NaN) in between."""


def read_ulog(
    path: str | os.PathLike[str], topics: Mapping[str, tuple[str, str, str]], dt: float
) -> Table:
    """{signal: (topic, field, unit)} from the first instance of each topic, interpolated to steps
    of `dt` (s) over their common time.

    Time counts from the first common instant. Raises `InputError` without pyulog, for a file that
    is no ULog, and where the topics do not overlap; `UnknownNameError` for topics and fields the
    log lacks.
    """
    dt = positive(dt)
    if not topics:
        raise InputError(
            'name at least one signal: topics={"q": ("vehicle_angular_velocity", "xyz[1]",'
            ' "rad/s")}'
        )
    series = _series(path, topics)
    start, stop = max(t[0] for t, _ in series.values()), min(t[-1] for t, _ in series.values())
    if stop - start < dt:
        raise InputError(
            f"{path}: the topics have no time in common (latest start {start:.3f} s, earliest end"
            f" {stop:.3f} s)"
        )
    grid = start + dt * np.arange(int((stop - start) / dt + 1e-9) + 1)
    columns = {name: _interpolate(grid, *pair) for name, pair in series.items()}
    return grid - start, columns, {name: unit for name, (_, _, unit) in topics.items()}


def _series(
    path: str | os.PathLike[str], topics: Mapping[str, tuple[str, str, str]]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    with extra("logs", "reading a ULog file"):
        from pyulog import ULog  # type: ignore[import-not-found]
    file = existing(path)
    try:
        log = ULog(str(file))
    except Exception as error:
        raise InputError(f"{file}: not a ULog file ({error or type(error).__name__})") from error
    data: dict[str, Any] = {}
    for dataset in log.data_list:
        data.setdefault(dataset.name, dataset.data)
    out = {}
    for name, (topic, field, _) in topics.items():
        if topic not in data:
            raise UnknownNameError("topic", topic, sorted(data))
        if field not in data[topic]:
            raise UnknownNameError(f"field of {topic}", field, sorted(data[topic]))
        time = 1e-6 * np.asarray(data[topic]["timestamp"], dtype=float)
        keep = np.concatenate([[True], np.diff(np.maximum.accumulate(time)) > 0])
        out[name] = time[keep], np.asarray(data[topic][field], dtype=float)[keep]
    return out


def _interpolate(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    out = np.interp(grid, time, values)
    if len(time) > 2:
        after = np.clip(np.searchsorted(time, grid), 1, len(time) - 1)
        step = time[after] - time[after - 1]
        exact = np.isclose(grid, time[after], rtol=0, atol=1e-9) | np.isclose(
            grid, time[after - 1], rtol=0, atol=1e-9
        )
        out[(step > SILENCE * np.median(np.diff(time))) & ~exact] = np.nan
    return out
