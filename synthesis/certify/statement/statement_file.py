"""Files of proven statements: one format, and readers that are found by entry points.

A file is JSON: its schema and version, the `statement` that names its reader, and what that class
stored. An entry point of the group `symheli.statements` names the class, so that whoever adds a
statement adds no line here.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import CertificateError, InputError
from symheli.values.whole_files import write_text

if TYPE_CHECKING:
    from synthesis.certify.statement.proven_statement import ProvenStatement

SCHEMA, VERSION = "symheli statement", 2
GROUP = "symheli.statements"
FORMER = {
    ("symheli certificate", 1): "certificate",
    ("symheli set", 1): "set",
    ("symheli tube", 4): "tube",
}
"""Schema and version of files that were written before there was one format, and their readers."""

DAMAGED = (
    *(TypeError, ValueError, AttributeError, LookupError),
    *(ArithmeticError, RecursionError, np.linalg.LinAlgError),
)
"""Errors that values of a damaged file raise."""


def write(found: ProvenStatement, path: str | os.PathLike[str]) -> Path:
    """Write a statement with everything that proves it, every double exactly."""
    head = {"schema": SCHEMA, "version": VERSION, "statement": type(found).reader}
    content = {**head, **found.stored}
    return write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def read(path: str | os.PathLike[str], kind: type[Any] | None = None) -> Any:
    """Read a statement, of this class where one is given, and prove it anew.

    Raises `InputError` for a file that is damaged, another or of an unknown statement, and
    `CertificateError` for one that contradicts itself.
    """
    content = content_of(path)
    try:
        reader = _reader(content)
        if kind is not None and not (issubclass(reader, kind) or issubclass(kind, reader)):
            raise InputError(
                f"expected {kind.__name__}, got a file of the statement {reader.reader!r};"
                f" read it with {reader.__name__}.load or symheli verify"
            )
        with np.errstate(all="ignore"):
            found = reader.restored(content)
            if kind is not None and not isinstance(found, kind):
                raise InputError(f"expected {kind.__name__}, got {type(found).__name__}")
            return found
    except CertificateError as error:
        raise CertificateError(f"{path}: {error}") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except DAMAGED as error:
        raise InputError(f"{path}: damaged, a value is invalid or missing ({error})") from None


def content_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the JSON of a file of a statement; raise `InputError` for any other file."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_refused)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: expected a proven statement as JSON, got another or a damaged file ({error});"
            " write it again with its .save"
        ) from None
    schemas = {schema for schema, _ in FORMER} | {SCHEMA}
    schema = content.get("schema") if isinstance(content, dict) else None
    if not isinstance(schema, str) or schema not in schemas:
        raise InputError(
            f"{path}: expected the schema {SCHEMA!r}; this file was not written by the .save of a"
            " certificate, set, tube, dwell time or margin"
        )
    return content


def _reader(content: Mapping[str, Any]) -> type[ProvenStatement]:
    schema, version = content["schema"], content.get("version")
    versions = [v for s, v in FORMER if s == schema] or [VERSION]
    if isinstance(version, bool) or version not in versions:
        raise InputError(
            f"expected version {versions[0]} of the schema, got {version!r:.60};"
            " read it with the version of symheli that wrote it"
        )
    name = content.get("statement") if schema == SCHEMA else FORMER[schema, version]
    known = {point.name: point for point in entry_points(group=GROUP)}
    if not isinstance(name, str) or name not in known:
        raise InputError(
            f"unknown statement {name!r:.60}; known here: {', '.join(sorted(known)) or 'none'}."
            " Install the package that wrote the file"
        )
    return known[name].load()


def _refused(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON")
