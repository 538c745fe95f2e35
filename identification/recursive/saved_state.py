"""A recursive estimator's state as a file: JSON, every number in hexadecimal, hence exact."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

from identification.recursive.kernel.configuration import KernelConfiguration
from identification.recursive.rls_state import RLSState
from symheli.errors import InputError
from symheli.values.whole_files import write_text

SCHEMA, VERSION = "symheli recursive estimator", 3


def save(state: RLSState, path: str | os.PathLike[str]) -> None:
    """Write `state` with what it belongs to. Raises `SymheliError` where the disk is full or the
    folder cannot be written.
    """
    numbers = [float(value).hex() for value in state.memory]
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        **description(state.configuration),
        "digest": _digest(numbers),
        "memory": numbers,
    }
    write_text(path, json.dumps(content, indent=1) + "\n")


def load(configuration: KernelConfiguration, path: str | os.PathLike[str]) -> RLSState:
    """Load the state in `path`; raise `InputError` unless it is whole and belongs to an estimator
    of this configuration.
    """
    content = _read(Path(path))
    if content.get("schema") != SCHEMA:
        raise InputError(f"{path}: expected a file of {SCHEMA!r}, got {content.get('schema')!r}")
    if content.get("version") != VERSION:
        raise InputError(
            f"{path}: version {content.get('version')!r} of the format, this program reads"
            f" {VERSION}"
        )
    for part, expected in description(configuration).items():
        _require_same(path, part, expected, content.get(part))
    numbers = content.get("memory")
    if not isinstance(numbers, list) or _digest(numbers) != content.get("digest"):
        raise InputError(
            f"{path}: the numbers do not match their digest, the file is damaged; take an older"
            " copy"
        )
    memory = np.array([float.fromhex(value) for value in numbers], configuration.dtype)
    if memory.shape != (configuration.sizes[0],) or not np.isfinite(memory).all():
        raise InputError(
            f"{path}: expected {configuration.sizes[0]} finite numbers, got {len(memory)}, or some"
            " that are not finite"
        )
    return RLSState(configuration, memory)


def description(configuration: KernelConfiguration) -> dict[str, Any]:
    """Return the configuration of a state: every field of structure and forgetting, and the
    precision.
    """
    return {
        "precision": np.dtype(configuration.dtype).name,
        "forgetting": repr(configuration.forgetting),
        "structure": _fields(configuration.structure),
    }


def _fields(value: Any) -> dict[str, str]:
    """Return the fields that are not at their default, so that a later version may add one and old
    files stay readable.
    """
    given = {
        f.name: getattr(value, f.name)
        for f in dataclasses.fields(value)
        if getattr(value, f.name) != f.default
    }
    return {
        name: re.sub(r" at 0x[0-9a-f]+", "", repr(value)) for name, value in given.items()
    }  # functions go by their name


def _require_same(path: str | os.PathLike[str], part: str, expected: Any, got: Any) -> None:
    if expected == got:
        return
    if isinstance(expected, dict) and isinstance(got, dict):
        name = next(n for n in (*expected, *got) if expected.get(n) != got.get(n))
        part, expected, got = (
            f"{part}, {name}",
            expected.get(name, "the default"),
            got.get(name, "the default"),
        )
    raise InputError(
        f"{path}: the state belongs to another estimator: {part} is {got}, expected {expected}"
    )


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(
            f"{path}: not a whole file of {SCHEMA!r} ({error}); take an older copy"
        ) from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: not a file of {SCHEMA!r}")
    return content


def _digest(numbers: list[Any]) -> str:
    return hashlib.sha256("\n".join(map(str, numbers)).encode()).hexdigest()
