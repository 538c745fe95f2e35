"""Files of identified models: JSON with a schema, every number exact."""

from __future__ import annotations

import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from identification.model import model_file
from identification.model.lpvarx_model import LPVARXModel
from identification.model.noise_model import NoiseModel
from identification.structure.lpvarx import LPVARX
from symheli.lpv.bases import FunctionSpace
from symheli.lpv.bases.described import basis_of, described_basis, tuples
from symheli.values import plain_file
from symheli.values.arrays import Array

SCHEMA = "symheli LPV-ARX model"


def save(model: LPVARXModel, path: str | os.PathLike[str]) -> Path:
    """Write a model; a reader sees the old file or the new one, never half of it. The excitation
    report is not kept.

    Raises `InputError` where `details` hold more than plain values, `SymheliError` where the file
    cannot be written.
    """
    structure = described_structure(model.structure)
    return plain_file.write(path, SCHEMA, {"structure": structure, **described(model)})


def described_structure(structure: Any) -> dict[str, Any]:
    """The fields of a structure in plain values."""
    return {f.name: getattr(structure, f.name) for f in fields(structure) if f.name != "basis"} | {
        "basis": described_basis(structure.basis)
    }


def described(model: LPVARXModel) -> dict[str, Any]:
    """Return all of a model but its structure, in plain values."""
    return {
        "units": {str(s): s.unit for s in (*model.outputs, *model.inputs, *model.parameters)},
        "dt": model.dt,
        "theta": model.theta.tolist(),
        "residual_covariance": model.residual_covariance.tolist(),
        "covariance": None if model.covariance is None else model.covariance.tolist(),
        "rows_used": model.rows_used,
        "rows_dropped": model.rows_dropped,
        "method": model.method,
        "least_squares": model.least_squares,
        "details": dict(model.details),
        "noise": None if model.noise is None else model.noise.described(),
    }


def load(path: str | os.PathLike[str], basis: FunctionSpace | None = None) -> LPVARXModel:
    """The model in `path`, equal to the last bit; raises `InputError` unless the file is whole and
    of this kind.

    A model with `UserFunctions` needs the `basis` it was identified with: functions are not written
    to files.
    """
    content = plain_file.read(path, SCHEMA)
    try:
        structure = LPVARX(**fields_of_structure(content, basis, path))
        return model_of(structure, content)
    except (KeyError, TypeError, AttributeError) as error:
        raise plain_file.incomplete(path, error) from error


def fields_of_structure(
    content: dict[str, Any], basis: FunctionSpace | None, path: str | os.PathLike[str]
) -> dict[str, Any]:
    """Return the fields of a structure from the output of `described_structure`."""
    given = dict(content["structure"])
    described = given.pop("basis")
    return {
        **{k: tuples(v) for k, v in given.items()},
        "basis": basis_of(described, basis, path),
    }


def model_of(structure: LPVARX, content: dict[str, Any]) -> LPVARXModel:
    """The model of a structure that `described` described."""
    units = content["units"]
    return LPVARXModel(
        structure=structure,
        theta=np.array(content["theta"], float).reshape(-1, structure.ny),
        dt=content["dt"],
        outputs=model_file.signals_of(structure.outputs, units),
        inputs=model_file.signals_of(structure.inputs, units),
        scheduling=model_file.signals_of(structure.parameters, units),
        residual_covariance=content["residual_covariance"],
        rows_used=content["rows_used"],
        rows_dropped=content["rows_dropped"],
        method=content["method"],
        least_squares=content.get("least_squares"),
        excitation=None,
        details=content["details"],
        covariance=_covariance_of(structure, content),
        noise=NoiseModel(**noise) if (noise := content.get("noise")) else None,
    )


def _covariance_of(structure: LPVARX, content: dict[str, Any]) -> Array | None:
    """Return the joint covariance of all coefficients, also from files of an earlier layout.

    Those of an `LPVARXModel` held it an equation at a time, (ny, n, n): with one output that is all
    of it, with several the model has none, since what was not kept between equations is unknown and
    not zero. Those of a `KinematicModel` held it all under another name.
    """
    found = content.get("coefficient_covariance")
    if found is None:
        found = content["covariance"]
    if found is None:
        return None
    covariance = np.asarray(found, float)
    if covariance.ndim == 3:
        return covariance[:, :, None] if structure.ny == 1 else None
    return covariance


def save_mat(model: LPVARXModel, path: str | os.PathLike[str]) -> Path:
    """Write a model as a MATLAB file (version 5; MATLAB, Octave, scipy.io.loadmat): coefficients,
    names, units and a readme.

    A(:,:,j,i) belongs to the function j of the basis and y(k-i), B(:,:,j,i) to u(k-input_lags(i)),
    c(:,j), d(:,j) (or d(:,j,:) with several parameters). With polynomials they are those of the
    powers of p in `powers`, a row a function; else of the functions `basis` describes.
    """
    arx, coefficients = model.structure, model.coefficients
    powers = model_file.powers_of(arx.basis)
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
        **model_file.cells(outputs=model.outputs, inputs=model.inputs, scheduling=model.parameters),
    }
    return model_file.write_mat(path, content)
