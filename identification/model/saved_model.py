"""An identified model as a file: JSON with a schema, every number exact."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from identification.model.lpvarx_model import LPVARXModel
from identification.structure.lpvarx import LPVARX
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
from symheli.values.whole_files import write_bytes, write_text

SCHEMA, VERSION = "symheli LPV-ARX model", 1
BASES = {kind.__name__: kind for kind in (BSpline, PiecewiseLinear, Polynomial, Spline)}
"""Bases that are their fields."""


def save(model: LPVARXModel, path: str | os.PathLike[str]) -> Path:
    """Write a model; a reader sees the old file or the new one, never half of it. The excitation
    report is not kept.

    Raises `InputError` where `details` hold more than plain values, `SymheliError` where the file
    cannot be written.
    """
    arx = model.structure
    content = {
        "structure": (
            {f.name: getattr(arx, f.name) for f in fields(arx) if f.name != "basis"}
            | {"basis": _basis_fields(arx.basis)}
        ),
        "units": {str(s): s.unit for s in (*model.outputs, *model.inputs, *model.parameters)},
        "dt": model.dt,
        "theta": model.theta.tolist(),
        "residual_covariance": model.residual_covariance.tolist(),
        "covariance": None if model.covariance is None else model.covariance.tolist(),
        "rows_used": model.rows_used,
        "rows_dropped": model.rows_dropped,
        "method": model.method,
        "details": dict(model.details),
    }
    try:
        content = json.loads(_canonical(content))
    except (TypeError, ValueError) as error:
        raise InputError(
            f"a model file holds plain finite numbers, texts and lists: {error}"
        ) from error
    whole = {"schema": SCHEMA, "version": VERSION, **content, "digest": _digest(content)}
    return write_text(path, json.dumps(whole, indent=1, allow_nan=False) + "\n")


def load(path: str | os.PathLike[str], basis: FunctionSpace | None = None) -> LPVARXModel:
    """The model in `path`, equal to the last bit; raises `InputError` unless the file is whole and
    of this kind.

    A model with `UserFunctions` needs the `basis` it was identified with: functions are not written
    to files.
    """
    content = _read(Path(path))
    try:
        given = dict(content["structure"])
        described = given.pop("basis")
        structure = LPVARX(
            **{k: _tuples(v) for k, v in given.items()}, basis=_basis(described, basis, path)
        )
        units = content["units"]
        return LPVARXModel(
            structure=structure,
            theta=np.array(content["theta"], float).reshape(-1, structure.ny),
            dt=content["dt"],
            outputs=_signals(structure.outputs, units),
            inputs=_signals(structure.inputs, units),
            scheduling=_signals(structure.parameters, units),
            residual_covariance=content["residual_covariance"],
            rows_used=content["rows_used"],
            rows_dropped=content["rows_dropped"],
            method=content["method"],
            excitation=None,
            details=content["details"],
            covariance=content["covariance"],
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: a part of the model is missing or of the wrong kind ({error})"
        ) from error


def save_mat(model: LPVARXModel, path: str | os.PathLike[str]) -> Path:
    """Write a model as a MATLAB file (version 5; MATLAB, Octave, scipy.io.loadmat): coefficients,
    names, units and a readme.

    A(:,:,j,i) belongs to the function j of the basis and y(k-i), B(:,:,j,i) to u(k-input_lags(i)),
    c(:,j), d(:,j) (or d(:,j,:) with several parameters). With polynomials they are those of the
    powers of p in `powers`, a row a function; else of the functions `basis` describes.
    """
    import io

    from scipy.io import savemat

    arx, coefficients = model.structure, model.coefficients
    powers = _powers(arx.basis)
    values = coefficients if powers is None else coefficients.form("monomial")
    content = {
        "readme": (
            "y(k) = -sum_i A_i(p) y(k-i) + sum_i B_i(p) u(k-input_lags(i)) + c(p) + d(p)"
            " (p(k)-p(k-1)), coefficients at p"
            f" {'of their lag (c, d: p(k-1))' if arx.scheduling_at == 'lag' else 'now'}; A(:,:,j,i)"
            " multiplies function j,"
            f" {'prod(p.^powers(j,:))' if powers is not None else 'see basis'}; SI units and"
            " radians"
        ),
        "A": np.moveaxis(values.A, (0, 1), (3, 2)),
        "B": np.moveaxis(values.B, (0, 1), (3, 2)),
        "c": np.moveaxis(values.c, 0, 1),
        "d": np.moveaxis(values.d, 0, 1),
        "powers": np.zeros((0, 0)) if powers is None else powers,
        "basis": repr(arx.basis),
        "ranges": np.array(arx.basis.ranges),
        "output_lags": np.array(arx.output_lags),
        "input_lags": np.array(arx.input_lags),
        "scheduling_at": arx.scheduling_at,
        "dt": model.dt,
        "method": model.method,
        "residual_covariance": model.residual_covariance,
        **{
            f"{name}{ending}": np.array([text(s) for s in group], dtype=object)
            for name, group in (
                ("outputs", model.outputs),
                ("inputs", model.inputs),
                ("scheduling", model.parameters),
            )
            for ending, text in (("", str), ("_units", lambda s: s.unit))
        },
    }
    buffer = io.BytesIO()
    savemat(buffer, content)
    return write_bytes(path, buffer.getvalue())


def _powers(basis: FunctionSpace) -> np.ndarray | None:
    """(functions, parameters) powers of p, None where the basis is not made of polynomials."""
    if isinstance(basis, Polynomial):
        return np.arange(basis.size, dtype=float)[:, None]
    if isinstance(basis, Product) and all(isinstance(f, Polynomial) for f in basis.factors):
        return np.array(basis.indices, dtype=float)
    return None


def _basis_fields(basis: FunctionSpace) -> dict[str, Any]:
    kind = type(basis).__name__
    if isinstance(basis, Product):
        return {
            "kind": kind,
            "factors": [_basis_fields(f) for f in basis.factors],
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


def _basis(
    described: dict[str, Any], given: FunctionSpace | None, path: str | os.PathLike[str]
) -> FunctionSpace:
    if given is not None:
        if json.loads(_canonical(_basis_fields(given))) != described:
            raise InputError(
                f"{path}: the model belongs to another basis than the one given: {described}"
            )
        return given
    options = dict(described)
    kind = options.pop("kind")
    if kind == "Product":
        factors = tuple(_basis(f, None, path) for f in options["factors"])
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
    return BASES[kind](**{k: _tuples(v) for k, v in options.items()})


def _read(path: Path) -> dict[str, Any]:
    try:
        whole = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:
        raise InputError(
            f"{path}: not a whole file of {SCHEMA!r} ({error}); take an older copy"
        ) from error
    if not isinstance(whole, dict) or whole.get("schema") != SCHEMA:
        found = whole.get("schema") if isinstance(whole, dict) else type(whole).__name__
        raise InputError(f"{path}: expected a file of {SCHEMA!r}, got {found!r}")
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


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True, allow_nan=False)


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(_canonical(content).encode()).hexdigest()


def _tuples(value: Any) -> Any:
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


def _signals(names: tuple[str, ...], units: dict[str, str]) -> tuple[Signal, ...]:
    return tuple(Signal(n, units[n]) for n in names)
