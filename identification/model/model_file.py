"""Bases and signals as plain values, and the parts of MATLAB files that identified models share."""

from __future__ import annotations

import io
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
from symheli.values import Signal, plain_file
from symheli.values.arrays import Array
from symheli.values.whole_files import write_bytes

BASES = {kind.__name__: kind for kind in (BSpline, PiecewiseLinear, Polynomial, Spline)}
"""Bases that are their fields."""


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
        if plain_file.as_read(described_basis(given)) != described:
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


def tuples(value: Any) -> Any:
    """Lists as tuples, inside too."""
    return tuple(tuples(v) for v in value) if isinstance(value, list) else value
