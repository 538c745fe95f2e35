"""A flight record as one file: a NumPy archive of plain arrays and a JSON header, no pickle."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.signal import Signal
from symheli.values.whole_files import write_bytes

SCHEMA, VERSION = "symheli flight record", 1

DESCRIBED = "described"
"""Entry of `meta` with the text of items that a file cannot hold."""


class Content(NamedTuple):
    """Content of a record."""

    time: Array
    values: Array
    signals: tuple[Signal, ...]
    note: str
    meta: Mapping[str, Any]
    resampled: str


def write_record(path: str | os.PathLike[str], content: Content) -> os.PathLike[str]:
    """Write the record, compressed; a reader sees the old file or the new one, never half of it."""
    arrays: dict[str, Array] = {"time": content.time, "values": content.values}
    meta, described = {}, dict(content.meta.get(DESCRIBED, {}))
    for name, value in content.meta.items():
        try:
            meta[name] = _tagged(value, arrays)
        except TypeError:
            described[name] = repr(value)
    if described:
        meta[DESCRIBED] = _tagged(described, arrays)
    header = {
        "schema": SCHEMA,
        "version": VERSION,
        "signals": [[str(s), s.unit] for s in content.signals],
        "note": content.note,
        "resampled": content.resampled,
        "meta": meta,
    }
    file = io.BytesIO()
    np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)  # type: ignore[arg-type]
    return write_bytes(path, file.getvalue())


def read_record(path: str | os.PathLike[str]) -> Content:
    """Read what `write_record` wrote; raise `InputError` for any other file, pickles included."""
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        header = json.loads(str(arrays["header"][()]))
        if header["schema"] != SCHEMA:
            raise InputError(f"{path}: expected a {SCHEMA!r}, got {header['schema']!r}")
        if header["version"] != VERSION:
            raise InputError(
                f"{path}: version {header['version']!r} of the format, this program reads {VERSION}"
            )
        return Content(
            arrays["time"],
            arrays["values"],
            tuple(Signal(name, unit) for name, unit in header["signals"]),
            header["note"],
            {name: _untagged(value, arrays) for name, value in header["meta"].items()},
            header["resampled"],
        )
    except InputError:
        raise
    except OSError as error:
        if error.errno is not None:
            raise InputError(f"{path}: {error.strerror}") from error
        raise _not_whole(path, error) from error
    except Exception as error:  # an archive that is damaged fails in many ways
        raise _not_whole(path, error) from error


def _not_whole(path: object, error: Exception) -> InputError:
    return InputError(
        f"{path}: not a whole file of FlightRecord.save ({str(error) or type(error).__name__});"
        " pickles are never read; take an older copy"
    )


def _tagged(value: Any, arrays: dict[str, Array]) -> Any:
    """Return the value as JSON, with a tag for types that JSON does not distinguish; arrays go to
    `arrays`. Raises `TypeError` for a value that is not plain.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufcUS":
        name = f"array{len(arrays)}"
        arrays[name] = value
        return ["array", name]
    if type(value) in (list, tuple):
        return [type(value).__name__, [_tagged(item, arrays) for item in value]]
    if isinstance(value, Mapping) and all(type(key) is str for key in value):
        return ["dict", [[key, _tagged(item, arrays)] for key, item in value.items()]]
    raise TypeError(type(value).__name__)


def _untagged(value: Any, arrays: Mapping[str, Array]) -> Any:
    if not isinstance(value, list):
        return value
    kind, content = value
    match kind:
        case "array":
            return arrays[content]
        case "dict":
            return {key: _untagged(item, arrays) for key, item in content}
    items = [_untagged(item, arrays) for item in content]
    return tuple(items) if kind == "tuple" else items
