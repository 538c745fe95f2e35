"""Values as files: JSON with a schema and a digest, every number exact."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from symheli.errors import InputError
from symheli.values.whole_files import write_text

VERSION = 1


def write(path: str | os.PathLike[str], schema: str, content: dict[str, Any]) -> Path:
    """Write plain values; a reader sees the old file or the new one, never half of it.

    Raises `InputError` for anything but plain finite values, `SymheliError` where the file cannot
    be written.
    """
    try:
        content = as_read(content)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"a model file holds plain finite numbers, texts and lists: {error}"
        ) from error
    whole = {"schema": schema, "version": VERSION, **content, "digest": _digest(content)}
    return write_text(path, json.dumps(whole, indent=1, allow_nan=False) + "\n")


def read(path: str | os.PathLike[str], schema: str) -> dict[str, Any]:
    """Read what `write` wrote; raise `InputError` unless the file is whole and of this schema."""
    try:
        whole = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_refused)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(
            f"{path}: not a whole file of {schema!r} ({error}); take an older copy"
        ) from error
    if not isinstance(whole, dict) or whole.get("schema") != schema:
        found = whole.get("schema") if isinstance(whole, dict) else type(whole).__name__
        raise InputError(f"{path}: expected a file of {schema!r}, got {found!r}")
    if whole.get("version") != VERSION:
        raise InputError(
            f"{path}: version {whole.get('version')!r} of the format, this program reads {VERSION}"
        )
    content = {k: v for k, v in whole.items() if k not in ("schema", "version", "digest")}
    if whole.get("digest") != _digest(content):
        raise InputError(
            f"{path}: the content does not match its digest, the file was damaged or edited; take"
            " an older copy"
        )
    return content


def incomplete(path: str | os.PathLike[str], error: Exception) -> InputError:
    """Return the error for a whole file that lacks a part."""
    return InputError(f"{path}: a part of the model is missing or of the wrong kind ({error})")


def as_read(content: Any) -> Any:
    """Plain values as a file gives them back: tuples as lists."""
    return json.loads(_canonical(content))


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True, allow_nan=False)


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(_canonical(content).encode()).hexdigest()


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is no number of JSON")
