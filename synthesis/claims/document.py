"""Files of plants and claims: JSON, NPZ or MAT with the same keys, read without trust."""

from __future__ import annotations

import io
import json
import os
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array

T = TypeVar("T")

DAMAGED = (
    *(ValueError, LookupError, TypeError, NotImplementedError, EOFError, ArithmeticError),
    *(MemoryError, RecursionError, zipfile.BadZipFile, zlib.error, struct.error),
)
"""Errors that readers of damaged files raise."""
AXIS = "axis"
FIRST, LAST = "first", "last"


def document(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the keys and values of a JSON, NPZ or MAT file.

    Raises `InputError` for a file that cannot be read, or is none of these.
    """
    file = Path(path)
    readers = {".json": _json, ".npz": _npz, ".mat": _mat}
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: expected a file .json, .npz or .mat, got {file.suffix!r}")
    try:
        found = reader(file)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except DAMAGED as error:
        raise InputError(f"{path}: damaged, or not what its name says ({error})") from None
    if not isinstance(found, dict) or not found:
        raise InputError(f'{path}: expected keys and values, as {{"A": [[-1]]}}')
    return found


def read_as(path: str | os.PathLike[str], made: Callable[[dict[str, Any]], T]) -> T:
    """Return what is made of a file's keys and values; an `InputError` of it names the file."""
    content = document(path)
    try:
        return made(content)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _json(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


def _npz(file: Path) -> Any:
    with np.load(io.BytesIO(file.read_bytes()), allow_pickle=False) as content:
        return {name: _plain(content[name]) for name in content.files}


def _mat(file: Path) -> Any:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(io.BytesIO(file.read_bytes()))
    except MatReadError as error:
        raise ValueError(str(error)) from None
    except NotImplementedError:
        raise ValueError("MATLAB 7.3 files are HDF5: save with -v7") from None
    return {k: _plain(v, k) for k, v in content.items() if not k.startswith("__")}


ROWS = frozenset({"p", "h", "h_x", "h_u", "x_max", "u_max"})
"""Keys of vectors, which MATLAB has as matrices of one row or column."""


def _plain(value: Array, name: str = "") -> Any:
    """Return texts as texts, a 1 x 1 matrix of a number as the number, vectors as vectors."""
    if value.dtype.kind in "US":
        texts = [str(v) for v in value.ravel()]
        return texts[0] if len(texts) == 1 and name not in ("states", "f") else texts
    if value.dtype == object:
        return [_plain(np.asarray(v), "cell") for v in value.ravel()]
    if name in ROWS:
        return value.ravel()
    return value.item() if value.ndim == 0 else value


def number(value: Any, name: str) -> Any:
    """Return a number, of a 1 x 1 matrix too; raises `InputError` for more than one."""
    if isinstance(value, str | int | float) or value is None:
        return value
    own = np.asarray(value)
    if own.size != 1:
        raise InputError(f"{name}: expected one number, got shape {own.shape}")
    return own.item()


def stacked(content: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Return matrices of some keys with the axis of the models first.

    Square matrices A or P tell which axis that is; the others have the same. Where a stack of A or
    P could be read both ways, the key "axis" has to say "first" or "last".

    Raises `InputError` where it does not, or where no axis fits.
    """
    found = {name: _array(content[name], name) for name in names if content.get(name) is not None}
    axis = content.get(AXIS)
    if axis is not None and axis not in (FIRST, LAST):
        raise InputError(f"{AXIS}: expected {FIRST!r} or {LAST!r}, got {axis!r:.60}")
    for name in ("A", "P"):
        M = found.get(name)
        if axis is None and M is not None and M.ndim == 3:
            axis = _axis(M, name)
    if axis == LAST:
        found = {k: np.moveaxis(M, -1, 0) if M.ndim == 3 else M for k, M in found.items()}
    elif axis is None and any(M.ndim == 3 for M in found.values()):
        raise InputError(
            f"give {AXIS}, {FIRST!r} or {LAST!r}: no stack of square matrices tells it"
        )
    return found


def _axis(M: Array, name: str) -> str:
    first, last = M.shape[1] == M.shape[2], M.shape[0] == M.shape[1]
    if first and last:
        raise InputError(
            f"{name}: of shape {M.shape} the axis of the models may be the first or the last; add"
            f" the key {AXIS!r}: {LAST!r} as MATLAB has it, or {FIRST!r}"
        )
    if not (first or last):
        raise InputError(f"{name}: expected square matrices, N x n x n or n x n x N, got {M.shape}")
    return FIRST if first else LAST


def _array(value: Any, name: str) -> Array:
    try:
        own = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected numbers, got {value!r:.60}") from None
    if own.ndim < 2 and own.size == 1:
        own = own.reshape(1, 1)
    if own.ndim not in (1, 2, 3):
        raise InputError(f"{name}: expected a matrix or a stack of them, got shape {own.shape}")
    return own


def only(content: Mapping[str, Any], known: Sequence[str]) -> None:
    """Raise `InputError` for keys that are not known, with those that are."""
    foreign = sorted(set(content) - set(known))
    if foreign:
        raise InputError(f"unknown keys {', '.join(foreign)}; known here: {', '.join(known)}")
