"""MATLAB files with one vector a signal."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from symheli.errors import InputError, UnknownNameError
from symheli.logs.files import Table, existing, seconds_in


def read_mat(
    path: str | os.PathLike[str], time: str, units: Mapping[str, str], time_unit: str = "s"
) -> Table:
    """The variables named in `units`, and `time` (there in `time_unit`) in s, from a file saved
    with -v7 or older.

    "log.theta" reaches into a struct. Raises `InputError` for version 7.3, a file that is none of
    MATLAB's, and variables that are no vectors of one length.
    """
    from scipy.io import loadmat

    file, factor = existing(path), seconds_in(time_unit)
    try:
        content = loadmat(file, simplify_cells=True)
    except NotImplementedError as error:
        raise InputError(
            f"{file}: MATLAB 7.3 files are not read; save it with save(..., '-v7')"
        ) from error
    except Exception as error:
        raise InputError(f"{file}: not a MATLAB file ({error})") from error
    vectors = {name: _vector(content, name, file) for name in (time, *units)}
    n = len(vectors[time])
    for name, vector in vectors.items():
        if len(vector) != n:
            raise InputError(
                f"{file}: {name!r} has {len(vector)} samples, the time {time!r} has {n}"
            )
    return factor * vectors[time], {name: vectors[name] for name in units}, dict(units)


def _vector(content: Mapping[str, Any], name: str, file: object) -> np.ndarray:
    value: Any = content
    for part in name.split("."):
        known = [k for k in value if not k.startswith("__")] if isinstance(value, Mapping) else []
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
