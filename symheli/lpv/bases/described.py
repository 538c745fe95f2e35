"""Bases as plain values, for files."""

from __future__ import annotations

import os
from dataclasses import fields
from typing import Any

from symheli.errors import InputError
from symheli.lpv.bases.bspline import BSpline
from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.bases.interpolating import CubicSpline, PiecewiseLinear
from symheli.lpv.bases.patches import Patches
from symheli.lpv.bases.polynomial import Polynomial
from symheli.lpv.bases.product import Product
from symheli.lpv.bases.user_functions import UserFunctions
from symheli.values import plain_file

BASES = {
    kind.__name__: kind for kind in (BSpline, Patches, PiecewiseLinear, Polynomial, CubicSpline)
}
"""Bases that are their fields."""
KINDS = {**BASES, "Spline": CubicSpline}
"""By the names in files, of which older ones say Spline."""


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
            raise InputError(f"{path}: the model has another basis than the one given: {described}")
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
    if kind not in KINDS:
        raise InputError(
            f"{path}: a basis of kind {kind!r}, expected one of"
            f" {', '.join([*BASES, 'Product', 'UserFunctions'])}"
        )
    return KINDS[kind](**{k: tuples(v) for k, v in options.items()})


def tuples(value: Any) -> Any:
    """Lists as tuples, inside too."""
    return tuple(tuples(v) for v in value) if isinstance(value, list) else value
