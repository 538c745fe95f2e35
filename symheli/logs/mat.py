"""MATLAB files with one vector a signal, of any version since 5: those of -v7.3 are HDF5 files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.logs.column import Column
from symheli.logs.files import Table, bounded, error_text, seconds_in
from symheli.logs.format import LogFormat
from symheli.logs.mat5 import MAX_INFLATED, check_mat5
from symheli.logs.order import in_order
from symheli.logs.signal_map import SignalMap

HDF5 = b"\x89HDF\r\n\x1a\n"
"""At the beginning, or behind the 512 bytes that MATLAB writes about itself."""

NUMBERS = {
    *("double", "single", "logical"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
}
"""Classes of MATLAB that hold numbers."""


def read_mat(
    path: str | os.PathLike[str], time: str, units: Mapping[str, str], time_unit: str = "s"
) -> Table:
    """The variables named in `units`, and `time` (there in `time_unit`), in s.

    "log.theta" reaches into a struct. Raises `InputError` for a file that is not a MATLAB file
    or is truncated, for -v7.3 without h5py, and for variables that are not vectors of equal length.
    """
    file, factor = bounded(path), seconds_in(time_unit)
    content = _content(file)
    vectors = {name: _vector(content, name, file) for name in (time, *units)}
    n = len(vectors[time])
    for name, vector in vectors.items():
        if len(vector) != n:
            raise InputError(
                f"{file}: {name!r} has {len(vector)} samples, the time {time!r} has {n}"
            )
    columns = {name: vectors[name] for name in units}
    return *in_order(factor * vectors[time], columns, file), dict(units)


def mat_columns(path: str | os.PathLike[str]) -> dict[str, Column]:
    """Every vector of two numbers or more by its name; none has a clock of its own."""
    file = bounded(path)
    return {
        name: Column(None, vector)
        for name, value in _leaves(_content(file))
        if (vector := _as_vector(value)) is not None and len(vector) > 1
    }


def _content(file: Path) -> Mapping[str, Any]:
    """Return variables and nested structs by name; arrays, or any other MATLAB value."""
    from scipy.io import loadmat

    with file.open("rb") as opened:
        if _is_hdf5(opened.read(512 + len(HDF5))):
            return _hdf5(file)
    try:
        check_mat5(file)
        content = loadmat(file, simplify_cells=True)
    except Exception as error:
        raise InputError(
            f"{file}: not a MATLAB file, or one that was cut ({error_text(error)});"
            " save it once more"
        ) from error
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _is_hdf5(head: bytes) -> bool:
    return head.startswith(HDF5) or head[512:].startswith(HDF5)


def _hdf5(file: Path) -> Mapping[str, Any]:
    with extra("logs", "reading a MATLAB 7.3 file"):
        import h5py  # type: ignore[import-not-found]

    def read(group: Any) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for name, item in group.items():
            if name.startswith("#"):  # what cells and objects refer to
                continue
            kind = item.attrs.get("MATLAB_class", b"double")
            kind = kind.decode() if isinstance(kind, bytes) else str(kind)
            if isinstance(item, h5py.Group):
                out[name] = read(item)
            elif kind not in NUMBERS or item.dtype.kind not in "biuf":
                out[name] = f"a {kind}"
            elif item.attrs.get("MATLAB_empty"):
                out[name] = np.zeros(0)
            elif item.nbytes > MAX_INFLATED:  # it may take no space in the file
                raise ValueError(f"{name!r} of more than {MAX_INFLATED / 2**20:.0f} MiB")
            else:
                out[name] = item[()].T  # MATLAB writes columns first
        return out

    try:
        with h5py.File(file, "r") as opened:
            return read(opened)
    except Exception as error:
        raise InputError(
            f"{file}: a MATLAB 7.3 file that was cut or damaged ({error_text(error)});"
            " save it once more"
        ) from error


def _leaves(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def _as_vector(value: Any) -> np.ndarray | None:
    """Return the vector, None where the value is not a vector of numbers."""
    try:
        array = np.atleast_1d(np.squeeze(np.asarray(value, dtype=float)))
    except (TypeError, ValueError):
        return None
    return array if array.ndim == 1 else None


def _vector(content: Mapping[str, Any], name: str, file: object) -> np.ndarray:
    value: Any = content
    for part in name.split("."):
        known = list(value) if isinstance(value, Mapping) else []
        if part not in known:
            raise UnknownNameError("variable", name, known)
        value = value[part]
    try:
        array = np.atleast_1d(np.squeeze(np.asarray(value, dtype=float)))
    except (TypeError, ValueError) as error:
        raise InputError(f"{file}: {name!r} does not hold numbers") from error
    if array.ndim != 1:
        raise InputError(f"{file}: expected {name!r} to be a vector, its shape is {array.shape}")
    return array


class Matlab(LogFormat):
    """MATLAB files, of one vector a signal."""

    name, time_column = "mat", True
    columns = staticmethod(mat_columns)

    def recognises(self, head: bytes) -> bool:
        """Whether MATLAB wrote it, or it is an HDF5 file."""
        return head.startswith(b"MATLAB") or _is_hdf5(head)

    def read(self, path: str | os.PathLike[str], by: SignalMap) -> Table:
        """Read the vectors of a map, which names that of the time."""
        if by.time is None:
            raise InputError(f"{path}: name the time vector in the signal map: time = ...")
        declared = {column: unit or "1" for column, unit in by.given.items()}
        return read_mat(path, by.time, declared, by.time_unit or "s")
