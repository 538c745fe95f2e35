"""Identified models as files: JSON with a schema and a digest, every number exact; and the parts of
MATLAB files that they share.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv import (
    BSpline,
    FunctionSpace,
    PiecewiseLinear,
    Polynomial,
    Product,
    Spline,
    UserFunctions,
)
from symheli.values import Signal
from symheli.values.arrays import Array
from symheli.values.whole_files import write_bytes, write_text

VERSION = 1
BASES = {kind.__name__: kind for kind in (BSpline, PiecewiseLinear, Polynomial, Spline)}
"""Bases that are their fields."""


def write(path: str | os.PathLike[str], schema: str, content: dict[str, Any]) -> Path:
    """Write plain values; a reader sees the old file or the new one, never half of it.

    Raises `InputError` for anything but plain finite values, `SymheliError` where the file cannot
    be written.
    """
    try:
        content = json.loads(_canonical(content))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"a model file holds plain finite numbers, texts and lists: {error}"
        ) from error
    whole = {"schema": schema, "version": VERSION, **content, "digest": _digest(content)}
    return write_text(path, json.dumps(whole, indent=1, allow_nan=False) + "\n")


def read(path: str | os.PathLike[str], schema: str) -> dict[str, Any]:
    """What `write` wrote; raises `InputError` unless the file is whole and of this schema."""
    try:
        whole = json.loads(Path(path).read_text(encoding="utf-8"))
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
    """What to raise where a whole file lacks a part."""
    return InputError(f"{path}: a part of the model is missing or of the wrong kind ({error})")


def described_basis(basis: FunctionSpace) -> dict[str, Any]:
    """A basis in plain values; raises `InputError` for one of another kind."""
    kind = type(basis).__name__
    if isinstance(basis, Product):
        return {
            "kind": kind,
            "factors": [described_basis(f) for f in basis.factors],
            "total_degree": basis.total_degree,
        }
    if isinstance(basis, UserFunctions):
        return {"kind": kind, "names": basis.names, "low": basis.low, "high": basis.high}
    if kind not in BASES:
        raise InputError(
            f"a basis of kind {kind} cannot be written to a file; choose from"
            f" {', '.join([*BASES, 'Product', 'UserFunctions'])}"
        )
    return {"kind": kind, **{f.name: getattr(basis, f.name) for f in fields(basis)}}  # type: ignore[arg-type]


def basis_of(
    described: dict[str, Any], given: FunctionSpace | None, path: str | os.PathLike[str]
) -> FunctionSpace:
    """The basis `described`, or the one `given` if it is that; raises `InputError` where functions
    are not in the file.
    """
    if given is not None:
        if json.loads(_canonical(described_basis(given))) != described:
            raise InputError(
                f"{path}: the model belongs to another basis than the one given: {described}"
            )
        return given
    options = dict(described)
    kind = options.pop("kind")
    if kind == "Product":
        factors = tuple(basis_of(f, None, path) for f in options["factors"])
        return Product(factors, options["total_degree"])  # type: ignore[arg-type]
    if kind == "UserFunctions":
        raise InputError(
            f"{path}: the functions {', '.join(options['names'])} are not in the file; give the"
            " basis: load(path, basis=...)"
        )
    if kind not in BASES:
        raise InputError(
            f"{path}: a basis of kind {kind!r}, expected one of"
            f" {', '.join([*BASES, 'Product', 'UserFunctions'])}"
        )
    return BASES[kind](**{k: tuples(v) for k, v in options.items()})


def signals_of(names: tuple[str, ...], units: dict[str, str]) -> tuple[Signal, ...]:
    """Names with their units."""
    return tuple(Signal(n, units[n]) for n in names)


def write_mat(path: str | os.PathLike[str], content: Mapping[str, Any]) -> Path:
    """Write variables as a MATLAB file (version 5)."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, dict(content))
    return write_bytes(path, buffer.getvalue())


def cells(**groups: Sequence[Signal]) -> dict[str, Array]:
    """Names and units of groups of signals as cell arrays: outputs, outputs_units, .."""
    return {
        f"{name}{ending}": np.array([text(s) for s in group], dtype=object)
        for name, group in groups.items()
        for ending, text in (("", str), ("_units", lambda s: s.unit))
    }


def powers_of(basis: FunctionSpace) -> Array | None:
    """(functions, parameters) powers of p, None where the basis is not made of polynomials."""
    if isinstance(basis, Polynomial):
        return np.arange(basis.size, dtype=float)[:, None]
    if isinstance(basis, Product) and all(isinstance(f, Polynomial) for f in basis.factors):
        return np.array(basis.indices, dtype=float)
    return None


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True, allow_nan=False)


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(_canonical(content).encode()).hexdigest()


def tuples(value: Any) -> Any:
    """Lists as tuples, inside too."""
    return tuple(tuples(v) for v in value) if isinstance(value, list) else value
