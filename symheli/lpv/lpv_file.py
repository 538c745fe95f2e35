"""LPV models as files: JSON with a schema and a digest, every number exact."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.lpv.bases.described import basis_of, described_basis
from symheli.lpv.bases.function_space import FunctionSpace
from symheli.lpv.lpv_state_space import FitResiduals, LPVStateSpace
from symheli.lpv.scheduling import Scheduling
from symheli.lpv.trim_schedule import TrimSchedule
from symheli.values import Signal, plain_file
from symheli.values.arrays import Array

SCHEMA = "symheli LPV state space"
GROUPS = ("states", "inputs", "outputs")


def save(model: LPVStateSpace, path: str | os.PathLike[str]) -> Path:
    """Write a model, with its trim and residuals; see `LPVStateSpace.save`."""
    trim, residuals = model.trim, model.residuals
    content = {
        "basis": described_basis(model.basis),
        **{name: _written(getattr(model, name)) for name in "ABCD"},
        "parameters": [
            [s.name, s.unit, s.low, s.high, "inf" if s.rate == math.inf else s.rate]
            for s in model.parameters
        ],
        **{group: [[str(s), s.unit] for s in getattr(model, group)] for group in GROUPS},
        "dt": model.dt,
        "trim": trim
        and {
            "basis": described_basis(trim.basis),
            "x": _written(trim.x),
            "u": _written(trim.u),
            **{
                name: None if (M := getattr(trim, name)) is None else _written(M)
                for name in ("xdot", "y")
            },
        },
        "residuals": None if residuals is None else [_written(each) for each in residuals],
    }
    return plain_file.write(path, SCHEMA, content)


def load(path: str | os.PathLike[str], basis: FunctionSpace | None) -> LPVStateSpace:
    """The model in a file; see `LPVStateSpace.load`."""
    content = plain_file.read(path, SCHEMA)
    try:
        trim, residuals = content["trim"], content["residuals"]
        fields: dict[str, Any] = {name: _read(content[name]) for name in "ABCD"}
        for group in GROUPS:
            fields[group] = tuple(Signal(name, unit) for name, unit in content[group])
        return LPVStateSpace(
            basis=basis_of(content["basis"], basis, path),
            **fields,
            parameters=tuple(
                Scheduling(name, unit, low, high, math.inf if rate == "inf" else rate)
                for name, unit, low, high, rate in content["parameters"]
            ),
            dt=content["dt"],
            trim=trim
            and TrimSchedule(
                basis_of(trim["basis"], None, path),
                _read(trim["x"]),
                _read(trim["u"]),
                *(None if (M := trim.get(name)) is None else _read(M) for name in ("xdot", "y")),
            ),
            residuals=None if residuals is None else FitResiduals(*map(_read, residuals)),
        )
    except InputError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise plain_file.incomplete(path, error) from error


def _written(array: Array) -> dict[str, Any]:
    """Return the array with its shape, which an empty list would lose."""
    return {"shape": list(array.shape), "values": array.ravel().tolist()}


def _read(given: dict[str, Any]) -> Array:
    return np.array(given["values"], float).reshape(given["shape"])
