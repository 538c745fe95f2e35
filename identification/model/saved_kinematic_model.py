"""Files of identified rigid vehicles: JSON with a schema, every number exact; and MATLAB."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from identification.model import model_file, saved_model
from identification.model.kinematic_model import KinematicModel
from identification.structure.actuators import Actuators
from identification.structure.kinematic_arx import MOVING, KinematicARX
from identification.structure.late_sensors import LateSensors
from identification.structure.steady_wind import SteadyWind
from symheli.flight import Servo
from symheli.lpv.bases import FunctionSpace
from symheli.values import plain_file
from symheli.values.kinematics import GRAVITY

SCHEMA = "symheli model with known kinematics"


def save(model: KinematicModel, path: str | os.PathLike[str]) -> Path:
    """Write a model; a reader sees the old file or the new one, never half of it. The excitation
    report is not kept.

    Raises `InputError` where `details` hold more than plain values, `SymheliError` where the file
    cannot be written.
    """
    return plain_file.write(
        path,
        SCHEMA,
        {
            "structure": _described(model.structure),
            **saved_model.described(model.aerodynamics),
            "trim": model.trim.tolist(),
            "drive": None if model.drive is None else saved_model.described(model.drive),
        },
    )


def _described(kin: KinematicARX) -> dict[str, Any]:
    """The fields of a structure in plain values."""
    plain = saved_model.described_structure(kin)
    return plain | {name: part and _finite(asdict(part)) for name, part in _parts(plain)}


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    """Values without those that are infinite: rates of servos without limit, their default."""
    return {
        name: _finite(value) if isinstance(value, dict) else value
        for name, value in values.items()
        if value != np.inf
    }


def _parts(given: dict[str, Any]) -> list[tuple[str, Any]]:
    return [(name, given.get(name)) for name in MADE]


def _actuators(**given: Any) -> Actuators:
    """Actuators from their plain values."""
    servos = given.pop("servos")
    return Actuators(servos and {u: Servo(**servo) for u, servo in servos.items()}, **given)


MADE = {"actuators": _actuators, "wind": SteadyWind, "sensors": LateSensors}
"""Makers of each part of a structure from its plain values."""


def load(path: str | os.PathLike[str], basis: FunctionSpace | None = None) -> KinematicModel:
    """The model in `path`, equal to the last bit; raises `InputError` unless the file is whole and
    of this kind. One with `UserFunctions` needs its `basis`.
    """
    content = plain_file.read(path, SCHEMA)
    try:
        given = saved_model.fields_of_structure(content, basis, path)
        given["na"] = dict(zip(MOVING, given["na"], strict=True))
        parts = {name: part and MADE[name](**part) for name, part in _parts(given)}
        kin = KinematicARX(**(given | parts))
        drive = content.get("drive")
        return KinematicModel(
            structure=kin,
            aerodynamics=saved_model.model_of(kin.aerodynamics, content),
            trim=content["trim"],
            drive=drive and saved_model.model_of(kin.drive, drive),  # type: ignore[arg-type]
        )
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise plain_file.incomplete(path, error) from error


def save_mat(model: KinematicModel, path: str | os.PathLike[str]) -> Path:
    """Write a model as a MATLAB file (version 5; MATLAB, Octave, scipy.io.loadmat): coefficients,
    trim, names, units and a readme.

    A(:,:,j,i) belongs to the function j of the basis and z(k-i), z = (u v w p q r), B(:,:,j,i) to
    u(k-i), c(:,j), d(:,j) (or d(:,j,:) with several parameters), trim(:,j). With polynomials they
    are those of the powers of p in `powers`, a row a function; else of the functions `basis`
    describes.
    """
    aero, basis = model.aerodynamics, model.structure.basis
    powers = model_file.powers_of(basis)
    values = aero.coefficients if powers is None else aero.coefficients.form("monomial")
    trim = model.trim if powers is None else basis.form("monomial").T @ model.trim
    lagged = np.moveaxis(values.B, (0, 1), (3, 2))
    content = {
        "readme": (
            "y = (u v w p q r phi theta), z its first six; y(k) - y(k-1) - dt/2 (kin(y(k)) +"
            " kin(y(k-1))) = [sum_i A_i(p) z(k-i) + sum_i B_i(p) u(k-i) + c(p) + d(p)"
            " (p(k)-p(k-1)); 0; 0], p that of k; kin(y) = (v r - w q - g sin(theta), w p - u r + g"
            " sin(phi) cos(theta), u q - v p + g cos(phi) cos(theta), 0, 0, 0, p + tan(theta) (q"
            " sin(phi) + r cos(phi)), q cos(phi) - r sin(phi)); A(:,:,j,i) multiplies function j,"
            f" {'prod(p.^powers(j,:))' if powers is not None else 'see basis'}; SI units and"
            " radians"
        ),
        "A": lagged[:, : len(MOVING)],
        "B": lagged[:, len(MOVING) :],
        "c": np.moveaxis(values.c, 0, 1),
        "d": np.moveaxis(values.d, 0, 1),
        "trim": trim.T,
        "g": GRAVITY,
        "powers": np.zeros((0, 0)) if powers is None else powers,
        "basis": repr(basis),
        "ranges": np.array(basis.ranges),
        "dt": model.dt,
        "method": model.method,
        "residual_covariance": aero.residual_covariance,
        **model_file.cells(outputs=model.outputs, inputs=model.inputs, scheduling=model.parameters),
    }
    return model_file.write_mat(path, content)
